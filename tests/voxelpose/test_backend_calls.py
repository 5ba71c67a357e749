"""Every command scores through the backend that is chosen, in all of its processes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from silhouette_core.monocular.tree.store import write_library
from tests.clips import waving
from tests.outside import install_backends, note_calls
from tests.silhouette_core.monocular.tree.small_library import small_library
from tests.sources import ring, write_staged

ROOT = Path(__file__).resolve().parents[2]
SEARCH = {"voxel_overlap", "voxel_cover", "pixel_scores", "part_images", "silhouette_errors"}
TRACK = {"part_images", "drawn_weights", "silhouette_errors"}
TREE = {"span_distances", "silhouette_errors"}
FEW = ("--frames", "0:4", "--out", "result", "--overwrite")
ONE = ("--camera", "cam_1", "--start", "any")
PAPER = ("--method", "paper", "--library", "lib.vplib")
LIVE = ("--no-page", "--stature", "1.7", "--fps", "4")


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A recording of somebody who walks and waves, and a library."""
    folder = tmp_path_factory.mktemp("desk")
    write_staged(folder / "walk", waving(24), ring(4, (320, 240)))
    write_library(small_library(), folder / "lib.vplib")
    (folder / "outside").mkdir()
    install_backends(folder / "outside")
    note_calls(folder / "outside")
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "methods", "processes"),
    [
        (("fit", *FEW), SEARCH, 1),
        (("track", *FEW, *ONE), TRACK, 1),
        (("track", *FEW, *ONE, *PAPER), TREE, 1),
        (("live", *LIVE), SEARCH, 2),
        (("live", *LIVE, "--cameras", "cam_1"), TRACK, 1),
        (("live", *LIVE, "--cameras", "cam_1", *PAPER), TREE, 1),
    ],
    ids=["fit", "track", "paper", "live", "live-one", "live-paper"],
)
def test_a_command_scores_with_the_backend_that_is_chosen(desk, request, words, methods, processes):
    calls = desk / f"{request.node.callspec.id}.txt"
    path = os.pathsep.join([str(desk / "outside"), str(ROOT)])
    command = [sys.executable, "-m", "voxelpose", words[0], "walk", *words[1:]]
    done = subprocess.run(
        [*command, "--backend", "counted"],
        cwd=desk,
        env=os.environ | {"PYTHONPATH": path, "CALLS": str(calls)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    noted = [line.split() for line in calls.read_text().splitlines()]
    assert {name for name, *_ in noted} == {"CountedBackend"}
    assert {method for _, method, *_ in noted} == methods
    assert len({process for _, _, process, _ in noted}) == processes
