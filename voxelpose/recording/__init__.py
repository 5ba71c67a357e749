"""Recording folders: videos, frames, timestamps and the subject."""
