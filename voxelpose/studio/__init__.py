"""The page of `voxelpose studio`: from recorded files to exported motion, step by step."""
