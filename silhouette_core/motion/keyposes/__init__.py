"""Motions interpolated from a table of key poses, for use without recorded motion."""

from silhouette_core.motion.keyposes.perform import keypose_motions

__all__ = ["keypose_motions"]
