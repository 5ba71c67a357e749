"""Recorded motion (BVH, exponential maps) in, and onto our body."""

from silhouette_core.motion.recorded.load import load_motions
from silhouette_core.motion.recorded.read import read_recorded
from silhouette_core.motion.recorded.retarget import retarget
from silhouette_core.motion.recorded.skeleton import RecordedMotion

__all__ = ["RecordedMotion", "load_motions", "read_recorded", "retarget"]
