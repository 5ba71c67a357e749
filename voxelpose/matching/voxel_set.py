"""The hull as numbered voxels, on which the matcher lays the body's lumps of points."""

from __future__ import annotations

import numpy as np

from silhouette_core.scoring.backend import Voxels
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.kernels.bits import cover

FREE_FROM_BODY, TAKEN = -1, -2


class VoxelSet:
    """The voxels of one frame's hull, numbered, so that sets of them are bits.

    Args:
        grid: the voxels' places.
        occupancy: (nx, ny, nz) bool.
    """

    def __init__(self, grid: VoxelGrid, occupancy: np.ndarray):
        """Numbers the occupied voxels."""
        self.grid = grid
        self.occupied = np.argwhere(occupancy)
        self.ids = np.full(occupancy.shape, FREE_FROM_BODY, np.int32)
        self.ids[tuple(self.occupied.T)] = np.arange(len(self.occupied), dtype=np.int32)
        self.words = max((len(self.occupied) + 63) // 64, 1)

    def __len__(self) -> int:
        """Returns the number of occupied voxels."""
        return len(self.occupied)

    def cover(
        self, points: np.ndarray, rotations: np.ndarray, translations: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Finds the voxels that placed points cover.

        Args:
            points: (n, 3) in the frame that is placed.
            rotations: (K, 3, 3), translations: (K, 3): world from that frame.

        Returns: bits (K, words) uint64, a set of free occupied voxels each; (K,) int64, how many
            points lie in empty space; (K,) int64, how many lie in voxels that were taken.
        """
        count = len(rotations)
        bits, empty, inside = (
            np.empty((count, self.words), np.uint64),
            np.empty(count, np.int64),
            np.empty(count, np.int64),
        )
        cover(
            self.ids,
            self.grid.origin_m,
            self.grid.voxel_size_m,
            points,
            rotations,
            translations,
            bits,
            empty,
            inside,
        )
        return bits, empty, inside

    @property
    def free(self) -> Voxels:
        """The occupied voxels that no part has taken yet."""
        return Voxels(self.ids >= 0, self.grid.origin_m, self.grid.voxel_size_m)

    def take(self, bits: np.ndarray) -> None:
        """Gives the voxels of one set (words,) to a part: nothing placed later can claim them."""
        self.ids[tuple(self.voxels(bits).T)] = TAKEN

    def voxels(self, bits: np.ndarray) -> np.ndarray:
        """Returns the indices (n, 3) int64 of the voxels of one set (words,)."""
        return self.occupied[
            np.flatnonzero(
                np.unpackbits(bits.view(np.uint8), bitorder="little")[: len(self.occupied)]
            )
        ]
