"""Pictures of results, and the viewer."""
