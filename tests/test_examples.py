"""The examples and the notebook run as they stand, from an empty folder."""

import importlib
import runpy
import sys
from pathlib import Path

import cv2
import nbformat
import pytest
from nbclient import NotebookClient

from tests.other_bodies import assert_found
from voxelpose import make_recording

FOLDER = Path(__file__).resolve().parents[1] / "examples"
NOTEBOOK = FOLDER / "voxelpose.ipynb"
# What the notebook calls as the examples have called it.
MADE = """
import voxelpose

voxelpose.fit = voxelpose.track = lambda recording, output: voxelpose.Result.open(output.folder)
"""
EXAMPLES = sorted(path.stem for path in FOLDER.glob("0*.py"))


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """Runs the six examples in their order on a short recording; returns where they wrote."""
    out = tmp_path_factory.mktemp("examples")
    make_recording(out / "recording", 3)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(FOLDER))
        motions = importlib.import_module("bodies.example_motions")
        film = motions.film_example
        patch.setattr(motions, "film_example", lambda folder, name, _: film(folder, name, 3))
        for name in EXAMPLES:
            patch.setattr(sys, "argv", [name, str(out)])
            runpy.run_path(str(FOLDER / f"{name}.py"), run_name="__main__")
    return out


@pytest.mark.slow
def test_every_example_draws_its_picture(ran):
    assert len(EXAMPLES) == 6
    for name in EXAMPLES:
        picture = cv2.imread(str(ran / f"{name}.png"))
        assert picture is not None, name
        assert picture.std() > 10, name


@pytest.mark.slow
def test_the_results_are_good(ran):
    from voxelpose import evaluate

    several, one = evaluate(ran / "fit"), evaluate(ran / "track")
    assert several.lost == 0
    assert several.root_mm < 40  # the mannequin has longer legs than people
    assert one.lost == 0
    assert one.root_mm < 150
    assert_found(ran / "robot_arm", ran / "robot_arm_fit", 3, 2.0, 10.0)


def test_the_notebook_holds_no_outputs():
    cells = nbformat.read(NOTEBOOK, as_version=4).cells
    assert not any(
        cell.outputs or cell.execution_count for cell in cells if cell.cell_type == "code"
    )


@pytest.mark.slow
def test_the_notebook_runs(ran, monkeypatch):
    # What the examples made is there already: the recording, and both results.
    monkeypatch.setenv("VOXELPOSE_OUT", str(ran))
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(MADE))
    NotebookClient(notebook, timeout=600, kernel_name="python3").execute()
    pictures = [
        output
        for cell in notebook.cells
        for output in cell.get("outputs", ())
        if "image/png" in output.get("data", {})
    ]
    assert len(pictures) == 5
