"""Digests of what a recording says beside its pictures, which tell what changed since a fit."""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.storage.documents import LARGEST_SETTINGS, load_text, parse_toml
from silhouette_core.estimator import ONE_CAMERA
from voxelpose.recording.folder import Recording
from voxelpose.recording.subject import NOTES, nearest_settings
from voxelpose.recording.timestamps import TIMESTAMPS


def input_digests(recording: Recording, estimator: str) -> dict[str, str]:
    """Digests of calibration, timestamps, regions, unknown places and settings, by these names.
    InputError where a file cannot be read.

    Regions and unknown places count as they are read, of the cameras in use; settings as the
    nearest files give them for the command that runs the estimator.
    """
    calibration = recording.calibration_path
    files = [] if calibration is None else [calibration, *sorted(calibration.rglob("*"))]
    return {
        "calibration": _digest(path.read_bytes() for path in files if path.is_file()),
        "timestamps": _digest(path.read_bytes() for path in recording.folder.glob(TIMESTAMPS)),
        "regions": _of_masks(recording.regions()),
        "unknown places": _of_masks(recording.unknown()),
        "settings": _of_settings(recording.folder, "track" if estimator in ONE_CAMERA else "fit"),
    }


def changes_since(noted: Mapping[str, str], recording: Recording, estimator: str) -> str:
    """A sentence that names what changed since digests were noted; empty where nothing did.
    InputError where a file cannot be read.
    """
    now = input_digests(recording, estimator)
    names = [name for name, digest in noted.items() if now.get(name, digest) != digest]
    if not names:
        return ""
    return f"changed in the recording since the fit, which knew them otherwise: {', '.join(names)}"


def _digest(parts: Iterable[bytes]) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for part in parts:
        digest.update(len(part).to_bytes(8, "big") + part)
    return digest.hexdigest()


def _of_masks(masks: Mapping[str, NDArray[np.bool_]]) -> str:
    named = ((name.encode(), np.packbits(masks[name]).tobytes()) for name in sorted(masks))
    return _digest(part for pair in named for part in pair)


def _of_settings(folder: Path, section: str) -> str:
    """Digest of measures in subject.toml and of a command's section of the files voxelpose.toml."""
    listed = nearest_settings(
        folder, lambda file: parse_toml(load_text(file, LARGEST_SETTINGS), file).get(section, {})
    )
    settings: dict[str, Any] = {name: value for name, (value, _) in listed.items()}
    for file in folder.glob("subject.toml"):
        subject = parse_toml(load_text(file, LARGEST_SETTINGS), file)
        # Remarks that are added after a fit leave it as it is.
        if measures := {key: value for key, value in subject.items() if key not in NOTES}:
            settings["subject"] = measures
    return _digest([json.dumps(settings, sort_keys=True, default=str).encode()])
