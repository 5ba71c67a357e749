"""What bodies do, for who has no recorded motion: key poses in a table, smoothly joined."""

from silhouette_core.motion.keyposes.perform import keypose_motions

__all__ = ["keypose_motions"]
