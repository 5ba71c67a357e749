"""Which body it is that is seen."""
