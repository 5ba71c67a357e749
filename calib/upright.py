"""Which way is up: the frame in which z points up and the floor is at z = 0.

A calibration's world may have any axes: z into the floor (OpenCV's board), y up, or the axes of the
first camera. Estimation works in the upright frame, and results return to the world.

Pictures tell up without knowing the world: a camera that stands level has the direction of up in
the plane of its image's vertical and its optical axis, at right angles to its image's horizontal.
Cameras that lie on their side, as telephones do, have it the other way round.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.camera import Rig
from calib.checks import FloatArray, float_array
from calib.errors import InputError
from calib.tuning import UPRIGHT

Z_UP = np.eye(3)[2]

AXES = {
    sign + name: direction * axis
    for sign, direction in (("", 1), ("-", -1))
    for name, axis in zip("xyz", np.eye(3), strict=True)
}
"""Directions of the world by name: x, y, z, -x, -y and -z."""
_MOST = 4  # candidates
_POSSIBLE = UPRIGHT.ambiguous * UPRIGHT.on_its_side  # worth where all lie on their sides and lean


@dataclass(frozen=True, eq=False)
class UprightFrame:
    """The frame with z up and the floor at z = 0, beside the calibration's world."""

    rotation: FloatArray  #: (3, 3) float64, upright from world.
    floor_m: float = 0.0  #: height of the floor in the world, along up, metres.

    @classmethod
    def from_up(cls, up: ArrayLike, floor_m: float = 0.0) -> "UprightFrame":
        """The frame that is turned least.

        Args:
            up: (3,) direction of up in the world, not zero.
            floor_m: height of the floor along up, metres.
        """
        x, y, z = unit_vector(up)
        if z < -1 + 1e-12:
            return cls(np.diag([1.0, -1.0, -1.0]), floor_m)
        # Rodrigues' formula for the turn from up to z about their common perpendicular.
        cross = np.array([[0.0, 0.0, -x], [0.0, 0.0, -y], [x, y, 0.0]])
        return cls(np.eye(3) + cross + cross @ cross / (1 + z), floor_m)

    @property
    def up(self) -> FloatArray:
        """(3,) float64, unit: direction of up in the world."""
        return self.rotation[2]

    @property
    def is_world(self) -> bool:
        """Whether the world itself is upright, with its floor at 0."""
        return self.floor_m == 0 and bool(np.array_equal(self.rotation, np.eye(3)))

    @property
    def _offset_m(self) -> FloatArray:
        return np.array([0.0, 0.0, -self.floor_m])

    def points(self, points_world: ArrayLike) -> FloatArray:
        """Points (..., 3) of the world in this frame, metres."""
        return np.asarray(points_world, float) @ self.rotation.T + self._offset_m

    def world_points(self, points: ArrayLike) -> FloatArray:
        """Points (..., 3) of this frame in the world, metres."""
        return (np.asarray(points, float) - self._offset_m) @ self.rotation

    def rig(self, rig: Rig) -> Rig:
        """The cameras of a rig, calibrated in this frame."""
        if self.is_world:
            return rig
        return Rig(tuple(camera.in_world(self.rotation, self._offset_m) for camera in rig))


def unit_vector(direction: ArrayLike) -> FloatArray:
    """A direction (3,) at unit length. ValueError where it has no length, or is not finite."""
    vector = float_array("direction", direction, (3,), finite=True)
    if np.abs(vector).max() > 1e150:
        raise ValueError("direction must have a length whose square is a float64")
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        raise ValueError("direction must not be zero")
    return vector / length


def direction_of(text: str, setting: str = 'up = "{}"', where: str = "") -> FloatArray:
    """Direction (3,), unit, of an axis' name (`-z`) or of three numbers (`0,0.1,-1`). InputError
    where the text is neither.

    Args:
        setting: how it is given, with {} in its place, for messages.
        where: what stands before that in messages.
    """
    name = text.strip().lower().removeprefix("+")
    if name in AXES:
        return AXES[name]
    try:
        return unit_vector([float(number) for number in name.split(",")])
    except ValueError:
        raise InputError(
            f"{where}{setting.format(text[:40])} is no direction: give an axis, as in"
            f" {setting.format('-z')}, or three numbers, as in {setting.format('0,0.1,-1')}"
        ) from None


def axis_name(up: ArrayLike) -> str:
    """Name of an axis of the world, or three numbers."""
    vector = np.asarray(up, float)
    for name, axis in AXES.items():
        if np.allclose(vector, axis, atol=1e-6):
            return name
    return ",".join(f"{value + 0.0:.3f}" for value in vector)


def cameras_worth(rig: Rig, up: ArrayLike) -> float:
    """How well a direction explains how the cameras stand, from 0 to 1.

    Args:
        up: (3,) direction of up in the world.

    Returns:
        The mean over the cameras: 1 for one that stands upright, less for one that lies on its side
        or hangs upside down, and less the more it leans; 0 for one half way between these, or that
        looks straight up or down.
    """
    across, _ = _stances(rig, unit_vector(up))
    return float(across.max(axis=1).mean())


def up_candidates(rig: Rig) -> list[FloatArray]:
    """Directions of up in the world that explain how the cameras stand, the best first.

    Tried are the axes of the world, the cameras' verticals, and the directions at right angles to
    the horizontals of any two images, each of which may lie on its side. Each is fitted to the
    cameras that it explains in the least-squares sense, or is an axis of the world near that.

    Returns:
        Unit vectors (3,) float64, 20 degrees or more apart; they explain at least 0.85 of what the
        first one explains. Of equals the first is z, where it is among them.
    """
    ranked = sorted(_directions(rig), key=lambda up: -cameras_worth(rig, up))
    least = UPRIGHT.ambiguous * cameras_worth(rig, ranked[0])
    candidates: list[FloatArray] = []
    for direction in ranked:
        if cameras_worth(rig, direction) < least or len(candidates) == _MOST:
            break
        up = _axis_near(rig, _refined_up(rig, direction))
        if all(not _is_same_direction(up, other) for other in candidates):
            candidates.append(up)
    return candidates


def up_from_cameras(rig: Rig) -> FloatArray:
    """Direction of up (3,) in the world by the cameras alone.

    It is z where the cameras may stand so: upright, or all on their side, or looking straight down.
    Else it is the first of `up_candidates`.
    """
    down = all(
        abs(camera.rotation[2] @ Z_UP) > np.cos(np.radians(UPRIGHT.same_deg)) for camera in rig
    )
    if not is_cameras_own(rig) and (down or cameras_worth(rig, Z_UP) >= _POSSIBLE):
        return Z_UP
    return up_candidates(rig)[0]


def other_up(rig: Rig) -> FloatArray | None:
    """What is up (3,) for the cameras, where that is more than 20 degrees from z and explains them
    far better; else None.
    """
    best = up_candidates(rig)[0]
    if _is_same_direction(best, Z_UP):
        return None
    explained = cameras_worth(rig, Z_UP) >= UPRIGHT.ambiguous * cameras_worth(rig, best)
    return None if explained else best


def is_cameras_own(rig: Rig) -> bool:
    """Whether the world is the frame of one of the cameras, so that its axes mean nothing."""
    return any(np.allclose(camera.rotation, np.eye(3), atol=1e-6) for camera in rig)


def _stances(rig: Rig, up: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Worth (C, 4) of each camera in the four stances, and the images' horizontals (C, 4, 3) if
    they stand so.
    """
    right = np.array([camera.rotation[0] for camera in rig])
    above = np.array([-camera.rotation[1] for camera in rig])
    x, y = right @ up, above @ up
    # A camera that looks along up does not tell: its image has no vertical.
    certainty = np.hypot(x, y)
    lean = np.arctan2(x, y)[:, None] - np.arange(4) * (np.pi / 2)
    lean = np.abs((lean + np.pi) % (2 * np.pi) - np.pi)
    across = np.stack([right, -above, -right, above], axis=1)
    upright = np.cos(2 * np.minimum(lean, np.pi / 4))  # 0 where the next stance begins
    # Of a camera that stands upright, lies on its side, hangs upside down, lies on the other one.
    worth = np.array([1.0, UPRIGHT.on_its_side, UPRIGHT.upside_down, UPRIGHT.on_its_side])
    return upright * worth * np.minimum(certainty[:, None] / 0.3, 1.0), across


def _is_same_direction(first: FloatArray, second: FloatArray) -> bool:
    return bool(np.arccos(np.clip(first @ second, -1, 1)) <= np.radians(UPRIGHT.same_deg))


def _axis_near(rig: Rig, up: FloatArray) -> FloatArray:
    """The axis of the world near a direction, if the cameras may stand so; else the direction."""
    axis = max(AXES.values(), key=lambda axis: float(axis @ up))
    if is_cameras_own(rig):
        return up
    share = cameras_worth(rig, axis) / max(cameras_worth(rig, up), 1e-9)
    near = _is_same_direction(axis, up) and share >= UPRIGHT.ambiguous
    return axis if near or share >= UPRIGHT.equal else up


def _directions(rig: Rig) -> Iterable[FloatArray]:
    """Directions that may be up: few, the more usual first."""
    yield from (AXES[name] for name in ("z", "-z", "y", "-y", "x", "-x"))
    right = np.array([camera.rotation[0] for camera in rig])
    above = np.array([-camera.rotation[1] for camera in rig])
    mean = above.mean(axis=0)
    yield from (
        unit_vector(vertical) for vertical in (mean, *above) if np.linalg.norm(vertical) > 0.1
    )
    for first, second in combinations(range(len(rig)), 2):
        for a, b in product((right[first], above[first]), (right[second], above[second])):
            across = np.cross(a, b)
            if np.linalg.norm(across) > 0.1:
                yield unit_vector(across)
                yield -unit_vector(across)


def _refined_up(rig: Rig, up: FloatArray) -> FloatArray:
    """The direction near `up` at right angles to the horizontals of the cameras it explains."""
    worth, across = _stances(rig, up)
    stance = worth.argmax(axis=1)
    explained = np.flatnonzero(worth.max(axis=1) > 0)
    if not len(explained):
        return up
    horizontal = across[explained, stance[explained]]
    forward = np.array([camera.rotation[2] for camera in rig])[explained]
    vertical = np.cross(horizontal, forward).mean(axis=0)  # of the images as they stand
    scatter: NDArray[np.float64] = horizontal.T @ horizontal / len(horizontal)
    scatter -= UPRIGHT.pull * np.outer(vertical, vertical)
    direction = np.linalg.eigh(scatter)[1][:, 0]
    return direction if direction @ up > 0 else -direction
