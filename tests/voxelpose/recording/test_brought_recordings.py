"""Recordings on which people failed, made by the shared scripts, and shared ones of their kinds."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.reliability import verdict_of


@pytest.fixture(scope="module")
def made(shared: Path, tmp_path_factory: pytest.TempPathFactory):
    """Runs a shared script, once, and returns a folder that it made, or skips."""
    folders: dict[str, Path] = {}

    def make(script: str, name: str) -> Path:
        file = shared / "cases" / "scripts" / script / "make.py"
        if not file.exists():
            pytest.skip(f"no shared script {script}")
        if script not in folders:
            folders[script] = tmp_path_factory.mktemp(script)
            places = {"OUT": str(folders[script]), "VOXELPOSE_SHARED": str(shared)}
            subprocess.run([sys.executable, str(file)], env=os.environ | places, check=True)
        return folders[script] / name

    return make


@pytest.mark.parametrize(
    ("name", "fps", "count", "words"),
    [
        ("m_rgba", 30, 20, ""),
        ("m_label1", 30, 20, ""),
        ("t_ms", None, 40, "is taken to count in ms"),
        ("v_vfr_halfrate", None, 40, "filmed 10 to 20 frames per second"),
    ],
)
def test_shared_cases_are_understood(shared: Path, name: str, fps, count: int, words: str):
    folder = shared / "cases" / name
    if not folder.is_dir():
        pytest.skip(f"no shared case {name}")
    recording = Recording.open(folder, fps=fps)
    assert (recording.frame_count, recording.silhouettes_given) == (count, name.startswith("m_"))
    assert words in "; ".join(recording.notes)


@pytest.mark.accuracy
def test_frames_of_nobody_are_no_fault(made, tmp_path: Path):
    folder = made("person_not_always_there", "late")
    recording = Recording.open(folder, frames=(5, 20))
    result = fit(recording, Output(tmp_path / "fit", pictures=False))
    assert verdict_of(result.summary).level == "reliable"
    np.testing.assert_array_equal(result.motion.frames, range(10, 20))


@pytest.mark.slow
def test_angles_of_a_turn_do_not_jump(shared: Path, fitted: Path, tmp_path: Path):
    scripts = shared / "cases" / "scripts" / "bvh_angle_jumps"
    if not scripts.is_dir():
        pytest.skip(f"no shared scripts {scripts}")
    out = tmp_path / "out"
    for words in (["bvh_turn.py", fitted, out], ["bvh_jumps.py", out / "motion.bvh"]):
        done = subprocess.run(
            [sys.executable, scripts / words[0], *words[1:]],
            capture_output=True,
            text=True,
            check=True,
        )
    assert "jumps over 180 deg: 0 " in done.stdout
