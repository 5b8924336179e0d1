"""Names of the designs, apart from what computes them: a command line needs no linear algebra."""

DESIGNS = ("default", "paper", "paper-lqr")
ON_ESTIMATE = "default-on-estimate"
"""What `default` is for feedback from the estimator."""
