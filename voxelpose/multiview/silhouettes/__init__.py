"""Silhouettes of a whole recording: completed, cameras checked, kept on disk."""
