"""Markerless posture estimation from silhouettes, in one camera or several."""

__version__ = "0.1.0"
