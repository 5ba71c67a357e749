"""Articulated body to voxels: paper B, and the refinement and tracking beyond it."""
