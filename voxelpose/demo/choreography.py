"""What the demo's actor does in three seconds: two steps while turning, a wave with the right hand, a squat."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

DURATION_S = 3.0
_COLUMNS: list[str] = list(
    "time x y yaw lean twist look l_hip l_knee r_hip r_knee straddle l_arm l_out l_elbow r_arm r_out r_elbow r_turn".split()
)
# Metres and degrees. Hip, knee, arm, elbow and lean: bending forward (knee: backward); out: away from the side; turn: about the arm.
_KEYS = np.array([
    #  t      x      y    yaw lean twist look  lh  lk  rh  rk  st   la  lo  le   ra   ro  re  rt
    (0.00,  0.25,  0.30,  -30,  4,    6,   0,  28, 10, -18, 12,  2, -24,  8, 18,  26,   8, 22,  0),
    (0.25,  0.20,  0.18,  -25,  4,    0,   5,   4,  6,  30, 58,  2,   0,  8, 15,   2,   8, 15,  0),
    (0.50,  0.14,  0.04,  -15,  4,   -6,   5, -18, 12,  28, 10,  2,  26,  8, 22, -24,   8, 18,  0),
    (0.75,  0.08, -0.08,    0,  4,    0,   0,  30, 58,   4,  6,  2,   2,  8, 15,   0,   8, 15,  0),
    (1.00,  0.03, -0.16,   20,  3,    4,   0,  16,  8, -10,  8,  3, -12,  9, 15,  14,   9, 20,  0),
    (1.25,  0.00, -0.18,   30,  1,    0, -10,   3,  4,   3,  4,  5,   0, 10, 12,  10,  45, 40, -40),
    (1.50,  0.00, -0.18,   30,  0,   -4, -15,   2,  3,   3,  4,  6,   2, 10, 12,  5,  95, 70, -88),
    (1.65,  0.00, -0.18,   30,  0,   -4, -15,   2,  3,   3,  4,  6,   2, 10, 12,  5, 100, 40, -88),
    (1.80,  0.00, -0.18,   30,  0,   -4, -15,   2,  3,   3,  4,  6,   2, 10, 12,  5,  95, 85, -88),
    (1.95,  0.00, -0.18,   28,  0,   -2, -10,   3,  4,   3,  4,  7,   8, 10, 12,  5,  92, 45, -80),
    (2.20,  0.00, -0.17,   15, 12,    0,   0,  25, 30,  25, 30,  8,  45, 14, 15,  45,  30, 20,  0),
    (2.55,  0.00, -0.12,    5, 28,    0,   0,  82, 95,  82, 95, 12,  84, 12, 10,  84,  12, 10,  0),
    (2.75,  0.00, -0.12,    0, 30,    0,   0,  86, 99,  86, 99, 12,  88, 10, 10,  88,  10, 10,  0),
    (3.00,  0.00, -0.14,   -5, 18,    0,   0,  45, 52,  45, 52, 10,  55, 12, 12,  55,  12, 12,  0),
])  # fmt: skip
_CURVES = PchipInterpolator(_KEYS[:, 0], _KEYS[:, 1:])


def pose_at(time_s: float) -> tuple[NDArray[np.float64], dict[str, Rotation]]:
    """Returns the pelvis' place (2,) in metres and the turns of the bones at a time; the performance repeats."""
    values = dict(zip(_COLUMNS[1:], np.asarray(_CURVES(time_s % DURATION_S)), strict=True))
    turns = {
        "pelvis": _turn(yaw=values["yaw"]),
        "belly": _turn(0.5 * values["lean"], yaw=0.4 * values["twist"]),
        "chest": _turn(0.5 * values["lean"], yaw=0.6 * values["twist"]),
        "neck": _turn(-0.3 * values["lean"], yaw=0.5 * values["look"]),
        "head": _turn(-0.3 * values["lean"], yaw=0.5 * values["look"]),
    }
    for side, sign in (("left", 1.0), ("right", -1.0)):
        key = side[0]
        hip, knee = values[f"{key}_hip"], values[f"{key}_knee"]
        turns[f"{side}_thigh"] = _turn(-hip, -sign * values["straddle"])
        turns[f"{side}_shin"] = _turn(knee)
        turns[f"{side}_foot"] = _turn(0.75 * (hip - knee), 0.8 * sign * values["straddle"])
        arm = _turn(-values[f"{key}_arm"], -sign * values[f"{key}_out"])
        turns[f"{side}_upper_arm"] = arm * _turn(yaw=values["r_turn"] if key == "r" else 0.0)
        turns[f"{side}_forearm"] = _turn(-values[f"{key}_elbow"])
    return np.array([values["x"], values["y"]]), turns


def _turn(about_x: float = 0.0, about_y: float = 0.0, yaw: float = 0.0) -> Rotation:
    return Rotation.from_euler("ZYX", [yaw, about_y, about_x], degrees=True)
