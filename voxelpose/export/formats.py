"""Export of a motion in several formats at once, whole or not at all, with export.json: how the
files were made, for formats that have no place to say so.
"""

import importlib
import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from calib.errors import InputError
from calib.storage.atomic import replacing, writing
from calib.storage.documents import load_text, parse_json
from silhouette_core.motion.conditioning import describe_conditioning
from silhouette_core.motion.motion import Motion
from silhouette_core.setting_types import SkeletonName, checked
from voxelpose.export.excerpt import Excerpt
from voxelpose.export.fbx import FBX, SCRIPT, make_fbx
from voxelpose.export.player_scene import Stage
from voxelpose.export.rigged import rigged
from voxelpose.people_marks import person_names
from voxelpose.version import __version__

EXPORT_RECORD = "export.json"
_LARGEST_BYTES = 100_000_000


def read_export_record(folder: Path) -> dict[str, object]:
    """Entries by file name of a folder's export.json; empty where there is none.

    Raises:
        InputError: a file of that name is none of ours.
    """
    path = folder / EXPORT_RECORD
    if not path.is_file():
        return {}
    try:
        return dict(parse_json(load_text(path, _LARGEST_BYTES), path)["files"])
    except (InputError, KeyError, TypeError, ValueError):
        raise InputError(
            f"{path} is no record of an export: give --out another folder, or move the file away"
        ) from None


def write_export_record(
    motions: Sequence[Motion],
    names: Iterable[str],
    earlier: dict[str, object],
    path: Path,
    excerpt: Excerpt,
) -> None:
    """Writes how files were made now, and the entries of earlier ones: rate, frames, filter, what
    was corrected and an excerpt changed; of files of several people an entry of each under their
    names.
    """
    entries = [
        {
            "fps": motion.fps,
            "frames": {
                "first": int(motion.frames[0]),
                "last": int(motion.frames[-1]),
                "with_pose": int((~motion.filled).sum()),
            },
            "conditioning": describe_conditioning(motion),
            "corrections": list(motion.corrections),
            **excerpt.facts(motion),
        }
        for motion in motions
    ]
    people = dict(zip(person_names(len(entries)), entries, strict=True))
    files = earlier | dict.fromkeys(names, people if len(people) > 1 else entries[0])
    text = json.dumps({"voxelpose": __version__, "files": files}, indent=1)
    path.write_text(text + "\n", encoding="utf-8")


# Files of every format, each with the module and the function that write it.
_Files = dict[str, tuple[str, str]]
_WRITERS: dict[str, _Files] = {
    "bvh": {"motion.bvh": ("bvh", "write_bvh")},
    "glb": {"motion.glb": ("gltf", "write_glb")},
    "trc": {"motion.trc": ("trc", "write_trc"), "motion.mot": ("opensim", "write_mot")},
    "c3d": {"motion.c3d": ("c3d", "write_c3d")},
    "csv": {
        "joints.csv": ("tables", "write_joints"),
        "joints_wide.csv": ("tables", "write_wide_joints"),
        "angles.csv": ("tables", "write_angles"),
    },
    "npz": {"motion.npz": ("tables", "write_npz")},
}
# Of several people, what holds them all, instead of a file of each, and beside one.
_PAGE = "motion.html"
_SCENES = "motion.glb", SCRIPT, _PAGE
_OF_ALL: _Files = {
    "motion.glb": ("gltf", "write_glb"),
    SCRIPT: ("fbx", "write_script"),
    _PAGE: ("html_player", "write_html"),
    "joints.csv": ("tables", "write_people_joints"),
}
FORMATS = tuple(_WRITERS)
"""Formats that are written where none is named."""

_RIGGED = "motion.bvh", "motion.glb"  # on the skeleton that is asked for
_WRITERS["html"] = {_PAGE: _OF_ALL[_PAGE]}
_WRITERS["fbx"] = {name: _OF_ALL[name] for name in ("motion.glb", SCRIPT)}
_WRITERS["opensim"] = {
    "motion.mot": ("opensim", "write_mot"),
    "opensim_motion.trc": ("opensim", "write_seen"),
    "opensim_static.trc": ("opensim", "write_static"),
    "opensim_markers.xml": ("opensim", "write_marker_set"),
    "opensim_scale.xml": ("opensim", "write_scale_setup"),
    "opensim_ik.xml": ("opensim", "write_ik_setup"),
}


def export_motion(
    motion: Motion | Sequence[Motion],
    folder: Path | str,
    formats: Iterable[str] = FORMATS,
    overwrite: bool = False,
    stage: Stage | None = None,
    excerpt: Excerpt | None = None,
    notes: list[str] | None = None,
) -> list[Path]:
    """Writes a motion, or those of several people, in several formats; returns the files' paths,
    with export.json, which says how they were made.

    Files of several people are in folders `person_1` and so on, in their order. motion.glb and
    motion.html hold all of them, and so does a second joints.csv, with a column `person`; those are
    in the folder itself.

    Args:
        motion: at least one pose, each.
        folder: folder of the files; it is created if it does not exist.
        formats: names out of `FORMATS`, or `html`, or `opensim`: TRC, MOT and the setup files of
            OpenSim, or `fbx`: GLB and a script, which is run where Blender is. Of a body that is no
            person's, `trc` writes no motion.mot.
        overwrite: whether files of the same names are replaced.
        stage: name and cameras for `html`; None: it shows neither.
        excerpt: frames, rate and skeleton; None: all that there is, as it is.
        notes: receives why Blender made no FBX.

    Raises:
        InputError: a format is unknown or does not fit the body, the motion has no pose, a file
            exists, or the folder cannot be written to.
    """
    excerpt = excerpt or Excerpt()
    motions = [excerpt.of(one) for one in ([motion] if isinstance(motion, Motion) else motion)]
    folder, files = Path(folder), _files_of(formats, motions)
    skeleton = checked(excerpt.skeleton, SkeletonName, "skeleton")
    if skeleton == "vrm" and len(motions) > 1 and "motion.glb" in files:
        raise InputError("a VRM holds one person: choose one of them")
    if stage is not None and excerpt.in_place:
        stage = replace(stage, rig=None)  # which sees the person elsewhere
    if not motions or not all(map(len, motions)):
        raise InputError("no frame of this result has a pose: there is nothing to export")
    plan = _planned(motions, folder, files)
    if not overwrite:
        for place, (_, writers) in plan.items():
            for name in (*writers, *([FBX] if SCRIPT in writers else [])):
                if (place / name).exists():
                    raise InputError(
                        f"{place / name} exists: give --out another folder, or add --overwrite"
                    )
    earlier = {place: read_export_record(place) for place in plan}
    made = [place for place in dict.fromkeys((folder, *plan)) if not place.exists()]
    try:
        with writing(folder), ExitStack() as complete:
            for place, (people, writers) in plan.items():
                place.mkdir(parents=True, exist_ok=True)
                for name, (module, function) in writers.items():
                    module = importlib.import_module(f"voxelpose.export.{module}")
                    path = complete.enter_context(replacing(place / name))
                    more = {"stage": stage} if name == _PAGE else {}
                    bodies = [rigged(one, skeleton) if name in _RIGGED else one for one in people]
                    getattr(module, function)(_one_or_all(bodies), path, **more)
                record = complete.enter_context(replacing(place / EXPORT_RECORD))
                write_export_record(people, writers, earlier[place], record, excerpt)
    finally:
        for place in reversed(made):
            with suppress(OSError):  # it holds something
                place.rmdir()
    paths = [place / name for place, (_, files) in plan.items() for name in (*files, EXPORT_RECORD)]
    for script in [path for path in paths if path.name == SCRIPT]:
        if fault := make_fbx(script.parent):
            (notes if notes is not None else []).append(f"no {FBX} is made: {fault}")
        else:
            paths.append(script.with_name(FBX))
    return paths


def _one_or_all(bodies: list[Any]) -> Any:
    return bodies if len(bodies) > 1 else bodies[0]


def _planned(
    motions: Sequence[Motion], folder: Path, files: _Files
) -> Mapping[Path, tuple[Sequence[Motion], _Files]]:
    """Whose motions go into which files, by the folders that these are in."""
    if len(motions) == 1:
        return {folder: (motions, files)}
    together = {name: writer for name, writer in _OF_ALL.items() if name in files}
    each = {name: writer for name, writer in files.items() if name not in _SCENES}
    plan = {}
    for name, motion in zip(person_names(len(motions)), motions, strict=True):
        plan[folder / name] = [motion], each
    return {place: one for place, one in (plan | {folder: (motions, together)}).items() if one[1]}


def _files_of(formats: Iterable[str], motions: Sequence[Motion]) -> _Files:
    """The files of formats that fit some bodies."""
    files, persons = _Files(), all(motion.model.person is not None for motion in motions)
    for name in formats:
        if name not in _WRITERS:
            raise InputError(f"there is no format {name!r}: the formats are {', '.join(_WRITERS)}")
        if name == "opensim" and not persons:
            raise InputError("OpenSim's model is a person, this body is none: export trc instead")
        files |= _WRITERS[name]
    if not persons:
        files.pop("motion.mot", None)  # coordinates of a person's joints
    return files
