"""The body as lumps of points, and the hull as numbered voxels: the two things that the voxel matcher lays over each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kernels.kinematics import place_one_part
from silhouette_core.scoring.backend import Backend, Voxels
from silhouette_core.scoring.cpu import CpuBackend
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.kernels.bits import cover
from voxelpose.matching.limbs import LIMBS, Limb
from voxelpose.matching.pose import Pose

FREE_FROM_BODY, TAKEN = -1, -2


@dataclass(frozen=True, eq=False)
class Solid:
    """A body filled with points, about one per voxel.

    Attributes:
        model: the body.
        points: limb name -> (n, 3) float64, positions at rest relative to the joint of the limb's first part.
        part_points: 27 arrays (n_p, 3), the same points by part, relative to each part's own joint.
        backend: what scores many placements at once.
    """

    model: BodyModel
    points: dict[str, np.ndarray]
    part_points: list[np.ndarray]
    backend: Backend

    @classmethod
    def of(cls, model: BodyModel, spacing_m: float, backend: Backend | None = None) -> Solid:
        """Fills a body, one point every `spacing_m` along each axis; by default all cores score it."""
        parts = model.part_points(spacing_m)
        points = {}
        for limb in LIMBS:
            held = [model.names.index(name) for name in limb.parts]
            points[limb.name] = np.concatenate([parts[p] + model.joints_m[p] for p in held]) - model.joints_m[limb.part]
        return cls(model, points, parts, backend or CpuBackend())

    def placements(self, limb: Limb, root: Pose, angles_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places a limb for each of K choices of angles.

        Args:
            limb: which.
            root: gives root position and rotation.
            angles_rad: (K, D).

        Returns:
            rotations (K, 3, 3) and translations (K, 3), world from the limb's first part.
        """
        model = self.model
        chain, parents, freedoms, freedom_part = _chain(limb.part)
        rotations, origins = np.empty((len(angles_rad), 3, 3)), np.empty((len(angles_rad), 3))
        place_one_part(
            parents, model.joints_m[chain], freedom_part, model.dof_axis[freedoms], root.root_rotation, root.root_m,
            np.ascontiguousarray(angles_rad[:, freedoms]), len(chain) - 1, rotations, origins,
        )  # fmt: skip
        return rotations, origins


@cache
def _chain(part: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Returns the parts from the root to one part, their parents within that chain, the angles that turn them, and the part of each."""
    chain = [part]
    while BodyModel.parents[chain[0]] >= 0:
        chain.insert(0, int(BodyModel.parents[chain[0]]))
    freedoms = np.flatnonzero(np.isin(BodyModel.dof_part, chain))
    freedom_part = np.searchsorted(chain, BodyModel.dof_part[freedoms]).astype(np.int32)
    return np.array(chain), np.arange(-1, len(chain) - 1, dtype=np.int32), freedoms, freedom_part


class Lump:
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

    def cover(self, points: np.ndarray, rotations: np.ndarray, translations: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Finds the voxels that placed points cover.

        Args:
            points: (n, 3) in the frame that is placed.
            rotations: (K, 3, 3), translations: (K, 3): world from that frame.

        Returns:
            bits (K, words) uint64, a set of free occupied voxels each; (K,) int64, how many points lie in empty space; (K,) int64, how
            many lie in voxels that were taken.
        """
        count = len(rotations)
        bits, empty, inside = np.empty((count, self.words), np.uint64), np.empty(count, np.int64), np.empty(count, np.int64)
        cover(self.ids, self.grid.origin_m, self.grid.voxel_size_m, points, rotations, translations, bits, empty, inside)
        return bits, empty, inside

    @property
    def free(self) -> Voxels:
        """The occupied voxels that no part has taken yet."""
        return Voxels(self.ids >= 0, self.grid.origin_m, self.grid.voxel_size_m)

    def take(self, bits: np.ndarray) -> None:
        """Gives the voxels of one set (words,) to a part: nothing placed later can claim them."""
        taken = np.flatnonzero(np.unpackbits(bits.view(np.uint8), bitorder="little")[: len(self.occupied)])
        self.ids[tuple(self.occupied[taken].T)] = TAKEN
