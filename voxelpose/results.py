"""Result folders, which are written whole or not at all."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from calib.camera import Rig
from calib.errors import InputError
from calib.files import read_rig
from calib.storage.atomic import FolderWriter
from calib.storage.documents import load_text, parse_json, parse_toml
from silhouette_core.estimator import Settings
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import MOTION, read_motion
from silhouette_core.setting_types import Chest, Sex, Stature, Tolerance, VoxelSize
from voxelpose.corrections import (
    CORRECTIONS,
    Correction,
    corrected_motions,
    corrected_settings,
    corrected_summary,
    read_corrections,
    write_corrections,
)
from voxelpose.findings import Finding
from voxelpose.people_marks import person_names
from voxelpose.reliability import Verdict

_LARGEST_BYTES = 50_000_000  # a million lost frames take a fifth of it
_MOST_FRAMES = 10_000_000
_REMEDY = "fit again, or put the file back as the program wrote it"

_Number = Annotated[float, Meta(ge=-(10**9), le=10**9)]
_Positive = Annotated[float, Meta(gt=0, le=10**6)]
_Seconds = Annotated[float, Meta(ge=0, le=10**9)]
_Count = Annotated[int, Meta(ge=0, le=_MOST_FRAMES)]
_Name = Annotated[str, Meta(max_length=1000, pattern="^[^\\x00]*$")]
_Names = Annotated[list[_Name], Meta(min_length=1, max_length=1000)]
_Up = Annotated[list[_Number], Meta(min_length=3, max_length=3)]
_Schema = TypeVar("_Schema")
SUMMARY = "summary.json"
CALIBRATION = "calibration.toml"
SETTINGS = "settings.toml"
FILES = {
    "contact_sheet.png": "look here first: the fitted body over frames of every camera",
    "overlay_*.webm": "the fitted body over the videos, for every browser and player",
    "joints.csv": "positions of the joints, metres, with a confidence",
    "motion.bvh": "the skeleton for Blender, Maya, MotionBuilder, Unity",
    "motion.safetensors": "joint angles, root and quality, for programs",
    "hypotheses.csv": "other poses that one camera leaves open, with their probabilities",
    "summary.json": "quality and timings, for programs",
    "settings.toml": "settings of the fit",
    "calibration.toml": "the cameras that were used",
    CORRECTIONS: "corrections by hand, which all but the files above have",
}
"""What is in a result, by names, with * for a camera's."""
_MARK = "voxelpose"  # key of summary.json that marks a folder as a result


class _Frames(msgspec.Struct):
    with_pose: _Count
    lost: list[_Count]
    away: list[_Count] = []  # in which the person is not there
    not_filmed: list[_Count] = []  # by every camera; of older results counted as lost
    first: _Count = 0
    last: _Count = 0


class _Body(msgspec.Struct):
    stature_m: Stature | None = None
    chest_girth_m: Chest | None = None
    sex: Sex = "unknown"
    parts: _Count | None = None  # of a body that is not made from a person's measurements
    extent_m: _Positive | None = None


class _Stage(msgspec.Struct):
    sum: _Seconds
    min: _Seconds | None = None
    median: _Seconds | None = None
    max: _Seconds | None = None
    mean: _Seconds | None = None  # none until 2026-11


class _Spent(msgspec.Struct):
    total: _Seconds
    pictures: _Seconds
    stages: dict[_Name, _Stage]


class _Facts(msgspec.Struct):
    seams_mm: list[_Number | None] = []
    half_turn_ratio: _Number | None = None
    fastest_turn: tuple[_Number, _Count] | None = None
    objects_share: dict[_Name, _Number] = {}
    objects_apart: bool = False
    frames_merged: _Count = 0
    unexplained_frames: _Number | None = None
    moving_cameras: list[_Name] = []
    by_texture: dict[_Name, _Number | None] = {}
    stature_given: bool = True
    late_frames: dict[_Name, Annotated[int, Meta(ge=-_MOST_FRAMES, le=_MOST_FRAMES)]] = {}


class _Conditioned(msgspec.Struct):
    frames_filled: list[_Count] = []
    frames_left: _Count = 0
    frames_unfiltered: _Count = 0
    words: Annotated[str, Meta(max_length=1000)] = ""


class _Summary(msgspec.Struct):
    voxelpose: _Name
    estimator: _Name
    recording: _Name
    fps: _Positive
    cameras: _Names
    frames: _Frames
    body: _Body
    quality: dict[_Name, dict[_Name, _Number | None]]
    seconds: _Spent
    up: _Up | None = None
    floor_m: _Number | None = None
    facts: _Facts = msgspec.field(default_factory=_Facts)
    conditioning: _Conditioned = msgspec.field(default_factory=_Conditioned)
    verdict: Verdict | None = None
    findings: list[Finding] = []  # none until 2026-12
    inputs: dict[_Name, _Name] = {}  # digests; none until 2026-11


class _Total(msgspec.Struct):
    total: _Seconds
    pictures: _Seconds = 0.0


class _Index(msgspec.Struct):  # of several people's results
    people: dict[_Name, Any]
    seconds: _Total


class _Options(msgspec.Struct):
    voxel_size_m: VoxelSize | None = None
    tolerance: Tolerance | None = None
    body: _Name = ""


@dataclass(frozen=True)
class _Recorded(Settings):
    """Settings of an estimation, and of what."""

    recording: _Name = ""
    frames: Annotated[list[_Count], Meta(min_length=2, max_length=2)] | None = None
    cameras: _Names | None = None
    estimator: _Name = ""
    label: _Name | None = None
    options: _Options = field(default_factory=_Options)  # type: ignore[assignment]


def load_summary(path: Path) -> dict[str, Any]:
    """Contents of summary.json, with `facts` in any case, and as corrected by hand.

    Raises:
        InputError: it is no JSON, or lacks an entry, or one is impossible; the message names it.
    """
    content = parse_json(load_text(path, _LARGEST_BYTES), path)
    _checked(content, _Summary, path)
    body = content["body"]
    if body.get("stature_m") is None and body.get("parts") is None:
        raise InputError(f"{path}: body lacks stature_m: {_REMEDY}")
    for kind, ranges in (
        ("quality", content["quality"]),
        ("seconds.stages", content["seconds"]["stages"]),
    ):
        for name, values in ranges.items():
            three = [values.get(key) for key in ("min", "median", "max")]
            if "median" in values and None in three:
                raise InputError(f"{path}: {kind}.{name[:60]} lacks min, median or max: {_REMEDY}")
    # A fact that could not be measured is null in the file, and for its readers not there.
    facts = content.get("facts", {})
    content["facts"] = {name: value for name, value in facts.items() if value is not None}
    home, person = corrections_home(path.parent)
    return corrected_summary(content, read_corrections(home), person)


def load_settings(path: Path) -> dict[str, Any]:
    """Contents of settings.toml.

    Raises:
        InputError: it is no TOML, or an entry is impossible; the message names it.
    """
    content = parse_toml(load_text(path, _LARGEST_BYTES), path)
    known = _checked(content, _Recorded, path)
    if known.frames is not None and known.frames[0] > known.frames[1]:
        raise InputError(f"{path}: frames {known.frames} end before they begin: {_REMEDY}")
    tolerance = known.options.tolerance or 0
    if known.cameras is not None and tolerance > max(2, 3 * len(known.cameras) // 4):
        raise InputError(
            f"{path}: options.tolerance {tolerance} is more than {len(known.cameras)} cameras"
            f" allow: {_REMEDY}"
        )
    if any(len(part.encode()) > 255 for part in Path(known.recording).parts):
        raise InputError(f"{path}: recording is no folder's name: {_REMEDY}")
    return content


def _checked(content: Any, schema: type[_Schema], path: Path) -> _Schema:
    try:
        return msgspec.convert(content, schema)
    except (msgspec.ValidationError, OverflowError, InputError) as error:
        reason = " ".join(str(error).replace("`", "").replace("$.", "").split())
        raise InputError(f"{path}: {reason[:300]}: {_REMEDY}") from None


@dataclass(frozen=True, eq=False)
class Result:
    """Result of a fit, read from its folder, as corrected by hand."""

    folder: Path  #: the result folder.
    motion: Motion  #: the poses, with their body.
    rig: Rig  #: the cameras.
    summary: Mapping[str, object]  #: contents of summary.json: version, frames, timings, quality.
    settings: Mapping[str, object]  #: contents of settings.toml: the settings of the fit.

    @classmethod
    def open(cls, folder: Path | str) -> Result:
        """Reads a result folder, as given to `fit --out`.

        Raises:
            InputError: the folder is not a result, or a file in it is damaged.
        """
        folder = Path(folder)
        if not is_result(folder):
            raise InputError(
                f"{folder} is not a result of voxelpose (it has no {SUMMARY} of ours): give the"
                " folder of a fit"
            )
        if names := _people_of(folder):
            raise InputError(
                f"{folder} holds the results of {len(names)} people: give one of them, as"
                f" {folder / names[0]}"
            )
        home, person = corrections_home(folder)
        corrections = read_corrections(home)
        together = people_folders(home) if corrections else [folder]  # they may be exchanged
        motions = corrected_motions(
            [read_motion(one / MOTION) for one in together], corrections, home
        )
        return cls(
            folder,
            motions[person - 1 if corrections else 0],
            read_rig(folder / CALIBRATION),
            load_summary(folder / SUMMARY),
            corrected_settings(load_settings(folder / SETTINGS), corrections),
        )


def open_people(folder: Path | str) -> list[Result]:
    """Results of everybody in a folder of `fit`: of one person, or of several.

    Raises:
        InputError: as `Result.open`.
    """
    return [Result.open(one) for one in people_folders(Path(folder))]


def corrections_home(folder: Path) -> tuple[Path, int]:
    """The folder beside whose results the corrections of one are kept, since several people share
    them, and the person's number.
    """
    place = folder.resolve()
    names = _people_of(place.parent)
    return (place.parent, 1 + names.index(place.name)) if place.name in names else (folder, 1)


def correct(folder: Path, corrections: Sequence[Correction]) -> None:
    """Replaces the corrections of a result, of one person or of several. InputError where it is
    none, a correction does not fit, or the file cannot be written.
    """
    motions = [read_motion(one / MOTION) for one in people_folders(folder)]
    corrected_motions(motions, corrections, folder)
    write_corrections(folder, corrections)


def is_corrected(folder: Path) -> bool:
    """Whether a result in a folder, or below it, is corrected by hand."""
    return any(True for _ in folder.rglob(CORRECTIONS))


def names_of(results: Sequence[Result]) -> list[str]:
    """Names of people, as they were told, else as of their folders; of one alone that is known."""
    known: list[Any] = [one.settings.get("people") or [{}] for one in results]
    given = [str(people[0].get("name", "")) for people in known]
    usual = person_names(len(results)) if len(results) > 1 else [""]
    return [name or number for name, number in zip(given, usual, strict=True)]


def people_folders(folder: Path) -> list[Path]:
    """Folders of the results in a folder of `fit`: itself, or those of several people."""
    return [folder / name for name in _people_of(folder) or [""]]


def holds_people(folder: Path) -> bool:
    """Whether a folder holds the results of several people."""
    return bool(_people_of(folder))


def people_seconds(folder: Path) -> dict[str, float]:
    """How long several people's results took, s: `total`, of which `pictures`.

    Raises:
        InputError: the folder has no index of several people, or it is damaged.
    """
    path = folder / SUMMARY
    seconds = _checked(parse_json(load_text(path, _LARGEST_BYTES), path), _Index, path).seconds
    return msgspec.to_builtins(seconds)


def _people_of(folder: Path) -> list[str]:
    """Names of the folders in which the results of several people are; none of one person's."""
    try:
        people = parse_json(load_text(folder / SUMMARY, _LARGEST_BYTES), folder / SUMMARY)["people"]
        names = [*msgspec.convert(people, dict[str, Any])]
    except (InputError, KeyError, TypeError, msgspec.ValidationError):
        return []
    return names if names == person_names(len(names)) else []


def is_result(folder: Path) -> bool:
    """Whether a folder was written by voxelpose."""
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(summary, dict) and _MARK in summary


def as_json(document: Mapping[str, object]) -> str:
    """Returns mappings, arrays, numbers and text as JSON; what is not finite becomes null."""
    return json.dumps(_json_value(document), indent=1, allow_nan=False) + "\n"


def _json_value(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _json_value(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class ResultWriter(FolderWriter):
    """Context manager of a result folder, which is written whole or not at all."""

    def __init__(
        self, out: Path | str, overwrite: bool = False, keep_out_of: Path | None = None
    ) -> None:
        """Checks where it is to be written, see `FolderWriter`; not in the folder `keep_out_of`,
        the recording. InputError where that cannot be.
        """
        target = Path(out).resolve()
        if keep_out_of is not None and target.is_relative_to(keep_out_of.resolve()):
            raise InputError(f"{out} lies in the recording {keep_out_of}: give --out another place")
        super().__init__(out, overwrite, is_result)

    def _check(self, out: Path) -> None:
        """Refuses to replace work by hand, too, whenever it was done."""
        super()._check(out)
        if is_corrected(out):
            raise InputError(
                f"{out} is corrected by hand, which would be lost: choose another name, or take the"
                f" corrections back with `voxelpose correct {out} --undo all`"
            )
