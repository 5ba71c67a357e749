"""TOML in aniposelib's layout, written by aniposelib, Pose2Sim, FreeMoCap and Caliscope.

One table per camera: name, size [w, h], matrix, distortions, rotation (world to camera),
translation, optionally fisheye; then `[metadata]`. The variants that are read:

- aniposelib and FreeMoCap name tables cam_0, cam_1 ... with the camera's own name in `name`, and
  omit `fisheye` if false;
- Pose2Sim names tables after cameras and writes sizes as floats;
- Caliscope has `[cameras.N]` or `[cam_N]` with `port` or `cam_id` in place of `name`, the rotation
  as a 3x3 matrix, none and no translation for a camera that is not located yet, `ignore = true`
  for excluded cameras, and tables of its own.

None of them states a unit; ours is `[metadata] unit = "m"`. Tables without any camera key, and
unknown keys, are ignored. On writing, tables are named after cameras and rotations are
Rodrigues vectors, as aniposelib expects.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from calib.camera import Rig
from calib.checks import FloatArray
from calib.errors import InputError
from calib.files.fields import Source, camera_values
from calib.rotation import rodrigues_from_matrix
from calib.storage.documents import load_text, parse_toml
from calib.upright import direction_of

_CAMERA_KEYS = {"matrix", "distortions", "rotation", "translation"}
_REMEDY = 'add [metadata] unit = "m"'


def read_anipose(source: Source) -> Rig:
    """Reads the rig. InputError where the file is not TOML, or a camera in it is incomplete or
    wrong.
    """
    text = load_text(source.path)
    try:
        content = parse_toml(text, source.path)
    except InputError as error:
        raise InputError(f"{error} (nor is it another calibration that is known here)") from None
    tables = dict(content)
    nested = tables.pop("cameras", None)
    if isinstance(nested, dict):
        tables |= {f"cam_{key}" if key.isdigit() else key: value for key, value in nested.items()}
    cameras = {
        key: table
        for key, table in tables.items()
        if isinstance(table, dict) and _CAMERA_KEYS & table.keys() and not table.get("ignore")
    }
    if not cameras:
        return source.rig([])
    metadata = _metadata(content)
    stated = metadata.get("unit", metadata.get("units"))
    lengths = stated or any("translation" in table for table in cameras.values())
    metres = source.metres_per_unit(stated, _REMEDY) if lengths else 1
    return source.rig(
        [
            source.camera(str(table.get("name", key)), table, metres)
            for key, table in cameras.items()
        ]
    )


def write_anipose(rig: Rig, path: Path, notes: Mapping[str, Any] | None = None) -> None:
    """Writes the rig in metres, and notes under [metadata]."""
    import tomlkit

    document = tomlkit.document()
    for camera in rig:
        # aniposelib requires at least one distortion number, and Rodrigues vectors.
        document[camera.name] = camera_values(camera) | {
            "distortions": camera.distortion.tolist() or [0.0] * 5,
            "rotation": rodrigues_from_matrix(camera.rotation).tolist(),
        }
    document["metadata"] = {"unit": "m", **(notes or {})}
    path.write_text(tomlkit.dumps(document), encoding="utf-8")


def read_notes(path: Path) -> dict[str, Any]:
    """Entries under [metadata] of a calibration, without the unit; empty if there are none."""
    try:
        content = parse_toml(load_text(path), path)
    except InputError:  # a calibration of another format
        return {}
    entries = _metadata(content).items()
    return {key: value for key, value in entries if key not in ("unit", "units")}


def _metadata(content: Mapping[str, Any]) -> dict[str, Any]:
    metadata = content.get("metadata")
    return metadata if isinstance(metadata, dict) else {}


def read_up(path: Path) -> FloatArray | None:
    """Direction of up (3,) in the world as `[metadata] up` states it; None if it does not.
    InputError where it is neither an axis nor three numbers.
    """
    stated = read_notes(path).get("up")
    if stated is None:
        return None
    text = ",".join(map(str, stated)) if isinstance(stated, list) else str(stated)
    return direction_of(text, where=f"{path}: [metadata] ")
