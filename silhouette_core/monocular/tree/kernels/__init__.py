"""Compiled loops of the silhouette tree."""
