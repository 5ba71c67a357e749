"""The papers' experiments, repeated. Not installed: run from a checkout."""
