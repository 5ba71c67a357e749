"""Recorded motion: readers of BVH and exponential maps, and retargeting to the body model."""

from silhouette_core.motion.mocap.load import load_motions, read_clip
from silhouette_core.motion.mocap.retarget import retarget
from silhouette_core.motion.mocap.skeleton import MocapClip

__all__ = ["MocapClip", "load_motions", "read_clip", "retarget"]
