"""Pictures that a camera gave again are lost frames; those of a still scene are pictures."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from tests.sources import write_film
from tests.voxelpose.recording.test_file_times import ffmpeg
from tests.voxelpose.recording.test_folder import write_calibration
from voxelpose.recording import ffmpeg as ffmpeg_files
from voxelpose.recording.folder import Recording

WIDTH, HEIGHT, COUNT = 96, 64, 24
X264 = ["-c:v", "libx264", "-crf", "18", "-pix_fmt", "yuv420p"]


def film(moments: list[float], noise: float, seed: int = 0) -> list[np.ndarray]:
    """Pictures of a bar that is at a place of its own at each moment; a moment of one number is the
    same picture, noise included. At a negative one it is out of sight.
    """
    rng, seen = np.random.default_rng(seed), {}
    for moment in moments:
        picture = np.full((HEIGHT, WIDTH, 3), 60.0)
        if moment >= 0:
            left = 8 + round(2.5 * moment)
            picture[8:56, left : left + 16] = 190
        noisy = np.clip(picture + noise * rng.standard_normal(picture.shape), 0, 255)
        seen.setdefault(moment, noisy.astype(np.uint8))
    return [seen[moment] for moment in moments]


def write(folder: Path, name: str, pictures: list[np.ndarray], words=X264, ext="mp4") -> None:
    source = write_film(folder / "source.mkv", pictures, 30, "FFV1")
    ffmpeg("-i", source, *words, folder / f"{name}.{ext}")
    source.unlink()


def record(folder: Path, cameras: dict[str, list[float]], noise: float = 3, **how) -> Recording:
    write_calibration(folder / "calibration.toml", tuple(cameras))
    for seed, (name, moments) in enumerate(cameras.items()):
        write(folder, name, film(moments, noise, seed), **how)
    return Recording.open(folder)


def test_slow_motion_is_told(tmp_path: Path):
    tag = ["-movflags", "use_metadata_tags", "-metadata", "com.android.capture.fps=120.000000"]
    recording = record(tmp_path, {"cam_1": STEPS, "cam_2": STEPS}, words=[*X264, *tag])
    (note,) = recording.notes
    assert note.startswith("cam_1, cam_2 filmed at 120 frames per second by what the file says")
    assert note.endswith("give --fps 120") and not Recording.open(tmp_path, fps=120).notes


@pytest.mark.parametrize(("share", "asked"), [(0.05, True), (0.5, False)])
def test_bytes_of_a_budget_tell_nothing_of_repeats(share: float, asked: bool):
    numbers = np.arange(60)
    spent = 5000 * (1 + share * np.sin(numbers / 9))
    table = np.column_stack([numbers, numbers, spent, numbers, np.zeros(60)])
    assert ffmpeg_files._may_repeat(table, "Video: h264") == asked


STEPS = [float(k) for k in range(COUNT)]
STALL = [*STEPS[:8], 7.0, 7.0, 7.0, *STEPS[11:]]
KEPT = [k for k in range(COUNT) if k not in (8, 9, 10)]
CODED = {
    "x264": {},
    "strong": {"words": ["-c:v", "libx264", "-crf", "30", "-pix_fmt", "yuv420p"]},
    "mpeg4": {"words": ["-c:v", "mpeg4", "-q:v", "3"], "ext": "avi"},
    "mjpeg": {"words": ["-c:v", "mjpeg", "-q:v", "3"], "ext": "avi"},
    "intra": {"words": ["-c:v", "libx264", "-g", "1", "-b:v", "2M", "-pix_fmt", "yuv420p"]},
    "ffv1": {"words": ["-c:v", "ffv1"], "ext": "mkv"},
}


@pytest.mark.parametrize("coded", CODED)
@pytest.mark.parametrize("noise", [0, 3])
def test_a_camera_that_stalls_loses_the_frames(tmp_path: Path, coded: str, noise: float):
    recording = record(tmp_path, {"cam_1": STEPS, "cam_2": STALL}, noise, **CODED[coded])
    assert recording.numbers.tolist() == KEPT
    assert recording.fps == pytest.approx(30, rel=1e-3)
    (note,) = recording.notes
    assert note.startswith("cam_2 repeats the picture before in 3 frames (8 to 10): ")
    assert sum(1 for _ in recording) == recording.frame_count == len(KEPT)


def test_cameras_that_stall_together_are_told_by_noise(tmp_path: Path):
    cameras = {"cam_1": STALL, "cam_2": STALL}
    assert record(tmp_path, cameras).numbers.tolist() == KEPT


@pytest.mark.parametrize(
    ("moments", "kept"),
    [
        ([*STEPS[:16], *[15.0] * 8], list(range(16))),
        ([*[0.0] * 6, *STEPS[6:]], [0, *range(6, COUNT)]),
        ([k * 25 // 30 for k in range(COUNT)], [k for k in range(COUNT) if k % 6 != 1]),
        ([k - (k % 3 == 2) for k in range(COUNT)], [k for k in range(COUNT) if k % 3 != 2]),
    ],
    ids=["end", "start", "25 in 30", "every third"],
)
def test_repeats_anywhere_are_lost(tmp_path: Path, moments: list[float], kept: list[int]):
    recording = record(tmp_path, {"cam_1": STEPS, "cam_2": [float(k) for k in moments]}, 1)
    np.testing.assert_allclose(30 * recording.times_s, kept, atol=0.01)
    assert [reader.numbers for reader in recording.readers.values()] == [tuple(kept)] * 2


@pytest.mark.parametrize("shift", [0, 1])
def test_a_video_doubled_throughout_has_its_real_rate(tmp_path: Path, shift: int):
    twice = [float(k // 2 * 2) for k in range(COUNT)]
    other = [float((k + shift) // 2 * 2) for k in range(COUNT)]
    recording = record(tmp_path, {"cam_1": twice, "cam_2": other})
    assert recording.fps == pytest.approx(15, rel=1e-3)
    assert recording.frame_count == COUNT // 2
    assert "cam_1, cam_2 shows each picture 2 times" in recording.notes[0] or shift


STAND = [*STEPS[:8], *[8.0] * 8, *STEPS[9:17]]


@pytest.mark.parametrize(
    "cameras",
    [
        {"cam_1": STAND, "cam_2": STAND},
        {"cam_1": STAND},
        {"cam_1": [5.0] * COUNT, "cam_2": [5.0] * COUNT},
        {"cam_1": STEPS, "cam_2": [*STEPS[:8], *[-1.0] * 8, *STEPS[16:]]},
    ],
    ids=["stands", "one camera", "always still", "out of sight of one"],
)
@pytest.mark.parametrize("noise", [0, 3])
def test_who_stands_still_is_not_lost(tmp_path: Path, cameras, noise: float):
    if noise:  # each picture has its own
        cameras = {name: [m + 1e-4 * k for k, m in enumerate(c)] for name, c in cameras.items()}
    recording = record(tmp_path, cameras, noise)
    assert (recording.frame_count, recording.notes) == (COUNT, ())


def test_repeats_in_chapters_are_lost(tmp_path: Path):
    write_calibration(tmp_path / "calibration.toml", ("cam_1",))
    (tmp_path / "cam_1").mkdir()
    pictures = film([*range(15), *[14] * 3, *range(18, COUNT)], 3)
    write(tmp_path / "cam_1", "GX010012", pictures[:12])
    write(tmp_path / "cam_1", "GX020012", pictures[12:])
    recording = Recording.open(tmp_path)
    assert recording.numbers.tolist() == [*range(15), *range(18, COUNT)]


def test_images_that_are_copies_are_lost(tmp_path: Path):
    record(tmp_path, {"cam_1": STEPS, "cam_2": STALL})
    for name in ("cam_1", "cam_2"):
        (tmp_path / name).mkdir()
        ffmpeg("-i", tmp_path / f"{name}.mp4", "-q:v", "2", tmp_path / name / "%04d.png")
        (tmp_path / f"{name}.mp4").unlink()
    moments = film(STALL, 3, 1)
    for number, picture in enumerate(moments, 1):
        cv2.imwrite(str(tmp_path / "cam_2" / f"{number:04d}.png"), picture)
    recording = Recording.open(tmp_path, fps=30)
    assert recording.numbers.tolist() == KEPT


def test_lengths_that_differ_are_still_asked_about(tmp_path: Path):
    avi = CODED["mjpeg"]
    with pytest.raises(InputError, match=r"differ in length|did not stop together"):
        record(tmp_path, {"cam_1": STEPS[:-5], "cam_2": STALL}, **avi)
