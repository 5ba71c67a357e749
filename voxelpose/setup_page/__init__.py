"""The page of `voxelpose setup`: regions, unknown places, points, silhouettes, cameras and up."""
