"""`import voxelpose` gives the everyday names, and costs nothing until one is used."""

import subprocess
import sys
from importlib import resources

import pytest

import voxelpose
from calib.errors import InputError
from tests.sources import ring, write_recording

_HEAVY = {"numpy", "cv2", "numba", "scipy", "matplotlib", "open3d", "tyro"}
_IMPORT = f"""
import sys, time
started = time.perf_counter()
import voxelpose
seconds = time.perf_counter() - started
print(seconds, *sorted({{name.split(".")[0] for name in sys.modules}} & {_HEAVY}))
"""


def test_every_name_is_there_and_is_where_the_types_say():
    for name, module in voxelpose._MODULES.items():
        value = getattr(voxelpose, name)
        assert (value.__name__, value.__module__) == (name, module)
    assert set(voxelpose._MODULES) <= set(dir(voxelpose))


def test_types_are_told_to_type_checkers():
    for package in ("calib", "silhouette_core", "voxelpose"):
        assert (resources.files(package) / "py.typed").is_file()


def test_what_is_not_there_is_said():
    with pytest.raises(AttributeError, match="'voxelpose' has no attribute 'fits'"):
        voxelpose.fits  # type: ignore[attr-defined]  # noqa: B018


def test_import_is_fast_and_brings_nothing():
    seconds, *heavy = subprocess.run(
        [sys.executable, "-c", _IMPORT], capture_output=True, text=True, check=True
    ).stdout.split()
    assert heavy == []
    assert float(seconds) < 0.25


def test_track_is_for_one_camera(tmp_path):
    recording = voxelpose.Recording.open(write_recording(tmp_path / "walk", ring(2)))
    with pytest.raises(InputError, match="2 cameras are too many"):
        voxelpose.track(recording, voxelpose.Output(tmp_path / "out"))


def test_evaluate_takes_a_table_of_joints(tmp_path):
    voxelpose.make_recording(tmp_path / "recording", frames=1)
    truth = tmp_path / "recording" / "truth.json"
    from silhouette_core.body.joints import LANDMARK_NAMES
    from voxelpose.recording.truth import read_truth

    joints = zip(LANDMARK_NAMES, read_truth(truth)[0], strict=True)
    rows = [f"0,{name},{x + 0.1},{y},{z}" for name, (x, y, z) in joints]
    (tmp_path / "joints.csv").write_text("\n".join(["frame,joint,x_m,y_m,z_m", *rows]))
    score = voxelpose.evaluate(tmp_path / "joints.csv", truth)
    assert score.mpjpe_mm == pytest.approx(100)
    assert score.root_mm == pytest.approx(0, abs=1e-6)
    with pytest.raises(InputError, match="give --truth"):
        voxelpose.evaluate(tmp_path / "joints.csv")
