"""A person's body by what a user calls it: a preset's name, a body file, or an earlier result."""

from __future__ import annotations

from pathlib import Path

from calib.errors import InputError
from silhouette_core.body.body_file import read_body
from silhouette_core.body.model import BodyModel
from silhouette_core.body.presets import body_preset, body_presets
from silhouette_core.motion.motion_file import body_of_motion


def load_body(spec: str) -> BodyModel:
    """The body that a text names.

    Args:
        spec: name of a preset; else the path of a body.toml, of a result folder, or of its
            motion.safetensors.

    Raises:
        InputError: there is no such body, or its file cannot be read.
    """
    preset = body_preset(spec)
    if preset is not None:
        return preset.body()
    path = Path(spec)
    if not path.exists():
        names = ", ".join(preset.name for preset in body_presets())
        raise InputError(
            f"there is no body {spec}: give one of {names}; or a body.toml, or an earlier result"
        )
    return read_body(path) if path.suffix.lower() == ".toml" else body_of_motion(path)


def resolved_body(spec: str) -> str:
    """The same text with a path made absolute, as settings keep it."""
    return spec if body_preset(spec) is not None else str(Path(spec).resolve())
