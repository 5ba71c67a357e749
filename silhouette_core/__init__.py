"""What the monocular and the multi-view estimator share: body, motion, silhouettes, scoring."""
