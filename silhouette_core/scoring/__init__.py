"""Scoring many candidate poses against one observation, in batches and in parallel."""
