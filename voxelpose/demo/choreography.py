"""Performances of the demo's actor: the tables of performances.toml, and a walk."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator, make_interp_spline
from scipy.spatial.transform import Rotation

from voxelpose.demo import demo_table

_LIMBS = {"out": 8, "elbow": 14, "knee": 4, "hip": 2}
_STANDING = {f"{side}_{name}": angle for side in "lr" for name, angle in _LIMBS.items()}
_STANDING |= {"straddle": 4}
_CURVES = {
    "monotone": PchipInterpolator,
    "linear": partial(make_interp_spline, k=1),
    "smooth": CubicSpline,
}


@dataclass(frozen=True, eq=False)
class Performance:
    """A motion that the actor repeats."""

    columns: str  # names of the table's columns except the first, which is the time
    # (K, C), a row per key pose; the last one begins the next round, or ends the performance.
    keys: NDArray[np.float64]
    fps: int = 20  # of its recording
    rounds: int = 1  # repetitions in the whole recording
    cameras: Sequence[str] = ("cam_1", "cam_2", "cam_3", "cam_4")  # that film it
    interpolation: str = "monotone"  # of the key poses; or "linear", "smooth"

    @cached_property
    def _curves(self) -> Callable:
        return _CURVES[self.interpolation](self.keys[:, 0], self.keys[:, 1:])

    @property
    def frames(self) -> int:
        """Number of frames of the whole performance."""
        return round(self.rounds * self.keys[-1, 0] * self.fps)

    def pose_at(self, time_s: float) -> tuple[NDArray[np.float64], dict[str, Rotation]]:
        """Position of the pelvis (2,), metres, and rotation of every bone at a time."""
        row = np.asarray(self._curves(time_s % self.keys[-1, 0])).tolist()
        values = _STANDING | dict(zip(self.columns.split(), row, strict=True))
        return np.array([values.get("x", 0.0), values.get("y", 0.0)]), _rotations(values)


@cache
def performances() -> dict[str, Performance]:
    """Performances by name: those of performances.toml and "walk"."""
    by_name: dict[str, Performance] = {}
    for name, table in demo_table("performances").items():
        keys = np.array(table["keys"], float)
        if "after" in table:
            keys = np.vstack([by_name[table["after"]].keys, keys])
        others = {key: value for key, value in table.items() if key not in ("after", "keys")}
        by_name[name] = Performance(keys=keys, **others)
    return by_name | {"walk": _walk()}


def _walk() -> Performance:
    """A walk counterclockwise on a circle."""
    strides, stride_s, circle_m = 3, 1.1, 0.55
    # Angles of one leg over a stride from heel strike on, in eighths.
    hip, knee = np.array([[30, 25, 8, -3, -10, 0, 22, 32], [5, 18, 14, 8, 10, 46, 58, 26]])
    phase = np.arange(8 * strides + 1)
    left, right = phase % 8, (phase + 4) % 8
    angle = 2 * np.pi * phase / phase[-1]
    keys = np.column_stack(
        [
            phase * stride_s / 8,
            circle_m * np.cos(angle),
            circle_m * np.sin(angle),
            180 + np.degrees(angle),
            hip[left],
            knee[left],
            hip[right],
            knee[right],
            0.9 * hip[right] - 8,
            0.9 * hip[left] - 8,
            np.full(len(phase), 3.0),
        ]
    )
    columns = "x y yaw l_hip l_knee r_hip r_knee l_arm r_arm straddle"
    return Performance(columns, keys, interpolation="smooth")


def _rotations(values: Mapping[str, float]) -> dict[str, Rotation]:
    have = lambda name: values.get(name, 0.0)  # noqa: E731
    rotations = {
        "pelvis": _rotation(have("tip"), yaw=have("yaw")),
        "belly": _rotation(0.5 * have("lean"), yaw=0.4 * have("twist")),
        "chest": _rotation(0.5 * have("lean"), yaw=0.6 * have("twist")),
        "neck": _rotation(-0.3 * have("lean"), yaw=0.5 * have("look")),
        "head": _rotation(-0.3 * have("lean"), yaw=0.5 * have("look")),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        limb = lambda name, key=side[0]: have(f"{key}_{name}")  # noqa: E731
        hip, knee, straddle = limb("hip"), limb("knee"), have("straddle")
        rotations[f"{side}_thigh"] = _rotation(-hip, -sign * straddle)
        rotations[f"{side}_shin"] = _rotation(knee)
        rotations[f"{side}_foot"] = _rotation(0.75 * (hip - knee), 0.8 * sign * straddle)
        arm = _rotation(-limb("arm"), -sign * limb("out"), -sign * limb("across"))
        rotations[f"{side}_upper_arm"] = arm * _rotation(yaw=limb("turn"))
        rotations[f"{side}_forearm"] = _rotation(-limb("elbow"))
    return rotations


def _rotation(about_x: float = 0.0, about_y: float = 0.0, yaw: float = 0.0) -> Rotation:
    return Rotation.from_euler("ZYX", [yaw, about_y, about_x], degrees=True)
