"""Compiled loops of carving."""
