"""Rendered recordings of a clothed mannequin, unlike the fitting body, in a small room."""

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def demo_table(name: str) -> dict[str, Any]:
    """Content of a table of this folder, NAME.toml; it is not to be changed."""
    return tomllib.loads((files("voxelpose.demo") / f"{name}.toml").read_text(encoding="utf-8"))
