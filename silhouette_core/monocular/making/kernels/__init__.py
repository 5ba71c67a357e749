"""Compiled loops of making."""
