"""Generator of the two template bodies. Not installed."""
