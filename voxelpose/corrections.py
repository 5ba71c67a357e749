"""Corrections of a result by hand: kept beside the estimate, and made whenever it is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from calib.checks import BoolArray
from calib.errors import InputError
from calib.storage.atomic import write_whole
from calib.storage.documents import load_text, parse_json
from silhouette_core.motion.conditioning import as_estimated, conditioned, quality_with_filled
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.heading import limbs_exchanged, turned_half_round
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import read_motion
from silhouette_core.motion.pose import JointTarget
from silhouette_core.setting_types import FrameNumber, Limbs

CORRECTIONS = "corrections.json"
_LARGEST_BYTES = _LAST = 10_000_000
_Person = Annotated[int, Meta(ge=1, le=100)]
_Range = tuple[FrameNumber, FrameNumber]  # the first frame, and one past the last


class Trim(msgspec.Struct, tag="trim", frozen=True, forbid_unknown_fields=True):
    """Nothing but a range of frames is left of everybody."""

    frames: _Range

    def __str__(self) -> str:
        return f"trimmed to {_range_text(self.frames)}"

    def is_of(self, people: set[int]) -> bool:
        """Whether it changes the motion of one of some people."""
        return True

    def of(self, people: list[Motion], home: Path) -> list[Motion]:
        """Corrected poses of everybody. What is left is cut out last, when the filter has acted."""
        return people


class ExchangeSides(msgspec.Struct, tag="sides", frozen=True, forbid_unknown_fields=True):
    """Left and right of a person, or of limbs alone, exchanged over a range of frames."""

    frames: _Range
    person: _Person | None = None  # of several
    limbs: Limbs | None = None  # None: the whole body is turned half round

    def __str__(self) -> str:
        what = f" {self.limbs}" if self.limbs else ""
        whose = f" of person {self.person}" if self.person else ""
        return f"left and right{what}{whose} exchanged in {_range_text(self.frames)}"

    def is_of(self, people: set[int]) -> bool:
        """Whether it changes the motion of one of some people."""
        return (self.person or 1) in people

    def of(self, people: list[Motion], home: Path) -> list[Motion]:
        """Corrected poses of everybody. InputError where there are none, or without sides."""
        motion = _person_of(people, self.person or 1)
        rows = _rows(motion, self.frames)
        if not rows.any():
            raise InputError(f"there is no pose in {_range_text(self.frames)}: choose other frames")
        if not is_person_tree(motion.model.tree):
            raise InputError("this body is no person's: it has no left and right to exchange")
        turned = (
            turned_half_round(motion, rows)
            if self.limbs is None
            else limbs_exchanged(motion, rows, self.limbs)
        )
        return [turned if one is motion else one for one in people]


class ExchangePeople(msgspec.Struct, tag="people", frozen=True, forbid_unknown_fields=True):
    """Two people exchanged from a frame on: the bodies stay, the poses change over."""

    first_frame: FrameNumber
    people: tuple[_Person, _Person] = (1, 2)

    def __str__(self) -> str:
        one, other = self.people
        return f"persons {one} and {other} exchanged from frame {self.first_frame} on"

    def is_of(self, people: set[int]) -> bool:
        """Whether it changes the motion of one of some people."""
        return not people.isdisjoint(self.people)

    def of(self, people: list[Motion], home: Path) -> list[Motion]:
        """Corrected poses of everybody. InputError where there are no two to exchange."""
        one, other = (_person_of(people, number) for number in self.people)
        if one is other:
            raise InputError(f"person {self.people[0]} cannot be exchanged with the same: name two")
        changed, rest = {id(one): other, id(other): one}, (self.first_frame, _LAST)
        return [
            _replaced(motion, changed[id(motion)], rest) if id(motion) in changed else motion
            for motion in people
        ]


class FitAgain(msgspec.Struct, tag="fit again", frozen=True, forbid_unknown_fields=True):
    """A range of frames fitted again without a camera, or with joints where somebody set them; the
    poses are in a file beside.
    """

    frames: _Range
    poses: Annotated[str, Meta(pattern=r"^fitted_again_\d{1,6}\.safetensors$")]
    camera: Annotated[str, Meta(max_length=200)] = ""
    targets: tuple[JointTarget, ...] = ()

    def __str__(self) -> str:
        ways = [f"without {self.camera}"] if self.camera else []
        ways += [f"with {one.joint} set in frame {one.frame}" for one in self.targets]
        return f"{_range_text(self.frames)} fitted again {' and '.join(ways)}"

    def is_of(self, people: set[int]) -> bool:
        """Whether it changes the motion of one of some people."""
        return 1 in people

    def of(self, people: list[Motion], home: Path) -> list[Motion]:
        """Corrected poses of everybody. InputError where the file is missing or damaged."""
        return [_replaced(people[0], read_motion(home / self.poses), self.frames), *people[1:]]


Correction = Trim | ExchangeSides | ExchangePeople | FitAgain


class _File(msgspec.Struct, forbid_unknown_fields=True):
    corrections: list[Correction]


def read_corrections(folder: Path) -> tuple[Correction, ...]:
    """Corrections beside an estimate in the order in which they are made; none without a file.
    InputError where it is damaged.
    """
    path = folder / CORRECTIONS
    if not path.exists():
        return ()
    content = parse_json(load_text(path, _LARGEST_BYTES), path)
    try:
        return tuple(msgspec.convert(content, _File).corrections)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {error}: undo all corrections, or remove the file") from None


def write_corrections(folder: Path, corrections: Sequence[Correction]) -> None:
    """Replaces the corrections beside an estimate; without any there is no file. InputError where
    it cannot be written.
    """
    path = folder / CORRECTIONS
    if corrections:
        text = msgspec.json.format(msgspec.json.encode(_File(list(corrections))), indent=1)
        write_whole(path, text + b"\n")
    else:
        path.unlink(missing_ok=True)
    used = {one.poses for one in corrections if isinstance(one, FitAgain)}
    for file in folder.glob("fitted_again_*.safetensors"):
        if file.name not in used:
            file.unlink()


def corrected_motions(
    motions: Sequence[Motion], corrections: Sequence[Correction], home: Path
) -> list[Motion]:
    """Motions of everybody as corrected: the poses before filter and gaps, which are then applied
    again, so that no filter mixes what was right with what was wrong. InputError where a correction
    does not fit, or leaves somebody without a pose.
    """
    estimated = people = [as_estimated(motion) for motion in motions]
    for correction in corrections:
        people = correction.of(people, home)
    corrected, left = [], _left(corrections)
    for number, (motion, before, poses) in enumerate(
        zip(motions, estimated, people, strict=True), 1
    ):
        if poses is not before:
            done = motion.conditioning
            motion = poses if done is None else conditioned(poses, done)
        if left is not None:
            motion = motion.select(np.flatnonzero(_rows(motion, left)))
        if not len(motion):
            raise InputError("nobody's motion may be left without a pose: choose other frames")
        corrected.append(replace(motion, corrections=_words_of(corrections, number)))
    return corrected


def corrected_summary(
    summary: Mapping[str, Any], corrections: Sequence[Correction], person: int
) -> dict[str, Any]:
    """Contents of a person's summary.json with the frames that are left, and `corrections`: in
    `words`, and of how many frames nothing says how good they are, `unmeasured`.
    """
    words, left, frames = _words_of(corrections, person), _left(corrections), summary["frames"]
    if not words:
        return dict(summary)
    known = frames.get("first", 0), frames.get("last", 0) + 1
    first, stop = known = _common(known, left or known)
    turned = {
        frame
        for one in _of_person(corrections, person)
        if isinstance(one, ExchangeSides)
        for frame in range(*_common(one.frames, known))
    }
    if left is not None:
        missing = {
            name: [frame for frame in frames.get(name, ()) if first <= frame < stop]
            for name in ("lost", "away", "not_filmed")
        }
        posed = stop - first - sum(map(len, missing.values()))
        frames = {**missing, "first": first, "last": stop - 1, "with_pose": posed}
    made = {"words": list(words), "unmeasured": len(turned)}
    return {**summary, "frames": frames, "corrections": made}


def corrected_settings(
    settings: Mapping[str, Any], corrections: Sequence[Correction]
) -> dict[str, Any]:
    """Contents of settings.toml with the frames that are left."""
    frames, left = settings.get("frames"), _left(corrections)
    if frames is None or left is None:
        return dict(settings)
    return {**settings, "frames": [*_common(frames, left)]}


def _words_of(corrections: Sequence[Correction], person: int) -> tuple[str, ...]:
    return tuple(map(str, _of_person(corrections, person)))


def _of_person(corrections: Sequence[Correction], person: int) -> list[Correction]:
    """Those that change a person's motion, or that of one with whom the person is exchanged."""
    people = {person}
    for _ in corrections:
        for one in corrections:
            if isinstance(one, ExchangePeople) and not people.isdisjoint(one.people):
                people.update(one.people)
    return [one for one in corrections if one.is_of(people)]


def _left(corrections: Sequence[Correction]) -> _Range | None:
    """Frames that all trims leave; None: there is none."""
    frames = None
    for one in corrections:
        if isinstance(one, Trim):
            frames = one.frames if frames is None else _common(frames, one.frames)
    return frames


def _common(one: Sequence[int], other: Sequence[int]) -> _Range:
    first, stop = max(one[0], other[0]), min(one[1], other[1])
    return first, max(first, stop)


def _person_of(people: Sequence[Motion], number: int) -> Motion:
    if not 1 <= number <= len(people):
        raise InputError(f"there is no person {number}: this result has {len(people)}")
    return people[number - 1]


def _rows(motion: Motion, frames: _Range) -> BoolArray:
    return (motion.frames >= frames[0]) & (motion.frames < frames[1])


def _replaced(motion: Motion, other: Motion, frames: _Range) -> Motion:
    """A motion that is another in a range of frames, with its own body, where the other's joints
    are nearest to it.
    """
    inside = other.select(np.flatnonzero(_rows(other, frames)))
    same = replace(inside, model=motion.model, unfiltered=None).standing_at(inside.landmarks())
    rest = motion.select(np.flatnonzero(~_rows(motion, frames)))
    order = np.argsort(np.concatenate([rest.frames, same.frames]))
    names = ("root_m", "root_quaternion", "angles_rad", "frames", "time_s", "filled")
    joined = {
        name: np.concatenate([getattr(rest, name), getattr(same, name)])[order] for name in names
    }
    new = np.concatenate([np.zeros(len(rest), bool), np.ones(len(same), bool)])[order]
    quality = quality_with_filled(new, rest.quality)  # unknown, unless the other states it, too
    for name, array in quality.items():
        stated = same.quality.get(name)
        if stated is not None and stated.shape[1:] == array.shape[1:]:
            array[new] = stated
    return replace(motion, **joined, quality=quality, unfiltered=None)


def _range_text(frames: _Range) -> str:
    first, last = frames[0], frames[1] - 1
    return f"frame {first}" if first == last else f"frames {first}–{last}"
