"""Result folders, which are written whole or not at all."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.atomic_folder import FolderWriter
from calib.camera import Rig
from calib.errors import InputError
from calib.files import read_rig
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import MOTION, read_motion
from voxelpose.result_schema import load_settings, load_summary

SUMMARY = "summary.json"
CALIBRATION = "calibration.toml"
SETTINGS = "settings.toml"
_MARK = "voxelpose"  # key of summary.json that marks a folder as a result


@dataclass(frozen=True, eq=False)
class Result:
    """Result of a fit, read from its folder.

    Attributes:
        folder: the result folder.
        motion: the poses, with their body.
        rig: the cameras.
        summary: contents of summary.json: version, frames, timings, quality.
        settings: contents of settings.toml: the settings of the fit.
    """

    folder: Path
    motion: Motion
    rig: Rig
    summary: Mapping[str, object]
    settings: Mapping[str, object]

    @classmethod
    def open(cls, folder: Path | str) -> Result:
        """Reads a result folder.

        Args:
            folder: the folder, as given to `fit --out`.

        Raises:
            InputError: the folder is not a result, or a file in it is damaged.
        """
        folder = Path(folder)
        if not is_result(folder):
            raise InputError(
                f"{folder} is not a result of voxelpose (it has no {SUMMARY} of ours): give the"
                " folder of a fit"
            )
        summary, settings = load_summary(folder / SUMMARY), load_settings(folder / SETTINGS)
        return cls(
            folder, read_motion(folder / MOTION), read_rig(folder / CALIBRATION), summary, settings
        )


def is_result(folder: Path) -> bool:
    """Whether a folder was written by voxelpose."""
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return isinstance(summary, dict) and _MARK in summary


def as_json(document: Mapping[str, object]) -> str:
    """Returns a document as JSON text; numbers that are not finite become null.

    Args:
        document: mappings, sequences, NumPy arrays, numbers and text.
    """
    return json.dumps(_plain(document), indent=1, allow_nan=False) + "\n"


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class ResultWriter(FolderWriter):
    """Context manager of a result folder, which is written whole or not at all."""

    def __init__(
        self, out: Path | str, overwrite: bool = False, keep_out_of: Path | None = None
    ) -> None:
        """Checks where the results are to be written, before any work is done.

        Args:
            overwrite: whether an earlier result of this name is replaced, once the new one is
                complete.
            keep_out_of: a folder in which the results must not lie: the recording.

        Raises:
            InputError: `out` exists and must not be replaced, or cannot be made.
        """
        target = Path(out).resolve()
        if keep_out_of is not None and target.is_relative_to(keep_out_of.resolve()):
            raise InputError(f"{out} lies in the recording {keep_out_of}: give --out another place")
        super().__init__(out, overwrite, is_result)
