"""Recipes of rendered recordings: who moves how, before which cameras."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tailoring import Measurements, tailor
from calib.errors import InputError
from calib.storage.atomic import FolderWriter
from calib.storage.documents import load_text, parse_toml
from voxelpose.demo.room import make_recording

_LARGEST_BYTES = 10_000_000
_STAMP = "recipe.txt"


@dataclass(frozen=True)
class Recipe:
    """Recipe of one recording.

    Attributes:
        person: measurements of the actor.
        seed: of limb proportions, clothing and sensor noise.
        performance: a name of `choreography.performances`.
        cameras: numbers of the cameras that film, 1 to 8.
        frames: number of frames.
    """

    person: Measurements
    seed: int
    performance: str
    cameras: list[int]
    frames: int

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> "Recipe":
        """Recipe of a TOML table; its lengths in metres are those of the person."""
        person = Measurements(**{key: table[key] for key in table if key.endswith("_m")})
        others = {key: table[key] for key in table if not key.endswith("_m")}
        return cls(_varied(person, np.random.default_rng(table["seed"])), **others)

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
        stamp = folder / _STAMP
        if not stamp.is_file() or stamp.read_text(encoding="utf-8") != str(self):
            names = [f"cam_{number}" for number in self.cameras]
            with FolderWriter(folder, overwrite=True) as partial:
                make_recording(
                    partial, self.frames, self.seed, self.performance, names, tailor(self.person)
                )
                (partial / _STAMP).write_text(str(self), encoding="utf-8")
        return folder


def _varied(person: Measurements, rng: np.random.Generator) -> Measurements:
    """Draws limb proportions, clothing and soles within the usual range of adults."""
    # Mean and standard deviation; the standard actor has long legs.
    usual = {"legs": (0.95, 0.015), "arms": (1, 0.02), "shoulders": (1, 0.03), "head": (1, 0.025)}
    drawn = {
        name: mean + sigma * float(np.clip(rng.normal(), -2, 2))
        for name, (mean, sigma) in usual.items()
    }
    return replace(
        person,
        cloth_m=float(rng.uniform(0.004, 0.018)),
        sole_m=float(rng.uniform(0.005, 0.010)),
        **drawn,
    )


def read_recipes(path: Path) -> dict[str, Recipe]:
    """Reads recipes, a TOML table each.

    Returns:
        The recipes by name.

    Raises:
        InputError: the file cannot be read, or a recipe is not complete.
    """
    tables = parse_toml(load_text(path, _LARGEST_BYTES), path)
    try:
        return {name: Recipe.from_table(table) for name, table in tables.items()}
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(
            f"{path} cannot be read as recipes of recordings: {str(error)[:200]}"
        ) from error
