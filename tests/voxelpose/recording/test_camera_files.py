"""Files beside those of the cameras: hidden ones, results, other names, other places."""

import re
from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
import pytest

from calib.errors import InputError
from calib.files import write_rig
from tests.sources import ring
from voxelpose.calibration.board_views import cameras_in
from voxelpose.recording.camera_files import not_read, pictures_by_camera, renaming
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import FrameReader

SIZE = (64, 48)


def images(folder: Path, size: tuple[int, int] = SIZE) -> Path:
    """Writes three pictures."""
    folder.mkdir(parents=True)
    for number in range(3):
        picture = np.full((size[1], size[0]), 10 * number + 10, np.uint8)
        cv2.imwrite(str(folder / f"{number}.png"), picture)
    return folder


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A recording of two cameras."""
    write_rig(ring(2, SIZE), tmp_path / "calibration.toml")
    for name in ("cam_1", "cam_2"):
        images(tmp_path / name)
    return tmp_path


def refusal(folder: Path) -> str:
    with pytest.raises(InputError) as refused:
        Recording.open(folder, fps=25)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_hidden_files_are_skipped(folder):
    for path in ("cam_1/._0.png", "cam_2/.DS_Store", "._cam_3.mp4", "._calibration.toml"):
        (folder / path).write_bytes(b"\0\5\x16\7")
    (folder / ".cache").mkdir()
    assert Recording.open(folder, fps=25).frame_count == 3


def test_a_result_is_no_camera(folder):
    (images(folder / "fit") / "summary.json").write_text("{}")
    assert list(pictures_by_camera(folder)) == ["cam_1", "cam_2"]
    assert Recording.open(folder, fps=25).rig.names == ("cam_1", "cam_2")


@pytest.mark.parametrize(
    ("suffix", "words"), [(".txt", ""), (".HEIC", r" that are read \(.\.HEIC: save it as JPEG")]
)
def test_a_folder_without_images_is_named(folder, suffix, words):
    for file in (folder / "cam_2").iterdir():
        file.rename(file.with_suffix(suffix))
    assert re.search(f"cam_2/ holds no images{words}", refusal(folder))
    with pytest.raises(InputError, match=f"holds no pictures{words}"):
        cameras_in([folder / "cam_2"])


def test_images_in_one_file_are_refused(tmp_path):
    pictures = [np.full(SIZE[::-1], number, np.uint8) for number in range(3)]
    cv2.imwritemulti(str(tmp_path / "a.tif"), pictures)
    with pytest.raises(InputError, match=r"a\.tif holds 3 images: give each a file"):
        FrameReader.open(tmp_path / "a.tif")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("cam_1", "videos/cam_1", "videos/ holds cam_1: move that up here"),
        ("cam_1/0.png", "cam_1.h264", "cam_1.h264 is no video .*ffmpeg -i cam_1.h264 cam_1.mp4"),
        ("calibration.toml", "camera_array.toml", "camera_array.toml .*name it calibration.toml"),
    ],
)
def test_what_lies_beside_is_named(folder, old, new, words):
    (folder / new).parent.mkdir(exist_ok=True)
    (folder / old).rename(folder / new)
    assert not_read(folder)
    for name in ("cam_1", "cam_2"):
        for file in (folder / name).glob("*"):
            file.unlink()
    with pytest.raises(InputError, match=words):
        Recording.open(folder, fps=25)


@pytest.mark.parametrize("name", ["calibration.txt", "calibration.qca.txt", "calibration.xcp"])
def test_a_calibration_is_told_by_its_content(folder, name):
    (folder / "calibration.toml").rename(folder / name)
    assert len(Recording.open(folder, fps=25).rig) == 2


@pytest.mark.parametrize(
    "names",
    [("Cam_1", "Cam_2"), ("walk_cam_1", "walk_cam_2"), ("cam01", "cam02"), ("GH 1", "GH 2")],
)
def test_other_names_are_proposed_to_be_changed(folder, names):
    for number, name in enumerate(names, 1):
        (folder / f"cam_{number}").rename(folder / name)
    assert f"rename {names[0]} to cam_1, {names[1]} to cam_2" in refusal(folder)


def test_names_that_fit_several_are_not_proposed():
    assert renaming({"a_1": Path("a_1.mp4"), "b_1": Path("b_1.mp4")}, ["cam_1", "cam_3"]) == ""


def test_portrait_is_asked_about(tmp_path):
    write_rig(ring(2, SIZE), tmp_path / "calibration.toml")
    for name in ("cam_1", "cam_2"):
        images(tmp_path / name, SIZE[::-1])
    assert "48 x 64 px, but camera cam_1 was calibrated at 64 x 48: is one of them in portrait" in (
        refusal(tmp_path)
    )


def video(path: Path) -> Path:
    writer = imageio_ffmpeg.write_frames(
        str(path.absolute()), SIZE, pix_fmt_in="gray", macro_block_size=1, ffmpeg_log_level="quiet"
    )
    writer.send(None)
    for number in range(5):
        writer.send(np.full(SIZE[::-1], 40 * number, np.uint8))
    writer.close()
    return path


def test_a_relative_path_may_hold_a_colon(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = video(Path("12:30.mp4"))
    assert len(list(FrameReader.open(path))) == 5


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_half_copied_file_is_to_be_copied_again(tmp_path, share):
    whole = video(tmp_path / "whole.mp4").read_bytes()
    (tmp_path / "a.mp4").write_bytes(whole[: int(share * len(whole))])
    image = cv2.imencode(".jpg", np.random.default_rng(0).integers(0, 255, (48, 64), np.uint8))[1]
    (tmp_path / "a.png").write_bytes(b"")
    (tmp_path / "a.jpg").write_bytes(image.tobytes()[: int(share * 20)])
    for name in ("a.mp4", "a.png", "a.jpg"):
        with pytest.raises(InputError, match="copy it again") as refused:
            FrameReader.open(tmp_path / name)
        assert "convert" not in str(refused.value)
