"""A body filled with points, limb by limb, to be placed many times."""

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.kernels.kinematics import place_one_part
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.backend import Backend, load_backend
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.matching.limbs import Limb, chains_of, limbs_of

FREE_FROM_BODY, TAKEN = -1, -2
_FEW = 40  # points by which a limb is searched on the silhouettes


class VoxelSet:
    """The occupied voxels (nx, ny, nz) of one hull, numbered, so that sets of them are bits."""

    def __init__(self, grid: VoxelGrid, occupancy: np.ndarray, backend: Backend):
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
        """Free voxels that placed points cover, see `Backend.voxel_cover`."""
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


@dataclass(frozen=True, eq=False)
class BodyVolume:
    """A body filled with points, about one per voxel."""

    model: BodyModel
    points: dict[str, np.ndarray]
    """Limb name -> (n, 3) float64, m, positions at rest relative to the joint of the limb's first
    part."""
    part_points: list[np.ndarray]
    """P arrays (n_p, 3), the same points by part, relative to each part's own joint."""
    backend_name: str
    """What scores its placements, by the name that goes with it to other processes."""
    limbs: tuple[Limb, ...]  #: What is placed, the root limb first.

    @classmethod
    def from_model(cls, model: BodyModel, spacing_m: float, backend_name: str) -> "BodyVolume":
        """Fills a body, one point every `spacing_m` along each axis."""
        parts = model.part_points(spacing_m)
        points, limbs = {}, limbs_of(model, parts, spacing_m)
        for limb in limbs:
            parts_of_limb = [model.names.index(name) for name in limb.parts]
            at_rest = np.concatenate([parts[p] + model.joints_m[p] for p in parts_of_limb])
            points[limb.name] = at_rest - model.joints_m[parts_of_limb[0]]
        return cls(model, points, parts, backend_name, limbs)

    @property
    def backend(self) -> Backend:
        """What scores its placements, as loaded in this process."""
        return load_backend(self.backend_name)

    @cached_property
    def few_points(self) -> dict[str, tuple[np.ndarray, float]]:
        """About 40 points of each limb, and how many each stands for."""
        steps = {name: max(len(points) // _FEW, 1) for name, points in self.points.items()}
        return {name: (self.points[name][::step], float(step)) for name, step in steps.items()}

    @property
    def root_limb(self) -> Limb:
        """The limb at the root of the tree."""
        return self.limbs[0]

    @property
    def is_person(self) -> bool:
        """Whether the body has all limbs of a person."""
        return is_person_tree(self.model.tree)

    @cached_property
    def chains(self) -> tuple[tuple[Limb, ...], ...]:
        """Limbs that are searched together, from the upper to the lower one."""
        return chains_of(self.limbs)

    def placements(
        self, limb: Limb, root: Pose, angles_rad: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Placements of a limb for K choices of angles.

        Args:
            root: Gives root position and rotation.
            angles_rad: (K, D).

        Returns:
            Rotations (K, 3, 3) and translations (K, 3) m, world from the limb's first part.
        """
        model = self.model
        chain, parents, dofs, dof_parts = _chain(model.tree, model.names.index(limb.name))
        rotations, origins = np.empty((len(angles_rad), 3, 3)), np.empty((len(angles_rad), 3))
        place_one_part(
            parents,
            model.joints_m[chain],
            dof_parts,
            model.tree.dof_axis[dofs],
            root.root_rotation,
            root.root_m,
            np.ascontiguousarray(angles_rad[:, dofs]),
            len(chain) - 1,
            rotations,
            origins,
        )
        return rotations, origins


@lru_cache(maxsize=512)
def _chain(tree: KinematicTree, part: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Parts from the root to one part, their parents therein, their angles, and whose each is."""
    chain = [part]
    while tree.parents[chain[0]] >= 0:
        chain.insert(0, int(tree.parents[chain[0]]))
    dofs = np.flatnonzero(np.isin(tree.dof_part, chain))
    dof_parts = np.searchsorted(chain, tree.dof_part[dofs]).astype(np.int32)
    return np.array(chain), np.arange(-1, len(chain) - 1, dtype=np.int32), dofs, dof_parts
