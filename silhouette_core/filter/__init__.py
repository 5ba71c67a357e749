"""Monocular estimator: Bayesian filter over a silhouette tree, and tracking beyond the paper."""
