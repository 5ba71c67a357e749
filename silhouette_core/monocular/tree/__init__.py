"""Paper A: the silhouette tree, and Bayesian filtering over it."""
