"""Weights of regressions: files that also state from what, by what command and when they were made.

A file has a table per regression: `data`, `command`, `seed`, `date` and `weights`.
"""

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from calib.checks import FloatArray


@cache
def fitted_weights(path: Path) -> Mapping[str, FloatArray]:
    """Weights (n,) of a file's regressions by name, read once."""
    tables = tomllib.loads(path.read_text(encoding="utf-8"))
    return {name: np.array(table["weights"], float) for name, table in tables.items()}
