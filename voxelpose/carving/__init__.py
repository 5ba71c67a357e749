"""Voxel grids and the visual hull."""
