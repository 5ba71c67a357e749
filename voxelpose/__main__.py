"""python -m voxelpose."""

from voxelpose.cli import main

main()
