"""Recipes of rendered recordings: who moves how, before which cameras."""

from __future__ import annotations

import os
import shutil
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.errors import InputError
from voxelpose.demo.filming import make_recording
from voxelpose.demo.measurements import Measurements

_STAMP = "recipe.txt"


@dataclass(frozen=True)
class Recipe:
    """Recipe of one recording.

    Attributes:
        seed: of limb proportions, clothing and sensor noise.
        stature_m: of the person, barefoot.
        chest_girth_m: over the skin.
        waist_girth_m: likewise.
        hip_girth_m: likewise.
        performance: a name of `choreography.PERFORMANCES`.
        cameras: numbers of the cameras that film, 1 to 8.
        frames: number of frames.
    """

    seed: int
    stature_m: float
    chest_girth_m: float
    waist_girth_m: float
    hip_girth_m: float
    performance: str
    cameras: tuple[int, ...]
    frames: int

    @property
    def person(self) -> Measurements:
        """Measurements of the person."""
        girths = self.chest_girth_m, self.waist_girth_m, self.hip_girth_m
        person = Measurements(self.stature_m, *girths)
        return person.with_variation(np.random.default_rng(self.seed))

    def render(self, folder: Path) -> Path:
        """Renders the recording, unless the folder already holds that of this very recipe.

        Args:
            folder: replaced where it holds another recording.

        Returns:
            The folder.

        Raises:
            InputError: it cannot be written.
            ValueError: the recipe has an unknown performance or camera.
        """
        stamp, text = folder / _STAMP, f"{self}\n{self.person}\n"
        if not stamp.is_file() or stamp.read_text(encoding="utf-8") != text:
            beside = folder.with_name(f".{folder.name}.{os.getpid()}")
            cameras = [f"cam_{number}" for number in self.cameras]
            try:
                make_recording(
                    beside, self.frames, self.seed, self.performance, cameras, self.person
                )
                (beside / _STAMP).write_text(text, encoding="utf-8")
                shutil.rmtree(folder, ignore_errors=True)
                beside.rename(folder)
            finally:
                shutil.rmtree(beside, ignore_errors=True)
        return folder


def read_recipes(path: Path) -> dict[str, Recipe]:
    """Reads recipes, a TOML table each.

    Returns:
        The recipes by name.

    Raises:
        InputError: the file cannot be read, or a recipe is not complete.
    """
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8"))
        return {
            name: Recipe(**table | {"cameras": tuple(table["cameras"])})
            for name, table in tables.items()
        }
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(f"{path} cannot be read as recipes of recordings: {error}") from error
