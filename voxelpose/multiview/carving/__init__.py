"""Voxels from silhouettes: the visual hull, and one body's part of it."""
