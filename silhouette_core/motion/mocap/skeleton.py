"""Recorded skeleton and the transforms of its joints, whatever the file's format."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from calib.checks import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class MocapClip:
    """Motion of a recorded skeleton, in the file's unit and axes."""

    name: str
    fps: float
    joints: tuple[str, ...]  #: names of the J joints, parents first.
    parents: IntArray  #: (J,) int64, -1 for the root.
    offsets: FloatArray  #: (J, 3) float64, each joint relative to its parent at zero rotation.
    rotations: FloatArray  #: (T, J, 3, 3) float64, world_from_joint.
    positions: FloatArray
    """(T, J, 3) float64, the joints in the world; the root's up to a constant, as files differ."""
    roles: Mapping[str, int]  #: index of the joint of each role, see `names.ROLES`.

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def skeleton(self) -> tuple:
        """Key of the skeleton: joints, and offsets to a hundredth of the file's unit."""
        return self.joints, self.offsets.round(2).tobytes()

    def posed(self, rotations: FloatArray, positions: FloatArray) -> "MocapClip":
        """The same skeleton in other poses."""
        return replace(self, rotations=rotations, positions=positions)

    def at_rate(self, fps: float) -> "MocapClip":
        """Frames nearest to those of a lower frame rate; unchanged if the rate is lower already."""
        if self.fps <= fps:
            return self
        rows = np.rint(np.arange(0, len(self) - 0.5, self.fps / fps)).astype(int)
        rows = rows[rows < len(self)]
        return replace(self.posed(self.rotations[rows], self.positions[rows]), fps=fps)


def place_joints(
    parents: IntArray, offsets: FloatArray, local: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """World transforms from local ones: (T, J, 3, 3) world_from_joint and (T, J, 3) positions.

    Args:
        parents: (J,), parents before children, -1 for a root.
        offsets: (T or 1, J, 3) each joint relative to its parent.
        local: (T, J, 3, 3) parent_from_joint.
    """
    rotations = local.copy()
    positions = np.broadcast_to(offsets, (*local.shape[:2], 3)).copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            rotations[:, joint] = rotations[:, parent] @ local[:, joint]
            positions[:, joint] = positions[:, parent] + np.einsum(
                "tij,tj->ti", rotations[:, parent], positions[:, joint]
            )
    return rotations, positions
