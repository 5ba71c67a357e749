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


def taken_s(recording: Recording, camera: str) -> np.ndarray:
    """Times of the frames in use by the names of a camera's images."""
    reader = recording.readers[camera]
    numbers = range(reader.frame_count) if reader.numbers is None else reader.numbers
    return np.array([float(reader.stills[number].stem) for number in numbers])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "name", "count", "lost"),
    [("image_times_in_names", "stamp_few", 32, 2), ("image_times_unpadded", "stamp_plain", 24, 0)],
)
@pytest.mark.parametrize("fps", [None, 30.0])
def test_images_with_times_are_paired_by_them(made, script, name, count, lost, fps):
    recording = Recording.open(made(script, name), fps=fps)
    assert recording.frame_count == count and recording.fps == pytest.approx(30, rel=0.001)
    times_s = np.array([taken_s(recording, camera) for camera in recording.rig.names])
    assert np.ptp(times_s, axis=0).max() < 0.005
    assert (f"lost {lost} images" in "".join(recording.notes)) == (lost > 0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("script", "name", "words"),
    [
        ("gopro_chapters", "gopro", "cam_3: GX010012.MP4, GX020012.MP4 are joined"),
        ("still_as_first_track", "cover", "cam_3.mp4: the first video track is a still picture"),
    ],
)
def test_films_in_several_files_or_tracks_are_read(made, shared: Path, script, name, words):
    recording = Recording.open(made(script, name))
    assert recording.frame_count == 24 and words in "; ".join(recording.notes)
    whole = Recording.open(shared / "data" / "walk4", frames=(20, 44))
    for (_, _, frames), (_, _, others) in zip(recording, whole, strict=True):
        for camera, frame in frames.items():
            assert np.abs(frame.astype(int) - others[camera]).mean() < 3


@pytest.mark.slow
def test_frames_with_an_opacity_are_silhouettes(made, shared: Path):
    recording = Recording.open(made("frames_with_alpha", "rgba_black"), fps=30)
    assert recording.silhouettes_given and "used as silhouettes" in recording.notes[0]
    with np.load(shared / "data" / "walk4" / "masks" / "masks.npz") as packed:
        for number, _, frames in recording:
            for camera, frame in frames.items():
                bits = np.unpackbits(packed[camera][20 + number], axis=1)
                mask = bits[:, : frame.shape[1]] > 0
                np.testing.assert_array_equal(frame[..., 0] > 0, mask)


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
