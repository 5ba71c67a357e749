"""Fixtures that every test may use."""

import os
from pathlib import Path

import pytest

SHARED = Path(os.environ.get("VOXELPOSE_SHARED", Path(__file__).resolve().parents[2] / "shared"))


@pytest.fixture(scope="session")
def shared() -> Path:
    """Returns the folder of shared recordings that stands beside the project, or skips."""
    if not (SHARED / "data").is_dir():
        pytest.skip(f"no shared recordings at {SHARED} (set VOXELPOSE_SHARED)")
    return SHARED
