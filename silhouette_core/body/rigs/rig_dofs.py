"""Degrees of freedom of a rig's joints, and limits from a table beside the rig."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from calib.documents import load_text, parse_toml
from calib.errors import InputError
from calib.files.fields import METRES
from silhouette_core.body.kinematic_tree import Dof
from silhouette_core.body.rigs.rig_checks import short

TURNS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
"""Name of a turn about an axis of the body frame -> that axis."""
FREE_DEG = 150
"""Limits of a joint of which nothing is known: so far to either side."""
UNITS_M = METRES | {"in": 254 / 10_000, "ft": 3048 / 10_000}
"""Units of length that a table can name, in metres."""
_KEYS = "unit", "radius", "root_fixed", "limits"
_LARGEST_TABLE = 1_000_000
_LARGEST_DEG = 360


@dataclass(frozen=True)
class RigTable:
    """What a user says of a rig in NAME.rig.toml beside it.

    Attributes:
        unit_m: the rig's unit of length, in metres; None: not said.
        radius_m: radius of the capsules of a skeleton without a surface; None: by their lengths.
        limits_deg: joint -> axis ("x", "y" or "z" of the body frame) -> smallest and largest
            angle; joints that are left out turn as usual.
        root_fixed: whether the root stands still in the world, as a robot's base does.
    """

    unit_m: float | None = None
    radius_m: float | None = None
    limits_deg: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    root_fixed: bool = False

    def check_joints(self, path: Path, names: list[str]) -> None:
        """Refuses limits of joints that the rig does not have.

        Raises:
            InputError: there are such.
        """
        for name in self.limits_deg:
            if name not in names:
                raise InputError(
                    f"{table_of(path)} has limits of {short(name)}, and the rig's joints are"
                    f" {short(', '.join(names))}"
                )

    def dofs(self, name: str) -> tuple[Dof, ...]:
        """Degrees of freedom of a joint that turns any way."""
        given = self.limits_deg.get(name)
        if given is None:
            return ball_joint(FREE_DEG)
        return tuple(Dof(axis, TURNS[axis], given[axis]) for axis in TURNS if axis in given)


def ball_joint(limit_deg: float) -> tuple[Dof, ...]:
    """Three turns about the axes of the body frame, so far to either side."""
    return tuple(Dof(name, axis, (-limit_deg, limit_deg)) for name, axis in TURNS.items())


def table_of(path: Path) -> Path:
    """The table beside a rig."""
    return path.with_name(f"{path.stem}.rig.toml")


def read_rig_table(path: Path) -> RigTable:
    """The table beside a rig, or an empty one.

    Raises:
        InputError: the table is damaged, or says what cannot be.
    """
    file = table_of(path)
    if not file.is_file():
        return RigTable()
    content = parse_toml(load_text(file, _LARGEST_TABLE), file)
    if unknown := set(content) - set(_KEYS):
        raise InputError(f"{file} has {short(min(unknown))}: it can have {', '.join(_KEYS)}")
    unit, radius = content.get("unit"), content.get("radius")
    if unit is not None and unit not in UNITS_M:
        raise InputError(f"{file}: no unit {short(unit)}: give one of {', '.join(UNITS_M)}")
    if radius is not None and not (_is_number(radius) and 1e-4 <= radius < 10):
        raise InputError(f"{file}: the radius {short(radius)} is none in metres: give 0.03, say")
    limits = content.get("limits", {})
    if not isinstance(limits, dict):
        raise InputError(f"{file}: limits is no table: write [limits.JOINT]")
    if not isinstance(content.get("root_fixed", False), bool):
        raise InputError(f"{file}: root_fixed is neither true nor false")
    return RigTable(
        None if unit is None else UNITS_M[unit],
        radius,
        {name: _limits(file, name, own) for name, own in limits.items()},
        content.get("root_fixed", False),
    )


def _limits(file: Path, name: str, own: Any) -> dict[str, tuple[float, float]]:
    if not isinstance(own, dict) or not set(own) <= set(TURNS):
        raise InputError(
            f"{file}: the limits of {short(name)} are no table of x, y and z: write x = [-30, 60]"
        )
    for axis, span in own.items():
        numbers = isinstance(span, list) and len(span) == 2 and all(map(_is_number, span))
        if not numbers or not -_LARGEST_DEG <= span[0] < span[1] <= _LARGEST_DEG:
            raise InputError(
                f"{file}: the limits {short(span)} of {short(name)} about {axis} are not two angles"
                " in degrees, the smaller first"
            )
    return {axis: (float(low), float(high)) for axis, (low, high) in own.items()}


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
