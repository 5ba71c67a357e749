"""Inverse kinematics: joint angles for given directions of parts, and the height of the feet."""

from dataclasses import dataclass, field

import numpy as np

from calib.checks import FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.motion import kinematics
from silhouette_core.motion.kernels.kinematics import solve_angles
from silhouette_core.tuning import RETARGETING


@dataclass
class Targets:
    """Target directions for the parts of a body over time."""

    model: BodyModel
    parts: list[int] = field(default_factory=list)  #: part of each target.
    axes: list[FloatArray] = field(default_factory=list)
    """(3,) float64 each, unit, fixed in the part, in the body frame of the rest pose."""
    directions: list[FloatArray] = field(default_factory=list)
    """(T, 3) float64 each, unit, world direction to which that axis should point."""
    weights: list[float] = field(default_factory=list)  #: weight of each target's squared error.

    def add(self, part: str, axis: FloatArray, direction: FloatArray, weight: float) -> None:
        """Adds a target; the axis may have any length."""
        self.parts.append(self.model.names.index(part))
        self.axes.append(np.asarray(axis, float) / np.linalg.norm(axis))
        self.directions.append(direction)
        self.weights.append(weight)

    def angles(self, root_rotation: FloatArray) -> FloatArray:
        r"""Joint angles (T, D) float64, rad, in the order of `KinematicTree.dof_names`, that
        minimise the weighted errors of the directions in every frame.

        .. math:: \min_q \sum_k w_k \lVert R_k(q)\, a_k - t_k \rVert^2 + \lambda \lVert q \rVert^2

        within the joint limits, by Gauss-Newton steps from the previous frame's solution. Where a
        joint is at its limit, its neighbours compensate. Fixed degrees of freedom stay at rest.

        Args:
            root_rotation: (T, 3, 3) float64, world from body, of the pelvis.

        Source: textbook Gauss-Newton with an active set of limits.
        """
        model, free = self.model, ~self.model.tree.dof_fixed
        angles = np.zeros((len(root_rotation), int(free.sum())))
        solve_angles(
            model.tree.parents,
            model.joints_m,
            model.tree.dof_part[free],
            model.tree.dof_axis[free],
            model.tree.dof_limits_rad[free],
            np.ascontiguousarray(root_rotation),
            (np.array(self.parts), np.array(self.axes), np.array(self.weights)),
            np.ascontiguousarray(np.stack(self.directions, axis=1)),
            RETARGETING.rest,
            angles,
        )
        result = np.zeros((len(angles), model.dof_count))
        result[:, free] = angles
        return result


def lowest_foot(
    model: BodyModel, root_quaternion: FloatArray, angles_rad: FloatArray
) -> FloatArray:
    """Height of the lowest point of the feet above the pelvis, (T,) float64, m; negative.

    Args:
        root_quaternion: (T, 4) float64, w, x, y, z, world from body.
        angles_rad: (T, D) float64, joint angles.
    """
    feet = [part for part, name in enumerate(model.names) if name.endswith(("_foot", "_toes"))]
    vertices = np.unique(model.faces[np.isin(model.face_part, feet)])
    pelvis = np.zeros((len(angles_rad), 3))
    placed = zip(*kinematics.forward(model, pelvis, root_quaternion, angles_rad), strict=True)
    return np.array([kinematics.skin(model, *one)[vertices, 2].min() for one in placed])
