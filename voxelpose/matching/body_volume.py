"""The body as lumps of points, limb by limb, to be placed in great numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kernels.kinematics import place_one_part
from silhouette_core.refinement.pose import Pose
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CpuBackend
from voxelpose.matching.limbs import LIMBS, Limb


@dataclass(frozen=True, eq=False)
class BodyVolume:
    """A body filled with points, about one per voxel.

    Attributes: model: the body. points: limb name -> (n, 3) float64, positions at rest relative to
        the joint of the limb's first part. part_points: 27 arrays (n_p, 3), the same points by
        part, relative to each part's own joint. backend: what scores many placements at once.
    """

    model: BodyModel
    points: dict[str, np.ndarray]
    part_points: list[np.ndarray]
    backend: Backend

    @classmethod
    def of(cls, model: BodyModel, spacing_m: float, backend: Backend | None = None) -> BodyVolume:
        """Fills a body, one point every `spacing_m` along each axis; by default all cores score it."""
        parts = model.part_points(spacing_m)
        points = {}
        for limb in LIMBS:
            held = [model.names.index(name) for name in limb.parts]
            points[limb.name] = (
                np.concatenate([parts[p] + model.joints_m[p] for p in held])
                - model.joints_m[limb.part]
            )
        return cls(model, points, parts, backend or CpuBackend())

    def placements(
        self, limb: Limb, root: Pose, angles_rad: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Places a limb for each of K choices of angles.

        Args:
            limb: which.
            root: gives root position and rotation.
            angles_rad: (K, D).

        Returns:
            rotations (K, 3, 3) and translations (K, 3), world from the limb's first part.
        """
        model = self.model
        chain, parents, dofs, dof_parts = _chain(limb.part)
        rotations, origins = np.empty((len(angles_rad), 3, 3)), np.empty((len(angles_rad), 3))
        place_one_part(
            parents,
            model.joints_m[chain],
            dof_parts,
            model.dof_axis[dofs],
            root.root_rotation,
            root.root_m,
            np.ascontiguousarray(angles_rad[:, dofs]),
            len(chain) - 1,
            rotations,
            origins,
        )
        return rotations, origins


@cache
def _chain(part: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Returns the parts from the root to one part, their parents within that chain, the angles that
    turn them, and the part of each.
    """
    chain = [part]
    while BodyModel.parents[chain[0]] >= 0:
        chain.insert(0, int(BodyModel.parents[chain[0]]))
    dofs = np.flatnonzero(np.isin(BodyModel.dof_part, chain))
    dof_parts = np.searchsorted(chain, BodyModel.dof_part[dofs]).astype(np.int32)
    return np.array(chain), np.arange(-1, len(chain) - 1, dtype=np.int32), dofs, dof_parts
