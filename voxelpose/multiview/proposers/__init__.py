"""Poses of one frame without a prior: the torso, paper B, and limbs on the silhouettes."""
