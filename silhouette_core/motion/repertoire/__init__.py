"""What bodies do, for who has no recorded motion: key poses in a table, smoothly joined."""

from silhouette_core.motion.repertoire.perform import repertoire

__all__ = ["repertoire"]
