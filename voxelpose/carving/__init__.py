"""Voxel grids and visual hulls."""
