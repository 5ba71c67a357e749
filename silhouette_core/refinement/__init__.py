"""Continuous refinement of a pose on the silhouettes of one camera or several."""
