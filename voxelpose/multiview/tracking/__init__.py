"""Poses over time, off line and live."""
