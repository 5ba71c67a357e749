"""A box of voxels on the world's lattice."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from calib.checks import BoolArray, FloatArray, IntArray, check_array, float_array

LARGEST = 1 << 30
"""Most voxels of a grid: one gigabyte of bool."""


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """A box of cubic voxels, all of whose corners are multiples of the voxel size.

    Two grids of one voxel size therefore share their voxels wherever they overlap, bit for bit: a
    window may follow a person. Raises ValueError where a value has the wrong shape or is
    impossible.
    """

    origin_m: FloatArray
    """(3,) float64, world, m: the lower corner of voxel (0, 0, 0). What is given is moved to the
    nearest lattice point."""
    voxel_size_m: float  #: Edge of a voxel, m.
    shape: tuple[int, int, int]  #: Number of voxels along x, y and z.

    def __post_init__(self) -> None:
        """Checks every value once."""
        origin = float_array("origin_m", self.origin_m, (3,), finite=True)
        shape = tuple(int(n) for n in self.shape)
        size = float(self.voxel_size_m)
        if not (np.isfinite(size) and size > 0):
            raise ValueError(f"voxel_size_m must be positive, got {self.voxel_size_m}")
        if len(shape) != 3 or min(shape) < 1:
            raise ValueError(
                f"shape must be three numbers of voxels, each at least 1, got {self.shape}"
            )
        if shape[0] * shape[1] * shape[2] > LARGEST:
            raise ValueError(
                f"shape {shape} has more than {LARGEST} voxels: choose larger voxels or a smaller"
                " volume"
            )
        origin = np.rint(origin / size) * size
        origin.setflags(write=False)
        for key, value in (("origin_m", origin), ("voxel_size_m", size), ("shape", shape)):
            object.__setattr__(self, key, value)

    @classmethod
    def from_bounds(cls, low_m: ArrayLike, high_m: ArrayLike, voxel_size_m: float) -> "VoxelGrid":
        """Smallest grid that holds the box from `low_m` (3,) to `high_m` (3,), world, m."""
        low = np.floor(np.asarray(low_m, dtype=np.float64) / voxel_size_m + 1e-9)
        high = np.ceil(np.asarray(high_m, dtype=np.float64) / voxel_size_m - 1e-9)
        nx, ny, nz = (int(n) for n in np.maximum(high - low, 1))
        return cls(low * voxel_size_m, voxel_size_m, (nx, ny, nz))

    @property
    def lattice(self) -> IntArray:
        """(3,) int64: the lattice coordinates of voxel (0, 0, 0), in voxels."""
        return np.rint(self.origin_m / self.voxel_size_m).astype(np.int64)

    @property
    def size_m(self) -> FloatArray:
        """(3,) float64: edges of the box, m."""
        return np.array(self.shape) * self.voxel_size_m

    def axes(self, multiple: int = 1) -> tuple[FloatArray, FloatArray, FloatArray]:
        """World coordinates (n,) of the centres along x, y, z, m, on to a multiple of so many."""
        # From the lattice and not from the origin, so that the same voxel has the same bits in
        # every grid.
        counts = (-(-n // multiple) * multiple for n in self.shape)
        x, y, z = (
            (first + np.arange(n) + 0.5) * self.voxel_size_m
            for first, n in zip(self.lattice, counts, strict=True)
        )
        return x, y, z

    def centres(self, indices: ArrayLike) -> FloatArray:
        """Returns the centres of voxels (N, 3) int, (N, 3) float64, world, m."""
        return np.asarray(
            (self.lattice + np.asarray(indices) + 0.5) * self.voxel_size_m, dtype=np.float64
        )

    def occupied_points(self, occupancy: BoolArray) -> FloatArray:
        """Centres (N, 3) float64, world, m, of the voxels in `occupancy` (nx, ny, nz) bool."""
        check_array("occupancy", occupancy, self.shape)
        return self.centres(np.argwhere(occupancy))

    def cropped(self, occupancy: BoolArray) -> tuple["VoxelGrid", BoolArray]:
        """Returns the part of the grid that holds every occupied voxel. Raises ValueError where
        nothing is occupied.
        """
        along = [np.flatnonzero(occupancy.any(axis=others)) for others in ((1, 2), (0, 2), (0, 1))]
        if not len(along[0]):
            raise ValueError("no voxel is occupied")
        low, high = [int(a[0]) for a in along], [int(a[-1]) + 1 for a in along]
        nx, ny, nz = (b - a for a, b in zip(low, high, strict=True))
        grid = VoxelGrid(
            np.asarray((self.lattice + low) * self.voxel_size_m, dtype=np.float64),
            self.voxel_size_m,
            (nx, ny, nz),
        )
        return grid, occupancy[low[0] : high[0], low[1] : high[1], low[2] : high[2]]
