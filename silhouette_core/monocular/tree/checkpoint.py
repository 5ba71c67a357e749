"""Checkpoints of a library build, so that an interrupted build resumes."""

import json
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from calib.atomic import write_whole
from calib.errors import InputError

Arrays = Mapping[str, NDArray]
_INPUTS = "inputs.json"
_INPUTS_OF_STEP = "inputs"


class Checkpoint:
    """Folder of the finished steps of a build; steps of other inputs do not count."""

    def __init__(self, folder: Path | None, inputs: str) -> None:
        """Opens or creates the folder.

        Args:
            folder: the folder; None: no checkpoints.
            inputs: digest of everything that determines the result.

        Raises:
            InputError: the folder cannot be made, or holds other files.
        """
        self.folder = folder
        self._inputs = np.frombuffer(inputs.encode(), np.uint8)
        if folder is None:
            return
        try:
            if folder.exists() and _inputs(folder) != inputs:
                if _inputs(folder) is None and any(folder.iterdir()):
                    raise InputError(
                        f"{folder} exists and is not half-done work of ours: remove it, or give"
                        " --out another name"
                    )
                shutil.rmtree(folder)
            folder.mkdir(parents=True, exist_ok=True)
            (folder / _INPUTS).write_text(json.dumps({"inputs": inputs}), encoding="utf-8")
        except OSError as error:
            raise InputError(f"{folder} cannot be made: {error.strerror or error}") from error

    def step(self, name: str, make: Callable[[], Arrays]) -> Arrays:
        """Arrays of a step, computed by `make` and saved, atomically, if it is not finished."""
        if self.folder is None:
            return make()
        path = self.folder / f"{name}.safetensors"
        try:
            arrays = load(path.read_bytes())
        except (OSError, SafetensorError):
            arrays = {}
        if np.array_equal(arrays.pop(_INPUTS_OF_STEP, []), self._inputs):
            return arrays
        made = make()
        contiguous = {key: np.ascontiguousarray(array) for key, array in made.items()}
        write_whole(path, save(contiguous | {_INPUTS_OF_STEP: self._inputs}))
        return made

    @staticmethod
    def remove(folder: Path) -> None:
        """Deletes the folder of a finished build."""
        shutil.rmtree(folder, ignore_errors=True)


def _inputs(folder: Path) -> str | None:
    try:
        return json.loads((folder / _INPUTS).read_text(encoding="utf-8"))["inputs"]
    except (OSError, ValueError, KeyError, TypeError):
        return None
