"""Degrees of freedom of a rig's joints, and limits from a table beside the rig."""

from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from calib.errors import InputError
from calib.files.fields import METRES
from calib.storage.documents import load_text, parse_toml
from silhouette_core.body.kinematic_tree import Dof
from silhouette_core.body.rigs.rig_checks import short

TURNS = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}
"""Name of a turn about an axis of the body frame -> that axis."""
FREE_DEG = 150  #: Limits of a joint of which nothing is known: so far to either side.
UNITS_M = METRES | {"in": 254 / 10_000, "ft": 3048 / 10_000}
"""Units of length that a table can name, in metres."""
LARGEST_TABLE = 1_000_000  #: Bytes of a table in TOML.
_Angle = Annotated[float, Meta(ge=-360, le=360)]


class RigTable(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What a user says of a rig in NAME.rig.toml beside it."""

    unit: str | None = None  #: the rig's unit of length, of `UNITS_M`; None: not said.
    radius: Annotated[float, Meta(ge=1e-4, lt=10)] | None = None
    """Of the capsules of a skeleton without a surface, metres; None: by their lengths."""
    limits: dict[str, dict[Literal["x", "y", "z"], tuple[_Angle, _Angle]]] = {}
    """Joint -> axis of the body frame -> smallest and largest angle, degrees; joints that are left
    out turn as usual."""
    root_fixed: bool = False  #: whether the root stands still in the world, as a robot's base does.

    def check_joints(self, path: Path, names: list[str]) -> None:
        """Refuses limits of joints that the rig does not have. Raises InputError where there are
        such.
        """
        for name in self.limits:
            if name not in names:
                raise InputError(
                    f"{table_of(path)} has limits of {short(name)}, and the rig's joints are"
                    f" {short(', '.join(names))}"
                )

    def dofs(self, name: str) -> tuple[Dof, ...]:
        """Degrees of freedom of a joint that turns any way."""
        given = self.limits.get(name)
        if given is None:
            return ball_joint(FREE_DEG)
        return tuple(Dof(axis, turn, given[axis]) for axis, turn in TURNS.items() if axis in given)


def ball_joint(limit_deg: float) -> tuple[Dof, ...]:
    """Three turns about the axes of the body frame, so far to either side."""
    return tuple(Dof(name, axis, (-limit_deg, limit_deg)) for name, axis in TURNS.items())


def table_of(path: Path) -> Path:
    """The table beside a rig."""
    return path.with_name(f"{path.stem}.rig.toml")


def read_rig_table(path: Path) -> RigTable:
    """The table beside a rig, or an empty one. Raises InputError where the table is damaged, or
    says what cannot be.
    """
    file = table_of(path)
    if not file.is_file():
        return RigTable()
    try:
        table = msgspec.convert(parse_toml(load_text(file, LARGEST_TABLE), file), RigTable)
    except msgspec.ValidationError as error:
        raise InputError(f"{file}: {error}; correct it") from None
    if table.unit is not None and table.unit not in UNITS_M:
        raise InputError(f"{file}: no unit {short(table.unit)}: give one of {', '.join(UNITS_M)}")
    for name, limits in table.limits.items():
        for axis, (low, high) in limits.items():
            if not low < high:
                raise InputError(
                    f"{file}: the limits {low:g} and {high:g} of {short(name)} about {axis} are not"
                    " two angles in degrees, the smaller first"
                )
    return table
