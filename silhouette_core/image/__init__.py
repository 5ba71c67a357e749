"""Silhouettes from images, and part-number images from posed bodies."""
