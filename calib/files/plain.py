"""Plain JSON, for scripts: `{"unit": "m", "cameras": [{...}, ...]}` with the keys of the TOML
layout and the rotation as a matrix.
"""

import json
from pathlib import Path
from typing import Any

from calib.camera import Rig
from calib.documents import LARGEST_CALIBRATION, load_text, parse_json
from calib.files.fields import Source, camera_values


def read_json(source: Source) -> Rig:
    """Reads the rig; `cameras` may also be a map from names to cameras.

    Raises:
        InputError: A camera is incomplete or wrong.
    """
    text = load_text(source.path, LARGEST_CALIBRATION)
    content: dict[str, Any] = parse_json(text, source.path)
    cameras = content["cameras"]
    named = (
        list(cameras.items())
        if isinstance(cameras, dict)
        else list(enumerate(cameras))
        if isinstance(cameras, list)
        else []
    )
    if not all(isinstance(values, dict) for _, values in named):
        raise source.error(
            "cameras must be a list of objects with name, size, matrix, distortions, rotation and"
            " translation"
        )
    metres = source.metres_per_unit(content.get("unit"), 'add "unit": "m"')
    return source.rig(
        [source.camera(str(values.get("name", key)), values, metres) for key, values in named]
    )


def write_json(rig: Rig, path: Path) -> None:
    """Writes the rig in metres."""
    content = {"unit": "m", "cameras": [camera_values(camera) for camera in rig]}
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
