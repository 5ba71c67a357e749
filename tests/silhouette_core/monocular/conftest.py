"""A small library of the project's own movements, made once."""

from dataclasses import replace

import pytest

from benchmarks.library_fuzz_targets import unlearned_proposal
from silhouette_core.monocular.tree.base_poses import base_poses
from silhouette_core.monocular.tree.build import build_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.monocular.tree.store import write_library
from tests.silhouette_core.monocular.filming import MOVEMENTS, body, performed

SETTINGS = LibrarySettings(
    poses=80 * 24, mirror=False, thresholds=(0.03, 0.018, 0.011), weighting="xor"
)


@pytest.fixture(scope="session")
def library():
    """About 1,900 samples: 80 poses from 24 sides."""
    return build_library(
        base_poses({name: performed(name) for name in MOVEMENTS}, SETTINGS), body(), SETTINGS
    )


@pytest.fixture(scope="session")
def quick_library_file(library, tmp_path_factory):
    """With a proposal that learned nothing, for what does not depend on it."""
    path = tmp_path_factory.mktemp("library") / "quick.vplib"
    write_library(replace(library, proposal=unlearned_proposal()), path)
    return path
