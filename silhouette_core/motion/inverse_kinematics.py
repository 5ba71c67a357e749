"""Poses from directions: joint angles that point parts where they should point, and bodies put onto
the floor.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.motion import kinematics
from silhouette_core.motion.kernels.kinematics import solve_angles

_REST = 1e-3  # pulls each angle to rest where the directions leave it free: a spine bends evenly


@dataclass
class Targets:
    """Directions for the parts of a body over time.

    Attributes:
        model: the body.
        parts: the part of each target.
        axes: (3,) each, unit, fixed in the part, in the body frame of the rest pose.
        wanted: (T, 3) each, unit, where that axis shall point in the world.
        weights: how much each counts; squared errors are weighed.
    """

    model: BodyModel
    parts: list[int] = field(default_factory=list)
    axes: list[NDArray[np.float64]] = field(default_factory=list)
    wanted: list[NDArray[np.float64]] = field(default_factory=list)
    weights: list[float] = field(default_factory=list)

    def add(
        self, part: str, axis: NDArray[np.float64], wanted: NDArray[np.float64], weight: float
    ) -> None:
        """Adds a direction; the axis may have any length."""
        self.parts.append(self.model.names.index(part))
        self.axes.append(np.asarray(axis, float) / np.linalg.norm(axis))
        self.wanted.append(wanted)
        self.weights.append(weight)

    def angles(self, root_rotation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solves for the joint angles, frame after frame.

        Limits hold. What one joint cannot do, its neighbours take over. Freedoms that silhouettes
        do not show stay at rest.

        Args:
            root_rotation: (T, 3, 3) world_from_body of the pelvis.

        Returns:
            (T, D) float64, radians, in the order of `BodyModel.dof_names`.
        """
        model, free = self.model, ~self.model.dof_fixed
        angles = np.zeros((len(root_rotation), int(free.sum())))
        solve_angles(
            model.parents,
            model.joints_m,
            model.dof_part[free],
            model.dof_axis[free],
            model.dof_limits_rad[free],
            np.ascontiguousarray(root_rotation),
            (np.array(self.parts), np.array(self.axes), np.array(self.weights)),
            np.ascontiguousarray(np.stack(self.wanted, axis=1)),
            _REST,
            angles,
        )
        every = np.zeros((len(angles), model.dof_count))
        every[:, free] = angles
        return every


def lowest_foot(
    model: BodyModel, root_quaternion: NDArray[np.float64], angles_rad: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Returns (T,) the height in metres of the lowest point of the feet while the pelvis is at
    height 0.

    Args:
        model: the body.
        root_quaternion: (T, 4) w x y z, world_from_body.
        angles_rad: (T, D) joint angles.
    """
    feet = [part for part, name in enumerate(model.names) if name.endswith(("_foot", "_toes"))]
    mine = np.unique(model.faces[np.isin(model.face_part, feet)])
    rotation, origin = kinematics.forward(
        model, np.zeros((len(angles_rad), 3)), root_quaternion, angles_rad
    )
    height = np.zeros((len(angles_rad), len(mine)))
    for k in range(model.skin_parts.shape[1]):
        part, weight = model.skin_parts[mine, k], model.skin_weights[mine, k]
        local = model.vertices_m[mine] - model.joints_m[part]
        height += weight * (
            np.einsum("tvi,vi->tv", rotation[:, part, 2], local) + origin[:, part, 2]
        )
    return height.min(axis=1)
