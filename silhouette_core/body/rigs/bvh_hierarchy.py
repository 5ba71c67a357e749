"""Hierarchy of Biovision (BVH) files: the skeleton before the motion."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from calib.errors import InputError

LARGEST_CLIP = 300_000_000  #: Bytes of a clip of any format; an hour takes a tenth of it.
MOST_JOINTS = 1000  #: Joints of a recorded skeleton; with all fingers some two hundred.
LARGEST_VALUE = 10_000_000  #: Every angle, in degrees, and position, in any unit, is below it.
_CHANNEL = re.compile(r"^([XYZ])(position|rotation)$", re.IGNORECASE)
_END_SITE = -2


@dataclass
class BvhJoint:
    """Joint of the hierarchy."""

    name: str
    parent: int  #: index of the parent, -1 for the root.
    offset: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    """(3,), position relative to the parent."""
    channels: list[tuple[str, str]] = field(default_factory=list)
    """Axis and kind of each channel, in the file's order: ("X", "position"), …."""
    end: list[float] | None = None  #: (3,), position of its end site, None without one.


def split_bvh(text: str, path: Path) -> tuple[list[BvhJoint], str]:
    """Joints of a file, parents first, and the text that follows MOTION. Raises InputError where it
    is no BVH, or its hierarchy is damaged.

    Args:
        text: all of the file.
        path: the file, for messages.
    """
    head, mark, tail = text.partition("MOTION")
    if not mark or "HIERARCHY" not in head:
        raise InputError(
            f"{path} is no BVH, or cut off: it lacks"
            f" {'MOTION' if 'HIERARCHY' in head else 'HIERARCHY'}"
        )
    try:
        return _hierarchy(iter(re.sub(r"([{}])", r"\n\1\n", head).splitlines())), tail
    except (ValueError, IndexError, StopIteration) as error:
        raise InputError(
            f"{path} has a damaged hierarchy: {str(error)[:200] or 'it ends too early'}: export it"
            " again"
        ) from error


def _hierarchy(lines: Iterator[str]) -> list[BvhJoint]:
    joints: list[BvhJoint] = []
    open_joints: list[int] = []
    upcoming = _END_SITE
    for line in lines:
        word, _, rest = line.strip().partition(" ")
        match word.upper():
            case "ROOT" | "JOINT" if _END_SITE not in open_joints[-1:]:
                joints.append(BvhJoint(rest.strip(), open_joints[-1] if open_joints else -1))
                upcoming = len(joints) - 1
            case "END":
                upcoming = _END_SITE
            case "{":
                open_joints.append(upcoming)
            case "}":
                open_joints.pop()
            case "OFFSET" if open_joints[-1] >= 0:
                joint = joints[open_joints[-1]]
                joint.offset = _offset(rest, joint.name)
            case "OFFSET" if len(open_joints) > 1 and open_joints[-2] >= 0:
                joint = joints[open_joints[-2]]
                joint.end = _offset(rest, joint.name)
            case "CHANNELS" if open_joints[-1] >= 0:
                joints[open_joints[-1]].channels = _channels(rest.split())
        if len(joints) > MOST_JOINTS:
            raise ValueError(f"it has more than {MOST_JOINTS} joints")
    if open_joints or not joints:
        raise ValueError("it ends too early" if joints else "it has no ROOT")
    return joints


def _offset(text: str, name: str) -> list[float]:
    offset = [float(x) for x in text.split()]
    if not all(abs(x) < LARGEST_VALUE for x in offset):
        raise ValueError(f"the OFFSET {text.strip()[:60]} is no bone's")
    if len(offset) != 3:
        raise ValueError(f"the OFFSET of {name} has not three numbers")
    return offset


def _channels(words: list[str]) -> list[tuple[str, str]]:
    matches = [_CHANNEL.match(word) for word in words[1:]]
    if int(words[0]) != len(matches) or not all(matches):
        raise ValueError(f"CHANNELS {' '.join(words)} cannot be")
    return [(m[1].upper(), m[2].lower()) for m in matches if m]
