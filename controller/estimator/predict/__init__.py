"""The filter's time update: the nominal state over a step, its transition matrix, the covariance."""
