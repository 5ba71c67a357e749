"""Performances of the demo's actor, as tables of key poses.

Metres, seconds and degrees. Hip, knee, arm, elbow and lean: flexion forward (knee: backward); out:
abduction; across: of a raised arm toward the other side; turn: about the arm's axis, inward below
0; tip: the pelvis forward. A column that a table leaves out keeps its value of `_STANDING`, or 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator, make_interp_spline
from scipy.spatial.transform import Rotation

_ALL_CAMERAS = ("cam_1", "cam_2", "cam_3", "cam_4")
_STANDING = {
    "l_out": 8.0,
    "r_out": 8.0,
    "l_elbow": 14.0,
    "r_elbow": 14.0,
    "l_knee": 4.0,
    "r_knee": 4.0,
    "l_hip": 2.0,
    "r_hip": 2.0,
    "straddle": 4.0,
}

_THREE_SECONDS = np.array(
    [
        #  t      x      y    yaw lean twist look  lh  lk  rh  rk  st   la  lo  le   ra   ro  re  rt
        (0.00, 0.25, 0.30, -30, 4, 6, 0, 28, 10, -18, 12, 2, -24, 8, 18, 26, 8, 22, 0),
        (0.25, 0.20, 0.18, -25, 4, 0, 5, 4, 6, 30, 58, 2, 0, 8, 15, 2, 8, 15, 0),
        (0.50, 0.14, 0.04, -15, 4, -6, 5, -18, 12, 28, 10, 2, 26, 8, 22, -24, 8, 18, 0),
        (0.75, 0.08, -0.08, 0, 4, 0, 0, 30, 58, 4, 6, 2, 2, 8, 15, 0, 8, 15, 0),
        (1.00, 0.03, -0.16, 20, 3, 4, 0, 16, 8, -10, 8, 3, -12, 9, 15, 14, 9, 20, 0),
        (1.25, 0.00, -0.18, 30, 1, 0, -10, 3, 4, 3, 4, 5, 0, 10, 12, 10, 45, 40, -40),
        (1.50, 0.00, -0.18, 30, 0, -4, -15, 2, 3, 3, 4, 6, 2, 10, 12, 5, 95, 70, -88),
        (1.65, 0.00, -0.18, 30, 0, -4, -15, 2, 3, 3, 4, 6, 2, 10, 12, 5, 100, 40, -88),
        (1.80, 0.00, -0.18, 30, 0, -4, -15, 2, 3, 3, 4, 6, 2, 10, 12, 5, 95, 85, -88),
        (1.95, 0.00, -0.18, 28, 0, -2, -10, 3, 4, 3, 4, 7, 8, 10, 12, 5, 92, 45, -80),
        (2.20, 0.00, -0.17, 15, 12, 0, 0, 25, 30, 25, 30, 8, 45, 14, 15, 45, 30, 20, 0),
        (2.55, 0.00, -0.12, 5, 28, 0, 0, 82, 95, 82, 95, 12, 84, 12, 10, 84, 12, 10, 0),
        (2.75, 0.00, -0.12, 0, 30, 0, 0, 86, 99, 86, 99, 12, 88, 10, 10, 88, 10, 10, 0),
        (3.00, 0.00, -0.14, -5, 18, 0, 0, 45, 52, 45, 52, 10, 55, 12, 12, 55, 12, 12, 0),
    ]
)
# Goes on to where the three seconds began, so that they can be repeated without a jump.
_AND_BACK = np.array(
    [
        (3.40, 0.00, -0.15, 10, 4, 6, 5, 8, 12, 6, 10, 6, 12, 12, 20, 10, 12, 20, 0),
        (3.65, 0.00, -0.13, 50, 3, 8, 10, 24, 40, -4, 8, 5, -6, 10, 18, 8, 10, 18, 0),
        (3.95, 0.03, -0.08, 105, 3, 6, 5, 10, 8, 12, 30, 4, 4, 9, 18, -4, 9, 18, 0),
        (4.20, 0.09, 0.02, 140, 4, -4, 0, -14, 10, 28, 12, 3, 24, 8, 20, -20, 8, 18, 0),
        (4.45, 0.15, 0.13, 155, 4, 0, 0, 28, 56, 4, 6, 3, 2, 8, 16, 0, 8, 16, 0),
        (4.70, 0.21, 0.23, 165, 4, 5, 0, 24, 10, -14, 10, 3, -18, 8, 16, 20, 8, 20, 0),
        (4.95, 0.25, 0.29, 190, 3, 4, 5, 4, 6, 20, 44, 4, 0, 9, 15, 2, 9, 15, 0),
        (5.30, 0.27, 0.33, 245, 3, 8, 10, 14, 30, 2, 6, 5, 2, 10, 18, 6, 10, 18, 0),
        (5.65, 0.27, 0.33, 300, 3, 6, 5, 6, 8, 16, 36, 4, 6, 9, 18, 2, 9, 18, 0),
        (6.00, 0.25, 0.30, 330, 4, 6, 0, 28, 10, -18, 12, 2, -24, 8, 18, 26, 8, 22, 0),
    ]
)
# In profile to cam_3, the right side toward it; the arm swings back and forth at constant speed.
_ARM_SWING = np.array(
    [
        # t    yaw   ra
        (0.0, 130, -52),
        (0.8, 130, 74),
        (1.6, 130, -52),
    ]
)
# Facing cam_2: address, back, down, through.
_GOLF = np.array(
    [
        # t   yaw  tip lean twist look  lh  lk  rh  rk  st   la  lc  lo  le  lt   ra  rc  ro  re  rt
        (0.00, -15, 24, 14, 0, 0, 36, 24, 36, 24, 11, 50, 20, 0, 10, 0, 50, 20, 0, 12, 0),
        (0.50, -15, 24, 14, 0, 0, 36, 24, 36, 24, 11, 50, 20, 0, 10, 0, 50, 20, 0, 12, 0),
        (1.10, -25, 22, 12, -30, 35, 34, 28, 34, 20, 11, 78, 42, 0, 14, 0, 62, 0, 14, 52, 0),
        (1.60, -40, 18, 8, -40, 62, 30, 32, 30, 18, 11, 104, 50, 0, 22, 0, 70, 0, 48, 96, 38),
        (1.75, -38, 18, 9, -38, 58, 31, 32, 31, 20, 11, 100, 50, 0, 22, 0, 68, 0, 44, 94, 34),
        (1.95, -20, 23, 13, -16, 26, 35, 28, 35, 24, 11, 66, 36, 0, 12, 0, 54, 6, 8, 42, 0),
        (2.08, -5, 24, 13, 2, 10, 35, 18, 35, 26, 11, 50, 18, 0, 8, 0, 52, 22, 0, 8, 0),
        (2.22, 15, 18, 9, 22, -12, 26, 10, 28, 32, 10, 58, 0, 16, 24, 0, 78, 40, 0, 10, 0),
        (2.60, 50, 2, -4, 38, 0, 8, 5, 12, 34, 9, 92, 0, 44, 90, 40, 112, 46, 0, 44, 0),
        (3.40, 54, 0, -4, 40, 2, 6, 5, 12, 34, 9, 92, 0, 44, 94, 40, 110, 46, 0, 48, 0),
        (4.00, 20, 4, 2, 14, 0, 8, 8, 10, 18, 9, 40, 4, 18, 50, 8, 48, 16, 6, 30, 0),
        (4.40, -15, 24, 14, 0, 0, 36, 24, 36, 24, 11, 50, 20, 0, 10, 0, 50, 20, 0, 12, 0),
    ]
)
# Facing cam_2: the right hand points forward, to the side, up, across and down.
_POINTING = np.array(
    [
        #  t   yaw lean twist look   ra  rc  ro  re
        (0.00, -15, 1, 0, 0, 2, 0, 8, 14),
        (0.60, -15, 2, -4, 0, 84, 0, 4, 8),
        (1.20, -15, 2, -4, 0, 86, 0, 4, 6),
        (1.90, -15, 0, -10, -40, 82, -50, 8, 6),
        (2.60, -15, 0, -12, -60, 80, -84, 8, 8),
        (3.30, -12, 0, 8, 10, 128, -14, 6, 10),
        (4.10, -10, 4, 16, 38, 78, 38, 0, 16),
        (4.80, -15, 10, 2, 10, 46, 6, 2, 8),
        (5.40, -15, 2, 0, 0, 4, 0, 8, 16),
        (6.00, -15, 1, 0, 0, 2, 0, 8, 14),
    ]
)


# Angles of one leg over a stride from heel strike on, in eighths, and the radius of the circle.
_GAIT_HIP = np.array([30, 25, 8, -3, -10, 0, 22, 32])
_GAIT_KNEE = np.array([5, 18, 14, 8, 10, 46, 58, 26])
_STRIDES, _STRIDE_S, _CIRCLE_M = 3, 1.1, 0.55


def _walk() -> NDArray[np.float64]:
    """Key poses of a walk counterclockwise on a circle, (K, 11)."""
    phase = np.arange(8 * _STRIDES + 1)
    left, right = phase % 8, (phase + 4) % 8
    angle = 2 * np.pi * phase / phase[-1]
    return np.column_stack(
        [
            phase * _STRIDE_S / 8,
            _CIRCLE_M * np.cos(angle),
            _CIRCLE_M * np.sin(angle),
            180 + np.degrees(angle),
            _GAIT_HIP[left],
            _GAIT_KNEE[left],
            _GAIT_HIP[right],
            _GAIT_KNEE[right],
            0.9 * _GAIT_HIP[right] - 8,
            0.9 * _GAIT_HIP[left] - 8,
            np.full(len(phase), 3.0),
        ]
    )


@dataclass(frozen=True, eq=False)
class Performance:
    """A motion that the actor repeats.

    Attributes:
        columns: names of the table's columns except the first, which is the time.
        keys: (K, C), a row per key pose; the last one begins the next round, or ends the
            performance.
        fps: frames per second of its recording.
        rounds: repetitions in the whole recording.
        cameras: names of the cameras that film it.
        interpolation: constructor of the curves through the key poses.
    """

    columns: str
    keys: NDArray[np.float64]
    fps: int = 20
    rounds: int = 1
    cameras: tuple[str, ...] = _ALL_CAMERAS
    interpolation: Callable[[NDArray[np.float64], NDArray[np.float64]], Callable] = (
        PchipInterpolator
    )

    @cached_property
    def _curves(self) -> Callable:
        return self.interpolation(self.keys[:, 0], self.keys[:, 1:])

    @property
    def frames(self) -> int:
        """Number of frames of the whole performance."""
        return round(self.rounds * self.keys[-1, 0] * self.fps)

    def pose_at(self, time_s: float) -> tuple[NDArray[np.float64], dict[str, Rotation]]:
        """Position of the pelvis (2,), metres, and rotation of every bone at a time."""
        row = np.asarray(self._curves(time_s % self.keys[-1, 0])).tolist()
        values = _STANDING | dict(zip(self.columns.split(), row, strict=True))
        return np.array([values.get("x", 0.0), values.get("y", 0.0)]), _rotations(values)


_WHOLE_BODY = (
    "x y yaw lean twist look l_hip l_knee r_hip r_knee straddle l_arm l_out l_elbow r_arm r_out"
    " r_elbow r_turn"
)
_linear = partial(make_interp_spline, k=1)
PERFORMANCES = {
    "three_seconds": Performance(_WHOLE_BODY, _THREE_SECONDS),
    "there_and_back": Performance(_WHOLE_BODY, np.vstack([_THREE_SECONDS, _AND_BACK])),
    "arm_swing": Performance("yaw r_arm", _ARM_SWING, 15, 24, ("cam_3",), _linear),
    "golf": Performance(
        "yaw tip lean twist look l_hip l_knee r_hip r_knee straddle "
        "l_arm l_across l_out l_elbow l_turn r_arm r_across r_out r_elbow r_turn",
        _GOLF,
        15,
        1,
        ("cam_2",),
    ),
    "pointing": Performance(
        "yaw lean twist look r_arm r_across r_out r_elbow", _POINTING, 15, 1, ("cam_2",)
    ),
    "far_arm_swing": Performance(
        "yaw r_arm", _ARM_SWING - (0.0, 180.0, 0.0), 15, 24, ("cam_3",), _linear
    ),
    "walk": Performance(
        "x y yaw l_hip l_knee r_hip r_knee l_arm r_arm straddle",
        _walk(),
        interpolation=CubicSpline,
    ),
}
"""By name: "three_seconds" is two steps while turning, a wave with the right hand and a squat;
"there_and_back" returns from there to its beginning; "walk" goes round a circle; the others are
those of the experiments of paper A, the arm swing also with the left side toward the camera."""


def _rotations(values: dict[str, float]) -> dict[str, Rotation]:
    have = lambda name: values.get(name, 0.0)  # noqa: E731
    rotations = {
        "pelvis": _rotation(have("tip"), yaw=have("yaw")),
        "belly": _rotation(0.5 * have("lean"), yaw=0.4 * have("twist")),
        "chest": _rotation(0.5 * have("lean"), yaw=0.6 * have("twist")),
        "neck": _rotation(-0.3 * have("lean"), yaw=0.5 * have("look")),
        "head": _rotation(-0.3 * have("lean"), yaw=0.5 * have("look")),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        own = lambda name, key=side[0]: have(f"{key}_{name}")  # noqa: E731
        hip, knee, straddle = own("hip"), own("knee"), have("straddle")
        rotations[f"{side}_thigh"] = _rotation(-hip, -sign * straddle)
        rotations[f"{side}_shin"] = _rotation(knee)
        rotations[f"{side}_foot"] = _rotation(0.75 * (hip - knee), 0.8 * sign * straddle)
        arm = _rotation(-own("arm"), -sign * own("out"), -sign * own("across"))
        rotations[f"{side}_upper_arm"] = arm * _rotation(yaw=own("turn"))
        rotations[f"{side}_forearm"] = _rotation(-own("elbow"))
    return rotations


def _rotation(about_x: float = 0.0, about_y: float = 0.0, yaw: float = 0.0) -> Rotation:
    return Rotation.from_euler("ZYX", [yaw, about_y, about_x], degrees=True)
