"""Poses seen from all sides, and the tree in which their silhouettes are searched."""
