"""A recording folder: its videos, frames, time stamps and subject."""
