"""Recorded skeleton and the transforms of its joints, whatever the file's format."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class MocapClip:
    """Motion of a recorded skeleton, in the file's unit and axes.

    Attributes:
        joints: names of the J joints, parents first.
        parents: (J,) int64, -1 for the root.
        offsets: (J, 3) float64, each joint relative to its parent at zero rotation.
        rotations: (T, J, 3, 3) float64, world_from_joint.
        positions: (T, J, 3) float64, the joints in the world; the root's up to a constant, which
            files define differently.
        roles: index of the joint of each role, see `names.ROLES`.
    """

    name: str
    fps: float
    joints: tuple[str, ...]
    parents: NDArray[np.int64]
    offsets: NDArray[np.float64]
    rotations: NDArray[np.float64]
    positions: NDArray[np.float64]
    roles: Mapping[str, int]

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.positions)

    @property
    def skeleton(self) -> tuple:
        """Key of the skeleton: joints, and offsets to a hundredth of the file's unit."""
        return self.joints, self.offsets.round(2).tobytes()

    def posed(self, rotations: NDArray[np.float64], positions: NDArray[np.float64]) -> MocapClip:
        """The same skeleton in other poses."""
        return replace(self, rotations=rotations, positions=positions)

    def at_rate(self, fps: float) -> MocapClip:
        """Frames nearest to those of a lower frame rate; unchanged if the rate is lower already."""
        if self.fps <= fps:
            return self
        rows = np.rint(np.arange(0, len(self) - 0.5, self.fps / fps)).astype(int)
        rows = rows[rows < len(self)]
        return replace(self.posed(self.rotations[rows], self.positions[rows]), fps=fps)


def place_joints(
    parents: NDArray[np.int64], offsets: NDArray[np.float64], local: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
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
