"""Body models: an articulated tree of parts with joints, limits, a mesh and measurements."""
