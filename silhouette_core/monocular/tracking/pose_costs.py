"""Costs, in nats, of poses and steps that are rare whatever the silhouette says. Beyond paper A."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.monocular.tracking.motion_cost import yaw_rotations
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.motion.heading import split_heading
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.surface import Surface

_NOVELTY_M, _FAR = 0.06, 4.0
_NEAR_FLOOR_M, _SUNK_M, _HOVERING_M = 0.20, 0.03, 0.06
_FLOOR_FRAMES = 90
_VELOCITY_WINDOW_S, _WALKING_M_S = 0.7, 0.4
_BACKWARD = 1.0  # nats a frame against walking sideways, half of those against walking backward
_FACING = 10.0  # nats against standing in profile in the first frame
_SLIP_M = 0.02
_ANKLES = [LANDMARK_NAMES.index(name) for name in ("left_ankle", "right_ankle")]


class PoseCosts:
    """Costs of K pose hypotheses of a frame.

    Args:
        library: recorded poses.
    """

    def __init__(self, library: PoseLibrary):
        """Places the joints of the recorded poses."""
        recorded = forward(
            library.model,
            np.zeros((len(library.base_angles), 3)),
            library.base_quaternion.astype(float),
            library.base_angles.astype(float),
        )
        joints = landmarks(library.model, *recorded)
        self._recorded, self._person = joints - joints[:, :1], library.model.person is not None
        self._lowest: deque[float] = deque(maxlen=_FLOOR_FRAMES)
        self._positions: list[tuple[float, NDArray[np.float64]]] = []

    def add_position(self, time_s: float, root_m: NDArray[np.float64]) -> None:
        """Adds the estimated position (3,) of the person in a frame, from which the direction of
        walking is computed.
        """
        self._positions.append((time_s, root_m[:2]))

    def novelty(self, poses: list[Pose], joints: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cost (K,) of the distance to the nearest recorded pose, whatever the heading.

        Depths that no recording shows are unlikely, though the silhouette allows them. A mean
        distance of the joints (K, L, 3) of 6 cm costs half a nat. Of bodies that are no person's,
        recorded poses are too few for that.
        """
        if not self._person:
            return np.zeros(len(poses))
        headings = [_heading_rotation(pose.root_rotation) for pose in poses]
        in_body = np.stack(
            [(own - own[0]) @ heading for own, heading in zip(joints, headings, strict=True)]
        )
        nearest = np.array(
            [np.linalg.norm(self._recorded - own, axis=-1).mean(1).min() for own in in_body]
        )
        off = nearest / _NOVELTY_M
        # Far away, the cost is linear (Huber).
        return np.where(off < _FAR, 0.5 * off**2, _FAR * (off - 0.5 * _FAR))

    def off_floor(self, poses: list[Pose], surface: Surface) -> NDArray[np.float64]:
        """Cost (K,) of hovering above the floor or sinking into it, as a leg at a wrong depth does.

        The world's z = 0 counts as the floor as long as the person has mostly stood near it.

        Args:
            poses: K poses, the first hypotheses of this frame.
            surface: the body's surface.
        """
        points = surface.posed_many(PoseArrays.from_poses(poses)).points
        lowest = points[..., 2].min(axis=1)
        self._lowest.append(float(np.median(lowest)))
        if not self.on_floor:
            return np.zeros(len(poses))
        off = np.where(lowest < 0, -lowest / _SUNK_M, lowest / _HOVERING_M)
        return 0.5 * np.minimum(off, 3.0) ** 2

    @property
    def on_floor(self) -> bool:
        """Whether the person of the latest frames stands on z = 0."""
        return bool(self._lowest) and float(np.median(np.abs(self._lowest))) < _NEAR_FLOOR_M

    def walking_backward(self, poses: list[Pose], time_s: float) -> NDArray[np.float64]:
        """Cost (K,) of facing away from the direction in which the person has been walking.

        The silhouettes from the front and from behind are nearly the same; the direction of walking
        tells them apart.
        """
        self._positions = [
            (t, position) for t, position in self._positions if 0 < time_s - t <= _VELOCITY_WINDOW_S
        ]
        if (
            not self._person
            or len(self._positions) < 3
            or self._positions[-1][0] - self._positions[0][0] < 0.5 * _VELOCITY_WINDOW_S
        ):
            return np.zeros(len(poses))
        times, positions = (np.array(column) for column in zip(*self._positions, strict=True))
        velocity = np.polyfit(times - times.mean(), positions, 1)[0]
        speed = float(np.linalg.norm(velocity))
        if speed < _WALKING_M_S:
            return np.zeros(len(poses))
        facing = np.array([-pose.root_rotation[:2, 1] for pose in poses])
        return _BACKWARD * (1 - facing @ (velocity / speed))

    def slip(
        self, before: NDArray[np.float64], after: NDArray[np.float64], steps: float
    ) -> NDArray[np.float64]:
        """Cost (K, K') of moving both feet at once: somebody who walks stands on one of them.

        Args:
            before: (K, 15, 3) float64, joints in the previous frame, m.
            after: (K', 15, 3) float64, joints in this frame, m.
            steps: time between the frames in units of 1 / `dynamics.FPS`.
        """
        if not self._person:
            return np.zeros((len(before), len(after)))
        moved = np.linalg.norm(before[:, None, _ANKLES] - after[None, :, _ANKLES], axis=-1).min(-1)
        return 0.5 * np.minimum(moved / (_SLIP_M * steps), 2.0) ** 2

    def facing_away(
        self, poses: list[Pose], toward_camera: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Cost (K,) of not facing the camera, whose direction is `toward_camera` (3,)."""
        facing = np.array([-pose.root_rotation[:, 1] @ toward_camera for pose in poses])
        return _FACING * (1 - facing)


def _heading_rotation(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turn (3, 3) about the vertical contained in an orientation, see `split_heading`."""
    heading, _ = split_heading(quaternions(rotation[None]))
    return yaw_rotations(heading)[0]
