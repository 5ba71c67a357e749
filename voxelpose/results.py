"""Result folders: written beside and renamed at the end, so that a folder is whole or not there."""

from __future__ import annotations

import errno
import json
import math
import shutil
import tomllib
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
from silhouette_core.motion.motion_file import read_motion

SUMMARY = "summary.json"
MOTION = "motion.safetensors"
CALIBRATION = "calibration.toml"
SETTINGS = "settings.toml"
_MARK = "voxelpose"  # the key of summary.json by which a folder is known as ours


@dataclass(frozen=True, eq=False)
class Result:
    """What a fit left behind.

    Attributes:
        folder: where it lies.
        motion: the poses, with their body.
        rig: the cameras.
        summary: summary.json: version, frames, timings, quality.
        settings: settings.toml: what the fit was told.
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
            folder: as given to `fit --out`.

        Raises:
            InputError: it is no result folder, or a file of it is damaged.
        """
        folder = Path(folder)
        if not is_result(folder):
            raise InputError(
                f"{folder} is not a result of voxelpose (no {SUMMARY} of ours in it): give the"
                " folder of a fit"
            )
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        try:
            settings = tomllib.loads((folder / SETTINGS).read_text(encoding="utf-8"))
        except (OSError, tomllib.TOMLDecodeError) as error:
            raise InputError(f"{folder / SETTINGS} cannot be read: {error}") from error
        return cls(
            folder, read_motion(folder / MOTION), read_rig(folder / CALIBRATION), summary, settings
        )


def is_result(folder: Path) -> bool:
    """Says whether a folder was written by voxelpose."""
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(summary, dict) and _MARK in summary


def as_json(document: Mapping[str, object]) -> str:
    """Returns a document as JSON text: NumPy's values as plain ones, what is not finite as null,
    which JSON has no number for.
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
    """A folder that appears whole or not at all.

    with ResultWriter(out) as folder:
        (folder / "joints.csv").write_text(...)

    Inside, `folder` is a new folder beside `out`. When the block ends well it takes out's name;
    when it ends with any exception, KeyboardInterrupt included, it is removed. A full disk becomes
    an InputError.
    """

    def __init__(
        self, out: Path | str, overwrite: bool = False, keep_out_of: Path | None = None
    ) -> None:
        """Looks at where the results are to go, before any work is done.

        Args: out: the folder to be made. overwrite: whether an earlier result of this name is
            replaced (at the end, when the new one is whole). keep_out_of: a folder that the results
            must not lie in: the recording.

        Raises:
            InputError: `out` exists and is not to be replaced, or cannot be made.
        """
        self.out = Path(out)
        whole = self.out.resolve()
        if keep_out_of is not None and (
            whole == keep_out_of.resolve() or keep_out_of.resolve() in whole.parents
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
        whole = self.out.resolve()
        self._made = [parent for parent in whole.parents if not parent.exists()]
        self.folder = whole.with_name(f"{whole.name}.partial-{uuid.uuid4().hex[:8]}")
        try:
            self.folder.mkdir(parents=True)
        except OSError as error:
            raise InputError(f"{self.out} cannot be made: {error.strerror or error}") from error
        return self.folder

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
        shutil.rmtree(self.folder, ignore_errors=True)
        for parent in self._made:
            try:
                parent.rmdir()
            except OSError:
                break
        if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
            raise InputError(
                f"the disk is full: {self.out} was not written; free some space or give --out"
                " another disk"
            ) from error
        if kind is None:
            raise error

    def _rename(self) -> None:
        whole = self.out.resolve()
        if not whole.exists():
            self.folder.rename(whole)
            return
        old = self.folder.with_name(self.folder.name.replace(".partial-", ".old-"))
        whole.rename(old)
        try:
            self.folder.rename(whole)
        except OSError:
            old.rename(whole)
            raise
        shutil.rmtree(old, ignore_errors=True)
