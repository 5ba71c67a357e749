"""Export of a motion in several formats at once, whole or not at all, with export.json: how the
files were made, for formats that have no place to say so.
"""

import importlib
import json
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from pathlib import Path

from calib.atomic import replacing, unwritable
from calib.documents import load_text, parse_json
from calib.errors import InputError
from silhouette_core.motion.conditioning import describe_conditioning
from silhouette_core.motion.motion import Motion
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
    motion: Motion, names: Iterable[str], earlier: dict[str, object], path: Path
) -> None:
    """Writes how files were made now, and the entries of earlier ones: rate, frames, filter."""
    entry = {
        "fps": motion.fps,
        "frames": {
            "first": int(motion.frames[0]),
            "last": int(motion.frames[-1]),
            "with_pose": int((~motion.filled).sum()),
        },
        "conditioning": describe_conditioning(motion),
    }
    files = earlier | dict.fromkeys(names, entry)
    text = json.dumps({"voxelpose": __version__, "files": files}, indent=1)
    path.write_text(text + "\n", encoding="utf-8")


# Files of every format, each with the module and the function that write it.
_WRITERS = {
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
FORMATS = tuple(_WRITERS)
"""Formats that are written where none is named."""

_WRITERS["opensim"] = {
    "motion.mot": ("opensim", "write_mot"),
    "opensim_motion.trc": ("opensim", "write_seen"),
    "opensim_static.trc": ("opensim", "write_static"),
    "opensim_markers.xml": ("opensim", "write_marker_set"),
    "opensim_scale.xml": ("opensim", "write_scale_setup"),
    "opensim_ik.xml": ("opensim", "write_ik_setup"),
}


def export_motion(
    motion: Motion, folder: Path | str, formats: Iterable[str] = FORMATS, overwrite: bool = False
) -> list[Path]:
    """Writes a motion in several formats; returns the files' paths, with export.json, which says
    how they were made.

    Args:
        motion: at least one pose.
        folder: folder of the files; it is created if it does not exist.
        formats: names out of `FORMATS`, or `opensim`: TRC, MOT and the setup files of OpenSim. Of a
            body that is no person's, `trc` writes no motion.mot.
        overwrite: whether files of the same names are replaced.

    Raises:
        InputError: a format is unknown or does not fit the body, the motion has no pose, a file
            exists, or the folder cannot be written to.
    """
    folder, files = Path(folder), {}
    for name in formats:
        if name == "fbx":
            raise InputError(
                "there is no format 'fbx': export glb and turn it into FBX in Blender"
                " (docs/exports.md#fbx-through-blender)"
            )
        if name not in _WRITERS:
            raise InputError(f"there is no format {name!r}: the formats are {', '.join(_WRITERS)}")
        if name == "opensim" and motion.model.person is None:
            raise InputError("OpenSim's model is a person, this body is none: export trc instead")
        files |= _WRITERS[name]
    if motion.model.person is None:
        files.pop("motion.mot", None)  # coordinates of a person's joints
    if not len(motion):
        raise InputError("no frame of this result has a pose: there is nothing to export")
    if not overwrite:
        for name in files:
            if (folder / name).exists():
                raise InputError(
                    f"{folder / name} exists: give --out another folder, or add --overwrite"
                )
    earlier = read_export_record(folder)
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as complete:
            for name, (module, function) in files.items():
                writer = getattr(importlib.import_module(f"voxelpose.export.{module}"), function)
                writer(motion, complete.enter_context(replacing(folder / name)))
            record = complete.enter_context(replacing(folder / EXPORT_RECORD))
            write_export_record(motion, files, earlier, record)
    except OSError as error:
        raise unwritable(folder, error) from error
    finally:
        if made:
            with suppress(OSError):  # it holds something
                folder.rmdir()
    return [folder / name for name in (*files, EXPORT_RECORD)]
