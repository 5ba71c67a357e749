"""Pose of one frame, and the steps between poses."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.joints import HUMAN
from silhouette_core.setting_types import Coordinate, FrameNumber


@dataclass(frozen=True, eq=False)
class Pose:
    """Position, orientation and joint angles of a body."""

    root_m: np.ndarray  #: (3,) float64, world position of the root part's joint.
    root_rotation: np.ndarray  #: (3, 3) float64, world from body.
    angles_rad: np.ndarray  #: (D,) float64, in the order of `KinematicTree.dof_names`.

    def moved(self, step: np.ndarray) -> "Pose":
        """Pose after a step (6 + D,): root position (m), turn in the world and angles (rad)."""
        turn = Rotation.from_rotvec(step[3:6]).as_matrix()
        return Pose(self.root_m + step[:3], turn @ self.root_rotation, self.angles_rad + step[6:])

    def minus(self, other: "Pose") -> np.ndarray:
        """Step (6 + D,) that leads from another pose to this one; see `moved`."""
        turn = Rotation.from_matrix(self.root_rotation @ other.root_rotation.T).as_rotvec()
        return np.concatenate(
            [self.root_m - other.root_m, turn, self.angles_rad - other.angles_rad]
        )

    def clipped(self, limits_rad: np.ndarray = HUMAN.dof_limits_rad) -> "Pose":
        """Pose with every angle clipped to its limits (D, 2), by default those of a person."""
        return Pose(self.root_m, self.root_rotation, np.clip(self.angles_rad, *limits_rad.T))


@dataclass(frozen=True)
class JointTarget:
    """Where a joint is in a frame, as somebody set it by hand."""

    joint: str  #: one of `KinematicTree.landmark_names`.
    frame: FrameNumber
    place_m: tuple[Coordinate, Coordinate, Coordinate]  #: in the world.


@dataclass(frozen=True, eq=False)
class PoseArrays:
    """K poses as arrays for kernels; the attributes are those of `Pose`."""

    root_m: np.ndarray  #: (K, 3) float64.
    root_rotation: np.ndarray  #: (K, 3, 3) float64.
    angles_rad: np.ndarray  #: (K, D) float64.

    @classmethod
    def from_poses(cls, poses: Sequence[Pose]) -> "PoseArrays":
        """Copies poses, at least one."""
        return cls(
            np.array([pose.root_m for pose in poses], float),
            np.array([pose.root_rotation for pose in poses], float),
            np.array([pose.angles_rad for pose in poses], float),
        )

    def __len__(self) -> int:
        return len(self.root_m)

    @property
    def arrays(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The three arrays, as the kernels take them."""
        return self.root_m, self.root_rotation, self.angles_rad

    def first(self, count: int) -> "PoseArrays":
        """The first poses; they share memory with these."""
        return PoseArrays(*(one[:count] for one in self.arrays))

    def poses(self) -> list[Pose]:
        """The poses one by one; they share memory with these."""
        return [Pose(*one) for one in zip(*self.arrays, strict=True)]


def steps_of(poses: PoseArrays) -> np.ndarray:
    """Steps (K - 1, 6 + D) from each of K poses to the next; see `Pose.minus`."""
    turn = poses.root_rotation[1:] @ poses.root_rotation[:-1].transpose(0, 2, 1)
    return np.concatenate(
        [
            np.diff(poses.root_m, axis=0),
            Rotation.from_matrix(turn).as_rotvec(),
            np.diff(poses.angles_rad, axis=0),
        ],
        axis=1,
    )
