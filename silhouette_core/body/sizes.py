"""Measurements of a person, and the axes of the shape space."""

from dataclasses import dataclass

import numpy as np

from calib.checks import check_array
from calib.errors import InputError
from silhouette_core.setting_types import CHESTS_M, STATURES_M

SHAPE_LIMITS = -9 / 10, 10  #: Smallest and largest deviation along an axis of the shape space.
TEMPLATE_CHANGES = -80 / 100, 200 / 100
"""Smallest and largest change of the template's chest, waist and hips; thighs only up to 0.95."""


@dataclass(frozen=True)
class BodySizes:
    """Measurements of a person, from which the default body is made. Raises InputError for a
    measurement that no person has.
    """

    stature_m: float  #: height standing upright without shoes.
    chest_girth_m: float | None = None  #: girth at the nipples; None: usual for the stature.
    sex: str = "unknown"  #: "male", "female" or "unknown".
    chest_change: float = 0.0
    """How much wider the chest is than the template's, relative, before any change along the shape
    axes, see `template_warp`. Where one of the changes is not 0, they alone decide the girths of
    the trunk, and the chest girth is only told."""
    waist_change: float = 0.0  #: likewise of the waist.
    hip_change: float = 0.0  #: likewise of the hips.
    thigh_change: float = 0.0  #: likewise of the thighs.

    def __post_init__(self) -> None:
        if not STATURES_M[0] <= self.stature_m <= STATURES_M[1]:
            raise InputError(
                f"stature {self.stature_m} m is not a person's: give it in metres, for example 1.75"
            )
        chest = self.chest_girth_m
        if chest is not None and not CHESTS_M[0] <= chest <= CHESTS_M[1]:
            raise InputError(
                f"chest girth {self.chest_girth_m} m is not a person's: give it in metres, for"
                " example 0.96"
            )
        if self.sex not in ("male", "female", "unknown"):
            raise InputError(f"sex {self.sex!r} is not known: give male, female or unknown")
        low, high = TEMPLATE_CHANGES
        for name, change in zip(("chest", "waist", "hip", "thigh"), self.changes, strict=True):
            most = 0.95 if name == "thigh" else high
            if not low <= change <= most:
                raise InputError(
                    f"{name}_change {change} is beyond what a body has: give {low} to {most}"
                )

    @property
    def changes(self) -> tuple[float, float, float, float]:
        """Changes of the template at chest, waist, hips and thighs."""
        return self.chest_change, self.waist_change, self.hip_change, self.thigh_change


@dataclass(frozen=True)
class ShapeAxis:
    """Axis of the shape space: a relative change of the size of some parts."""

    name: str
    parts: tuple[str, ...]  #: base names of the parts it scales ("thigh" stands for both sides).
    along: str
    """Either "length" (along the bone), "girth" (across it), one of "x", "y", "z" of the body
    frame, or "normal": outward by a fraction of the stature, as clothes are."""
    sigma: float
    """Relative standard deviation over adults, the prior of the adaptation; of clothes, thickness
    over the stature."""
    joints: bool = True  #: whether the joints carried by those parts move.
    flesh: bool = True  #: whether the surface moves.

    @property
    def is_clothing(self) -> bool:
        """Whether it is a thickness of clothes, which is never negative, and not of the body."""
        return self.along == "normal"


_TORSO = ("pelvis", "lumbar", "abdomen", "thorax", "upper_thorax")
# Per mille; sources unknown: not compared with a table, not ablated.
SHAPE_AXES = (
    ShapeAxis("trunk_length", _TORSO, "z", 40 / 1000),
    ShapeAxis("head_length", ("neck", "head"), "z", 50 / 1000),
    ShapeAxis("shoulder_width", ("clavicle",), "x", 80 / 1000),
    ShapeAxis("hip_width", ("pelvis",), "x", 60 / 1000, flesh=False),
    ShapeAxis("upper_arm_length", ("upper_arm",), "length", 50 / 1000),
    ShapeAxis("forearm_length", ("forearm",), "length", 50 / 1000),
    ShapeAxis("hand_length", ("hand", "fingers", "thumb"), "length", 60 / 1000),
    ShapeAxis("thigh_length", ("thigh",), "length", 45 / 1000),
    ShapeAxis("shin_length", ("shin",), "length", 45 / 1000),
    ShapeAxis("foot_length", ("foot", "toes"), "y", 50 / 1000),
    ShapeAxis("trunk_width", _TORSO, "x", 80 / 1000, joints=False),
    ShapeAxis("trunk_depth", _TORSO, "y", 100 / 1000, joints=False),
    ShapeAxis("neck_girth", ("neck",), "girth", 100 / 1000, joints=False),
    ShapeAxis("head_girth", ("head",), "girth", 60 / 1000, joints=False),
    ShapeAxis("upper_arm_girth", ("upper_arm", "clavicle"), "girth", 120 / 1000, joints=False),
    ShapeAxis("forearm_girth", ("forearm",), "girth", 100 / 1000, joints=False),
    ShapeAxis("hand_girth", ("hand", "fingers"), "girth", 100 / 1000, joints=False),
    ShapeAxis("thigh_girth", ("thigh",), "girth", 100 / 1000, joints=False),
    ShapeAxis("shin_girth", ("shin",), "girth", 100 / 1000, joints=False),
    ShapeAxis("foot_girth", ("foot", "toes"), "x", 100 / 1000, joints=False),
    ShapeAxis("shirt", (*_TORSO[1:], "clavicle", "upper_arm"), "normal", 10 / 1000, joints=False),
    ShapeAxis("trousers", ("pelvis", "thigh", "shin"), "normal", 10 / 1000, joints=False),
)
SHAPE_SIGMA = np.array([axis.sigma for axis in SHAPE_AXES])
IS_CLOTHING = np.array([axis.is_clothing for axis in SHAPE_AXES])


def check_shape(shape: np.ndarray) -> None:
    """Checks deviations (K,) along the shape axes, as of `BodyModel.reshaped`, read from a file.
    Raises TypeError where it is not float64; ValueError where it has another shape, or deviations
    that no body has.
    """
    check_array("body_shape", shape, (len(SHAPE_AXES),), np.float64, finite=True)
    low, high = SHAPE_LIMITS
    if not (shape.min() >= low and shape.max() <= high):
        raise ValueError(f"body_shape holds {shape.min():g} to {shape.max():g}, as no body has")
