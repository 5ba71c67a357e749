"""The pose in which a recorded skeleton stands as ours does at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.motion.recorded.skeleton import RecordedMotion, place_joints

_FAVOUR_DEG = 5.0  # the zero pose and the first frame are often meant as the reference, and may be this much more crooked than another


@dataclass(frozen=True, eq=False)
class Reference:
    """A skeleton standing upright.

    Attributes:
        rotations: (J, 3, 3) world_from_joint there.
        positions: (J, 3) there.
        body: (3, 3) columns in the file's axes: toward its left, to its back, up.
        crooked_deg: how far from standing straight.
    """

    rotations: NDArray[np.float64]
    positions: NDArray[np.float64]
    body: NDArray[np.float64]
    crooked_deg: float

    def direction(self, near: int, far: int) -> NDArray[np.float64]:
        """Returns the (3,) unit vector from one joint to another, in body axes."""
        return unit(self.positions[far] - self.positions[near]) @ self.body


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Returns vectors (…, 3) at length 1."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)


def up_axis(recorded: RecordedMotion) -> NDArray[np.float64]:
    """Returns the (3,) axis of the file, with its sign, that points from the feet to the shoulders on average."""
    return _nearest_axis(_trunk(recorded, recorded.positions) + _legs(recorded, recorded.positions))


def find_reference(recorded: RecordedMotion) -> Reference:
    """Finds where the skeleton stands straightest: at zero rotations, in the first frame (many files begin with a T-pose), or in any other.

    How crooked a pose is: the largest angle of thighs, shins and trunk from the vertical, of a forearm from its upper arm, and between
    an arm and the other one's mirror image.
    """
    up = up_axis(recorded)
    zero_rotations, zero_positions = place_joints(
        recorded.parents, recorded.offsets[None], np.broadcast_to(np.eye(3), (1, len(recorded.joints), 3, 3))
    )
    zero_up = _nearest_axis(_trunk(recorded, zero_positions))
    zero_bend = _crookedness(recorded, zero_positions, zero_up)[0]
    bends = _crookedness(recorded, recorded.positions, up)
    frame = int(bends.argmin())
    if bends[0] <= bends[frame] + _FAVOUR_DEG:
        frame = 0
    if zero_bend < bends[frame]:
        return Reference(zero_rotations[0], zero_positions[0], _body_axes(recorded, zero_positions[0], zero_up), float(zero_bend))
    positions = recorded.positions[frame]
    return Reference(recorded.rotations[frame], positions, _body_axes(recorded, positions, up), float(bends[frame]))


def _between(recorded: RecordedMotion, positions: NDArray, near: str, far: str) -> NDArray:
    return unit(positions[:, recorded.roles[far]] - positions[:, recorded.roles[near]])


def _trunk(recorded: RecordedMotion, positions: NDArray) -> NDArray:
    middle = lambda joint: sum(positions[:, recorded.roles[f"{side}_{joint}"]] for side in ("left", "right")) / 2  # noqa: E731
    return unit(middle("upper_arm") - middle("thigh"))


def _legs(recorded: RecordedMotion, positions: NDArray) -> NDArray:
    return sum(_between(recorded, positions, f"{side}_foot", f"{side}_thigh") for side in ("left", "right")) / 2


def _nearest_axis(vectors: NDArray) -> NDArray[np.float64]:
    mean = vectors.mean(axis=0)
    axis = np.zeros(3)
    axis[np.abs(mean).argmax()] = np.sign(mean[np.abs(mean).argmax()])
    return axis


def _crookedness(recorded: RecordedMotion, positions: NDArray, up: NDArray) -> NDArray[np.float64]:
    across = unit(np.cross(up, np.cross(_between(recorded, positions, "right_thigh", "left_thigh"), up)))
    angles = [_angle(_trunk(recorded, positions), up)]
    arms = []
    for side in ("left", "right"):
        angles += [
            _angle(_between(recorded, positions, f"{side}_{far}", f"{side}_{near}"), up)
            for near, far in (("thigh", "shin"), ("shin", "foot"))
        ]
        arms.append(_between(recorded, positions, f"{side}_upper_arm", f"{side}_forearm"))
        angles.append(_angle(arms[-1], _between(recorded, positions, f"{side}_forearm", f"{side}_hand")))
    reflected = arms[1] - 2 * np.einsum("ti,ti->t", arms[1], across)[:, None] * across
    angles.append(_angle(arms[0], reflected))
    return np.degrees(np.max(angles, axis=0))


def _angle(a: NDArray, b: NDArray) -> NDArray[np.float64]:
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(-1))


def _body_axes(recorded: RecordedMotion, positions: NDArray, up: NDArray) -> NDArray[np.float64]:
    left = positions[recorded.roles["left_thigh"]] - positions[recorded.roles["right_thigh"]]
    left = unit(left - (left @ up) * up)
    return np.column_stack([left, np.cross(up, left), up])
