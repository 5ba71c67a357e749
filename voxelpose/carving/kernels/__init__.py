"""Compiled loops of the carver; plain arrays only."""
