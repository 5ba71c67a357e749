"""Paper B: a posture from voxels, interfering parts matched jointly."""
