"""A body by what a user calls it: a preset's name, a body file, a rig, or an earlier result."""

from collections.abc import Callable
from pathlib import Path

from calib.errors import InputError
from calib.storage.documents import load_text, parse_toml
from silhouette_core.body.body_file import read_body
from silhouette_core.body.model import BodyModel
from silhouette_core.body.presets import body_preset, body_presets
from silhouette_core.body.rigs.rig_dofs import LARGEST_TABLE
from silhouette_core.body.rigs.rig_formats import RIG_SUFFIXES, is_makehuman, read_rig_body
from silhouette_core.motion.motion_file import body_of_motion

_TOML = ".toml"


def load_body(spec: str, say: Callable[[str], None] = lambda line: None) -> BodyModel:
    """The body that a text names. Raises InputError where there is no such body, or its file cannot
    be read.

    Args:
        spec: name of a preset; else the path of a body.toml, of a rig as `read_rig_body` takes it,
            of a result folder, or of its motion.safetensors.
        say: receives a line about everything that is left out of a rig.
    """
    preset = body_preset(spec)
    if preset is not None:
        return preset.body()
    path = Path(spec)
    if not path.exists():
        names = ", ".join(preset.name for preset in body_presets())
        raise InputError(
            f"there is no body {spec}: give one of {names}; or a body.toml, a rig, or an earlier"
            " result"
        )
    if _is_rig(path) or path.suffix.lower() == ".fbx":  # refused there, with a remedy
        return read_rig_body(path, say)
    return read_body(path) if path.suffix.lower() == _TOML else body_of_motion(path)


def _is_rig(path: Path) -> bool:
    if path.is_dir():
        return is_makehuman(path)
    if path.suffix.lower() == _TOML:
        return "makehuman" in parse_toml(load_text(path, LARGEST_TABLE), path)
    return path.suffix.lower() in RIG_SUFFIXES


def names_result(spec: str) -> bool:
    """Whether the text names an earlier result, whose body wears the clothes of its recording."""
    path = Path(spec)
    return body_preset(spec) is None and not _is_rig(path) and path.suffix.lower() != _TOML


def resolved_body(spec: str) -> str:
    """The same text with a path made absolute, as settings keep it."""
    return spec if body_preset(spec) is not None else str(Path(spec).resolve())
