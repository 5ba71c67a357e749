"""Markerless posture estimation from silhouettes, in one camera or several."""
