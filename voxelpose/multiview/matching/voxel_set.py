"""A frame's hull as numbered voxels, on which the matcher lays the body's points."""

from __future__ import annotations

import numpy as np

from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CPU
from voxelpose.multiview.carving.grid import VoxelGrid

FREE_FROM_BODY, TAKEN = -1, -2


class VoxelSet:
    """The voxels of one frame's hull, numbered, so that sets of them are bits.

    Args:
        grid: The grid of the hull.
        occupancy: (nx, ny, nz) bool.
        backend: Finds the voxels that placed points cover.
    """

    def __init__(self, grid: VoxelGrid, occupancy: np.ndarray, backend: Backend = CPU):
        """Numbers the occupied voxels."""
        self.grid, self.backend = grid, backend
        self.occupied = np.argwhere(occupancy)
        self.ids = np.full(occupancy.shape, FREE_FROM_BODY, np.int32)
        self.ids[tuple(self.occupied.T)] = np.arange(len(self.occupied), dtype=np.int32)
        self.words = max((len(self.occupied) + 63) // 64, 1)

    def __len__(self) -> int:
        """Returns the number of occupied voxels."""
        return len(self.occupied)

    def cover(
        self, points: np.ndarray, rotations: np.ndarray, translations_m: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Voxels that placed points cover.

        Args:
            points: (n, 3) in the frame that is placed, m.
            rotations: (K, 3, 3), world from that frame.
            translations_m: (K, 3), world from that frame.

        Returns:
            Bits (K, words) uint64, a set of free occupied voxels each; (K,) int64, how many points
            lie in empty space; (K,) int64, how many lie in voxels that were taken.
        """
        return self.backend.voxel_cover(
            self.grid, self.ids, self.words, points, rotations, translations_m
        )

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
