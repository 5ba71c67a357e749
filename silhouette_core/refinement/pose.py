"""One frame's pose, and what is believed about it before looking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel


@dataclass(frozen=True, eq=False)
class Pose:
    """Where a body is and how its joints are turned.

    Attributes:
        root_m: (3,) float64, world position of the pelvis joint.
        root_rotation: (3, 3) float64, world from body.
        angles_rad: (D,) float64, in the order of `BodyModel.dof_names`.
    """

    root_m: np.ndarray
    root_rotation: np.ndarray
    angles_rad: np.ndarray

    def moved(self, step: np.ndarray) -> Pose:
        """Returns the pose after a step (6 + D,): root position (m), root rotation vector in the
        world, joint angles (rad).
        """
        turn = Rotation.from_rotvec(step[3:6]).as_matrix()
        return Pose(self.root_m + step[:3], turn @ self.root_rotation, self.angles_rad + step[6:])

    def minus(self, other: Pose) -> np.ndarray:
        """Returns the step (6 + D,) that leads from `other` to this pose."""
        turn = Rotation.from_matrix(self.root_rotation @ other.root_rotation.T).as_rotvec()
        return np.concatenate(
            [self.root_m - other.root_m, turn, self.angles_rad - other.angles_rad]
        )

    def clipped(self) -> Pose:
        """Returns the pose with every angle inside its limits."""
        return Pose(
            self.root_m, self.root_rotation, np.clip(self.angles_rad, *BodyModel.dof_limits_rad.T)
        )


# How far joints are usually from the resting stance, degrees (standard deviation), and where the
# resting stance hangs the arms.
_USUAL_DEG = {
    "lumbar": 15,
    "thorax": 12,
    "neck": 20,
    "clavicle": 10,
    "upper_arm": 60,
    "upper_arm.twist": 35,
    "forearm": 60,
    "hand": 15,
    "thigh": 50,
    "thigh.abduction": 25,
    "thigh.rotation": 20,
    "shin": 60,
    "foot": 15,
}
# How far a joint turns from one frame to the next beyond what was predicted, degrees at 30 frames a
# second.
_STEP_SIGMA_DEG = {
    "lumbar": 3,
    "thorax": 3,
    "neck": 6,
    "clavicle": 4,
    "upper_arm": 14,
    "forearm": 16,
    "hand": 12,
    "thigh": 9,
    "shin": 12,
    "foot": 12,
}
_RELAXED_DEG = {
    "upper_arm.abduction": -30.0,
    "forearm.flexion": 20.0,
    "shin.flexion": 8.0,
    "thigh.flexion": 4.0,
}


def _by_dof(table: Mapping[str, float], default: float) -> np.ndarray:
    values = []
    for name in BodyModel.dof_names:
        base = name.removeprefix("left_").removeprefix("right_")
        values.append(table.get(base, table.get(base.partition(".")[0], default)))
    return np.radians(values)


USUAL_RAD = _by_dof(_USUAL_DEG, 10.0)
STEP_SIGMA_RAD = _by_dof(_STEP_SIGMA_DEG, 3.0)
RELAXED_RAD = _by_dof(_RELAXED_DEG, 0.0)
ROOT_STEP_SIGMA = np.array([0.05, 0.05, 0.05, 0.12, 0.12, 0.12])
