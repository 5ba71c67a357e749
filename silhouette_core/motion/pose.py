"""Pose of one frame, and the steps between poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel


@dataclass(frozen=True, eq=False)
class Pose:
    """Position, orientation and joint angles of a body.

    Attributes:
        root_m: (3,) float64, world position of the pelvis joint.
        root_rotation: (3, 3) float64, world from body.
        angles_rad: (D,) float64, in the order of `BodyModel.dof_names`.
    """

    root_m: np.ndarray
    root_rotation: np.ndarray
    angles_rad: np.ndarray

    def moved(self, step: np.ndarray) -> Pose:
        """Pose after a step (6 + D,): root position (m), root rotation vector in the world (rad),
        joint angles (rad).
        """
        turn = Rotation.from_rotvec(step[3:6]).as_matrix()
        return Pose(self.root_m + step[:3], turn @ self.root_rotation, self.angles_rad + step[6:])

    def minus(self, other: Pose) -> np.ndarray:
        """Step (6 + D,) that leads from another pose to this one; see `moved`."""
        turn = Rotation.from_matrix(self.root_rotation @ other.root_rotation.T).as_rotvec()
        return np.concatenate(
            [self.root_m - other.root_m, turn, self.angles_rad - other.angles_rad]
        )

    def clipped(self) -> Pose:
        """Pose with every angle clipped to its limits."""
        return Pose(
            self.root_m, self.root_rotation, np.clip(self.angles_rad, *BodyModel.dof_limits_rad.T)
        )
