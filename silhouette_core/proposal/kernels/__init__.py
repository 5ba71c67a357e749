"""Compiled loops of this folder; plain arrays only."""
