"""Joint-name maps: the names of the joints that move the body model's parts in a skeleton."""

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from calib.errors import InputError
from calib.storage.documents import load_text, parse_toml
from silhouette_core.body.joints import SIDES, without_side
from silhouette_core.body.rigs.rig_dofs import LARGEST_TABLE

_MIDDLE = ("pelvis", "lumbar", "thorax", "neck", "head")
_LIMBS = ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shin", "foot", "toes")
_OPTIONAL = {"lumbar", "neck", "head", "clavicle", "toes"}
ROLES = _MIDDLE + tuple(f"{side}_{limb}" for side in SIDES for limb in _LIMBS)
"""The mapped joints: each is the proximal end of the body model's part of that name."""
NEEDED = tuple(role for role in ROLES if without_side(role) not in _OPTIONAL)
_SHIPPED = ("cmu", "cc_base", "mixamo", "plain")
_SIDE_WORD = re.compile(r"\{(Left|left|L|l)\}")
_RIGHT = {"Left": "Right", "left": "right", "L": "R", "l": "r"}


def of_side(side: str, name: str) -> str:
    """A name of the left or right side: {Left}, {left}, {L} and {l} in it are those or Right, …."""
    return _SIDE_WORD.sub(lambda mark: mark[1] if side == "left" else _RIGHT[mark[1]], name)


@dataclass(frozen=True)
class NameMap:
    """Joint-name map."""

    title: str  #: name of the map, for messages.
    names: dict[str, tuple[str, ...]]  #: for each role, possible names, best first.

    @classmethod
    def read(cls, path: Path) -> "NameMap":
        """Map of a TOML file.

        One line for each role, `pelvis = "Hips"` or a list of names, of which the first in the
        skeleton counts. A limb's line may state both sides: `thigh = "{Left}UpLeg"` means LeftUpLeg
        and RightUpLeg; {left}, {L} and {l} likewise. Raises InputError where it is missing, no
        TOML, or has a line that is no role.
        """
        text = load_text(path, LARGEST_TABLE)
        return cls._from_toml(path.name, parse_toml(text, path))

    @classmethod
    def shipped(cls) -> "list[NameMap]":
        """Maps that are part of the program."""
        folder = files("silhouette_core.motion.mocap") / "maps"
        return [
            cls._from_toml(
                name, tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8"))
            )
            for name in _SHIPPED
        ]

    @classmethod
    def _from_toml(cls, title: str, table: dict) -> "NameMap":
        names: dict[str, tuple[str, ...]] = {}
        for key, value in table.items():
            spellings = [value] if isinstance(value, str) else value
            if not isinstance(spellings, list) or not all(
                isinstance(spelling, str) for spelling in spellings
            ):
                raise InputError(
                    f"joint-name map {title}: {key[:40]} must be a name or a list of names"
                )
            if key in ROLES:
                names[key] = tuple(spellings)
            elif key in _LIMBS:
                for side in SIDES:
                    names[f"{side}_{key}"] = tuple(of_side(side, one) for one in spellings)
            else:
                raise InputError(
                    f"joint-name map {title}: {key[:40]!r} is no joint of ours: use"
                    f" {', '.join(_MIDDLE + _LIMBS)}"
                )
        return cls(title, names)

    def find(self, joints: Sequence[str]) -> dict[str, int]:
        """Index of the joint of every role that the skeleton has.

        Case, punctuation and namespaces do not count.
        """
        known = {_plain(joint): index for index, joint in reversed(list(enumerate(joints)))}
        candidates = {
            role: [known[p] for p in map(_plain, names) if p in known]
            for role, names in self.names.items()
        }
        return {role: indices[0] for role, indices in candidates.items() if indices}


def find_roles(source: str, joints: Sequence[str], path: Path | None) -> dict[str, int]:
    """Index of the joint of every role, at least of those of `NEEDED`. Raises InputError where a
    required joint has no name.

    Args:
        source: name of the motion's file, for messages.
        joints: names of the skeleton's joints.
        path: a map; None: the shipped map that covers most roles.
    """
    maps = NameMap.shipped() if path is None else [NameMap.read(path)]
    mapped = [name_map.find(joints) for name_map in maps]
    missing = [[role for role in NEEDED if role not in roles] for roles in mapped]
    best = min(range(len(maps)), key=lambda k: (len(missing[k]), -len(mapped[k])))
    if not missing[best]:
        return mapped[best]
    lacking = ", ".join(missing[best][:6]) + (", …" if len(missing[best]) > 6 else "")
    seen = ", ".join(joint[:40] for joint in joints[:8]) + (", …" if len(joints) > 8 else "")
    if path is not None:
        raise InputError(
            f"{source}: the map {path} finds no joint for {lacking} (the skeleton has {seen})"
        )
    raise InputError(
        f"{source}: unknown joints: nothing found for {lacking} (the skeleton has {seen}): give a"
        " joint-name map in TOML"
    )


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.rpartition(":")[2].lower().removeprefix("mixamorig"))
