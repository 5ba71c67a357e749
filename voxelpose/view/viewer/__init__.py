"""The viewer: scenes of a result, drawn in a browser."""
