"""Compiled loops of the proposal."""
