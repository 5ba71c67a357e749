"""One camera: what its estimators share, and the estimator that chooses between them."""
