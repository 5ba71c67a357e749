"""Every command scores through the backend that is chosen, in all of its processes, and calls its
kernels as they are compiled ahead.
"""

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
from voxelpose.compile_ahead import kernels
from voxelpose.demo.room import make_recording

ROOT = Path(__file__).resolve().parents[2]
ESTIMATORS = "multiview", "monocular"
SEARCH = {"voxel_overlap", "voxel_cover", "pixel_scores", "part_images", "silhouette_errors"}
TRACK = {"part_images", "drawn_weights", "silhouette_errors"}
TREE = {"span_distances", "silhouette_errors"}
FEW = ("--frames", "0:4", "--out", "result", "--overwrite")
ONE = ("--camera", "cam_1", "--start", "any")
PERSON = ("--stature", "1.7", "--sex", "male")
PAPER = ("--method", "paper", "--library", "lib.vplib")
LIVE = ("--no-page", *PERSON, "--fps", "4")
# What every process notes, too: what numba compiled or loaded, with its types.
NOTE_KERNELS = """
from numba.core.dispatcher import Dispatcher

compiled = Dispatcher.compile


def compile(self, types):
    done = compiled(self, types)
    with open(os.environ["KERNELS"], "a") as noted:
        noted.write(f"{self.py_func.__module__}.{self.py_func.__name__}{tuple(types)!r}\\n")
    return done


Dispatcher.compile = compile
"""


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """Videos of somebody in a room, silhouettes of somebody who waves, and a library."""
    folder = tmp_path_factory.mktemp("desk")
    make_recording(folder / "room", 4)
    write_staged(folder / "walk", waving(24), ring(4, (320, 240)))
    write_library(small_library(), folder / "lib.vplib")
    (folder / "outside").mkdir()
    install_backends(folder / "outside")
    note_calls(folder / "outside")
    with (folder / "outside" / "sitecustomize.py").open("a") as noting:
        noting.write(NOTE_KERNELS)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "methods", "processes"),
    [
        (("fit", "room", *FEW), SEARCH, 1),
        (("track", "room", *FEW, "--camera", "cam_2"), TRACK, 1),
        (("track", "walk", *FEW, *ONE, *PERSON, *PAPER), TREE, 1),
        (("live", "walk", *LIVE), SEARCH, 2),
        (("live", "walk", *LIVE, "--cameras", "cam_1"), TRACK, 1),
        (("live", "walk", *LIVE, "--cameras", "cam_1", *PAPER), TREE, 1),
    ],
    ids=["fit", "track", "paper", "live", "live-one", "live-paper"],
)
def test_a_command_scores_with_the_backend_that_is_chosen(desk, request, words, methods, processes):
    calls, called = (desk / f"{request.node.callspec.id}.{kind}" for kind in ("calls", "kernels"))
    path = os.pathsep.join([str(desk / "outside"), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", "voxelpose", *words, "--backend", "counted"],
        cwd=desk,
        env=os.environ | {"PYTHONPATH": path, "CALLS": str(calls), "KERNELS": str(called)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    noted = [line.split() for line in calls.read_text().splitlines()]
    assert {name for name, *_ in noted} == {"CountedBackend"}
    assert {method for _, method, *_ in noted} == methods
    assert len({process for _, _, process, _ in noted}) == processes
    ahead = {f"{module}.{name}{types}" for module, name, types in kernels(ESTIMATORS)}
    names = {line.partition("(")[0] for line in ahead}
    compiled = {line for line in called.read_text().splitlines() if line.partition("(")[0] in names}
    assert compiled
    assert compiled <= ahead
