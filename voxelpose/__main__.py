"""Entry point of `python -m voxelpose`."""

from voxelpose.cli import main

main()
