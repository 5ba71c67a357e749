"""The monocular estimator: Bayesian filtering over a tree of silhouettes, and what it takes beyond
the paper.
"""
