"""Result folders, which are written whole or not at all."""

from __future__ import annotations

import json
import math
import shutil
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from calib.files import read_rig
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import MOTION, read_motion
from voxelpose.atomic import is_disk_full, unwritable
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


class ResultWriter:
    """Context manager of a folder that is written whole or not at all.

    with ResultWriter(out) as folder:
        (folder / "joints.csv").write_text(...)

    Inside the block, `folder` is a new folder beside `out`. It is renamed to `out` when the block
    ends, and removed when the block raises, KeyboardInterrupt included. A full disk is reported as
    an InputError.

    Attributes:
        out: the folder to be written.
    """

    def __init__(
        self, out: Path | str, overwrite: bool = False, keep_out_of: Path | None = None
    ) -> None:
        """Checks where the results are to be written, before any work is done.

        Args:
            out: the folder to be written.
            overwrite: whether an earlier result of this name is replaced, once the new one is
                complete.
            keep_out_of: a folder in which the results must not lie: the recording.

        Raises:
            InputError: `out` exists and must not be replaced, or cannot be made.
        """
        self.out = Path(out)
        target = self.out.resolve()
        if keep_out_of is not None and (
            target == keep_out_of.resolve() or keep_out_of.resolve() in target.parents
        ):
            raise InputError(
                f"{self.out} lies in the recording {keep_out_of}: give --out another place"
            )
        if self.out.is_symlink() or (self.out.exists() and not self.out.is_dir()):
            raise InputError(f"{self.out} exists and is not a folder: give --out another name")
        if self.out.exists() and any(self.out.iterdir()):
            if not overwrite:
                raise InputError(
                    f"{self.out} exists: give --out another name, or add --overwrite to replace it"
                )
            if not is_result(self.out):
                raise InputError(
                    f"{self.out} exists and is not a result of voxelpose, so it is not overwritten:"
                    " give --out another name"
                )

    def __enter__(self) -> Path:
        target = self.out.resolve()
        self._made = [parent for parent in target.parents if not parent.exists()]
        self._partial = target.with_name(f"{target.name}.partial-{uuid.uuid4().hex[:8]}")
        try:
            self._partial.mkdir(parents=True)
        except OSError as error:
            raise unwritable(self.out, error) from error
        return self._partial

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if error is None:
            try:
                self._rename()
                return
            except OSError as failed:
                error = failed
        shutil.rmtree(self._partial, ignore_errors=True)
        for parent in self._made:
            try:
                parent.rmdir()
            except OSError:
                break
        if isinstance(error, OSError) and is_disk_full(error):
            raise unwritable(self.out, error) from error
        if kind is None:
            raise error

    def _rename(self) -> None:
        target = self.out.resolve()
        if not target.exists():
            self._partial.rename(target)
            return
        old = self._partial.with_name(self._partial.name.replace(".partial-", ".old-"))
        target.rename(old)
        try:
            self._partial.rename(target)
        except OSError:
            old.rename(target)
            raise
        shutil.rmtree(old, ignore_errors=True)
