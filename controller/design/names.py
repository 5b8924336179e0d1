"""Names of the designs, apart from what computes them: a command line needs no linear algebra."""

DESIGNS = ("default", "paper", "paper-lqr", "geometric")
ON_ESTIMATE = "default-on-estimate"
"""What `default` is for feedback from the estimator."""
FOR_ESTIMATES = {"default": ON_ESTIMATE, "geometric": "geometric-on-estimate"}
"""Designs with weights of their own for feedback from the estimator."""
