"""export.json: how the files of an export were made, for formats that have no place to say so."""

import json
from collections.abc import Iterable
from pathlib import Path

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
    """Writes for each file the frame rate, the frames, filter and filling of gaps.

    Args:
        motion: at least one pose.
        names: files that were written now.
        earlier: entries of other files of the folder, which are kept.
    """
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
