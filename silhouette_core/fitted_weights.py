"""Weights of regressions: files that also state from what, by what command and when they were made.

A file has a table per regression: `data`, `command`, `seed`, `date` and `weights`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from pathlib import Path

import numpy as np
import tomlkit
from numpy.typing import NDArray

_DECIMALS = 3


@cache
def fitted_weights(path: Path) -> Mapping[str, NDArray[np.float64]]:
    """Weights (n,) of a file's regressions by name, read once."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    return {name: np.array(table["weights"], float) for name, table in tables.items()}


def write_weights(
    path: Path, fitted: Mapping[str, NDArray[np.floating]], data: str, command: str
) -> None:
    """Writes weights (n,) of some regressions, with today's date; those of others are kept.

    Args:
        path: the file.
        fitted: weights by the regression's name.
        data: the recordings that they were fitted to.
        command: the command that did so.
    """
    document = tomlkit.parse(path.read_text(encoding="utf-8"))
    for name, weights in fitted.items():
        document[name] = {
            "data": data,
            "command": command,
            "seed": "none: least squares and Newton's method begin with nothing random",
            "date": datetime.now(UTC).date().isoformat(),
            "weights": [round(float(weight), _DECIMALS) for weight in weights],
        }
    path.write_text(tomlkit.dumps(document), encoding="utf-8")
