"""The measures of the two template bodies, in units of stature unless said.

Breadths, depths and girths follow published surveys (ANSUR II, ISO 7250-1 and ISO/TR 7250-2, JIS L4004/L4005 for the choice of stature
and chest), scaled to a lean adult; how flesh is shared out between front and back, and along a limb, is modelled by eye on anatomy.
Positions: x to the left, y to the back, z up, origin on the floor under the pelvis joint.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import PART_NAMES

Table = tuple[tuple[float, ...], ...]
ARM = np.array([np.sqrt(0.5), 0.0, -np.sqrt(0.5)])
"""Direction of the left arm at rest."""
ARM_UP = np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)])
"""Across the arm, on the thumb's side: palms face forward."""


@dataclass(frozen=True)
class Figure:
    """One body's measures. Tables: rows of position, outer, inner, front and back radius (see `implicit.Loft`).

    Attributes:
        name: of the template file.
        sex: "male" or "female".
        stature_m: height in metres.
        chest_girth_m: girth at the nipples in metres; the trunk is widened until it fits.
        hip: x of the hip joint.
        shoulder: x of the shoulder joint.
        forearm: elbow to wrist.
        trunk: by height.
        neck: along the neck.
        thigh: hip to knee.
        shin: knee to ankle.
        upper_arm: shoulder to elbow.
        forearm_flesh: elbow to wrist.
        hand: wrist to finger tips.
        foot: heel to toe; the front radius is the upper one.
        lumps: ellipsoids that join the trunk: centre (3), radii (3), reach of the union.
        head: scale of the skull across and along (x, y).
    """

    name: str
    sex: str
    stature_m: float
    chest_girth_m: float
    hip: float
    shoulder: float
    forearm: float
    trunk: Table
    neck: Table
    thigh: Table
    shin: Table
    upper_arm: Table
    forearm_flesh: Table
    hand: Table
    foot: Table
    lumps: Table
    head: tuple[float, float] = (1.0, 1.0)
    joints: dict[str, NDArray[np.float64]] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "joints", _joints(self.hip, self.shoulder, self.forearm))

    def joint_array(self) -> NDArray[np.float64]:
        """Returns the (27, 3) joints in the order of the parts."""
        mirror = np.array([-1.0, 1.0, 1.0])
        return np.stack([self.joints[n] if n in self.joints else self.joints[n.replace("right", "left")] * mirror for n in PART_NAMES])


def _joints(hip: float, shoulder: float, forearm: float) -> dict[str, NDArray[np.float64]]:
    elbow = np.array([shoulder, -0.008, 0.8006]) + 0.150 * ARM
    wrist = elbow + forearm * ARM
    places = {
        "pelvis": (0, 0, 0.541),
        "lumbar": (0, 0.014, 0.583),
        "abdomen": (0, 0.014, 0.625),
        "thorax": (0, 0.016, 0.668),
        "upper_thorax": (0, 0.024, 0.745),
        "neck": (0, -0.005, 0.8606),
        "head": (0, -0.018, 0.9120),
        "left_clavicle": (0.0140, -0.012, 0.8120),
        "left_upper_arm": (shoulder, -0.008, 0.8006),
        "left_forearm": elbow,
        "left_hand": wrist,
        "left_thumb": wrist + 0.014 * ARM + 0.012 * ARM_UP + np.array([0, -0.004, 0]),
        "left_fingers": wrist + 0.054 * ARM,
        "left_thigh": (hip, 0.006, 0.537),
        "left_shin": (hip + 0.0125, -0.014, 0.290),
        "left_foot": (hip + 0.0235, -0.007, 0.041),
        "left_toes": (hip + 0.0295, -0.087, 0.012),
    }
    return {name: np.array(place, float) for name, place in places.items()}


MAN = Figure(
    name="man",
    sex="male",
    stature_m=1.75,
    chest_girth_m=0.96,
    hip=0.0625,
    shoulder=0.1065,
    forearm=0.149,
    trunk=(
        (0.463, 0.020, 0.020, 0.020, 0.020),
        (0.475, 0.055, 0.055, 0.042, 0.030),
        (0.490, 0.080, 0.080, 0.055, 0.042),
        (0.510, 0.094, 0.094, 0.061, 0.050),
        (0.530, 0.0950, 0.0950, 0.066, 0.052),
        (0.550, 0.0925, 0.0925, 0.069, 0.050),
        (0.575, 0.0875, 0.0875, 0.0725, 0.0425),
        (0.600, 0.0830, 0.0830, 0.074, 0.036),
        (0.620, 0.0812, 0.0812, 0.0745, 0.0335),
        (0.640, 0.0812, 0.0812, 0.0755, 0.034),
        (0.660, 0.0830, 0.0830, 0.077, 0.037),
        (0.690, 0.0875, 0.0875, 0.0785, 0.043),
        (0.720, 0.0925, 0.0925, 0.079, 0.048),
        (0.740, 0.0945, 0.0945, 0.078, 0.051),
        (0.760, 0.0945, 0.0945, 0.074, 0.053),
        (0.780, 0.0920, 0.0920, 0.066, 0.053),
        (0.800, 0.0860, 0.0860, 0.056, 0.051),
        (0.815, 0.0740, 0.0740, 0.048, 0.046),
        (0.830, 0.0540, 0.0540, 0.043, 0.038),
        (0.845, 0.0330, 0.0330, 0.040, 0.029),
        (0.856, 0.0180, 0.0180, 0.030, 0.018),
    ),
    neck=(
        (0.0, 0.038, 0.038, 0.036, 0.032),
        (0.4, 0.0345, 0.0345, 0.0335, 0.032),
        (0.7, 0.0335, 0.0335, 0.033, 0.034),
        (1.0, 0.034, 0.034, 0.032, 0.038),
    ),
    thigh=(
        (-0.12, 0.018, 0.026, 0.030, 0.026),
        (0.00, 0.0335, 0.048, 0.060, 0.042),
        (0.15, 0.0360, 0.0575, 0.0655, 0.043),
        (0.30, 0.0395, 0.0570, 0.0650, 0.040),
        (0.50, 0.0400, 0.0520, 0.0620, 0.036),
        (0.70, 0.0355, 0.0425, 0.0515, 0.033),
        (0.85, 0.0310, 0.0350, 0.0430, 0.032),
        (1.00, 0.0295, 0.0305, 0.0320, 0.039),
        (1.05, 0.0295, 0.0300, 0.0300, 0.038),
    ),
    shin=(
        (-0.05, 0.0290, 0.0300, 0.0310, 0.038),
        (0.00, 0.0295, 0.0305, 0.0315, 0.039),
        (0.10, 0.0325, 0.0290, 0.0250, 0.044),
        (0.20, 0.0360, 0.0295, 0.0210, 0.048),
        (0.30, 0.0365, 0.0305, 0.0190, 0.049),
        (0.40, 0.0350, 0.0295, 0.0175, 0.0465),
        (0.50, 0.0315, 0.0265, 0.0165, 0.0420),
        (0.60, 0.0275, 0.0225, 0.0160, 0.0370),
        (0.70, 0.0235, 0.0185, 0.0160, 0.0325),
        (0.80, 0.0200, 0.0150, 0.0165, 0.0290),
        (0.90, 0.0185, 0.0140, 0.0185, 0.0275),
        (1.00, 0.0190, 0.0165, 0.0215, 0.0270),
        (1.06, 0.0160, 0.0140, 0.0180, 0.0240),
    ),
    upper_arm=(
        (-0.14, 0.020, 0.018, 0.022, 0.022),
        (0.00, 0.0325, 0.030, 0.0320, 0.0330),
        (0.15, 0.0330, 0.030, 0.0330, 0.0335),
        (0.30, 0.0300, 0.0265, 0.0300, 0.0310),
        (0.50, 0.0260, 0.0250, 0.0290, 0.0295),
        (0.70, 0.0240, 0.0240, 0.0280, 0.0275),
        (0.85, 0.0230, 0.0235, 0.0250, 0.0260),
        (1.00, 0.0240, 0.0240, 0.0215, 0.0240),
    ),
    forearm_flesh=(
        (0.00, 0.0240, 0.0240, 0.0215, 0.0240),
        (0.10, 0.0255, 0.0235, 0.0230, 0.0225),
        (0.22, 0.0260, 0.0240, 0.0230, 0.0215),
        (0.35, 0.0245, 0.0225, 0.0215, 0.0205),
        (0.50, 0.0210, 0.0200, 0.0192, 0.0188),
        (0.70, 0.0175, 0.0168, 0.0165, 0.0160),
        (0.85, 0.0162, 0.0155, 0.0142, 0.0138),
        (1.00, 0.0168, 0.0160, 0.0125, 0.0118),
    ),
    hand=(
        (0.00, 0.0168, 0.0160, 0.0125, 0.0118),
        (0.14, 0.0190, 0.0185, 0.0125, 0.0108),
        (0.28, 0.0228, 0.0222, 0.0120, 0.0098),
        (0.46, 0.0245, 0.0235, 0.0098, 0.0092),
        (0.52, 0.0243, 0.0232, 0.0088, 0.0088),
        (0.66, 0.0225, 0.0208, 0.0080, 0.0080),
        (0.82, 0.0190, 0.0170, 0.0072, 0.0072),
        (0.94, 0.0135, 0.0115, 0.0058, 0.0058),
        (1.00, 0.0060, 0.0050, 0.0030, 0.0030),
    ),
    foot=(
        (0.00, 0.0070, 0.0070, 0.0080, 0.0100),
        (0.06, 0.0165, 0.0160, 0.0230, 0.0120),
        (0.16, 0.0185, 0.0175, 0.0300, 0.0120),
        (0.32, 0.0200, 0.0175, 0.0330, 0.0120),
        (0.47, 0.0235, 0.0205, 0.0280, 0.0120),
        (0.62, 0.0270, 0.0255, 0.0200, 0.0120),
        (0.74, 0.0280, 0.0290, 0.0150, 0.0120),
        (0.86, 0.0240, 0.0280, 0.0115, 0.0115),
        (0.95, 0.0160, 0.0220, 0.0090, 0.0100),
        (1.00, 0.0060, 0.0100, 0.0050, 0.0070),
    ),
    lumps=(
        (0.044, 0.020, 0.502, 0.046, 0.043, 0.046, 0.020),
        (0.046, -0.050, 0.752, 0.048, 0.029, 0.036, 0.030),
        (0.055, 0.034, 0.775, 0.036, 0.022, 0.050, 0.020),
    ),
)

FIGURES = (MAN,)
