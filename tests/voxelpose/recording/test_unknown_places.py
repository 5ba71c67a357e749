"""Unknown places of a recording: painted, drawn as polygons, and what is refused."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from calib.files import write_rig
from tests.sources import ring
from voxelpose.recording.folder import Recording

SQUARE = "[[10, 20], [30, 20], [30, 40], [10, 40]]"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two calibrated cameras, and nothing else."""
    write_rig(ring(2, (64, 48)), tmp_path / "calibration.toml")
    return tmp_path


def painted(folder: Path, name: str = "cam_1", size: tuple[int, int] = (64, 48)) -> np.ndarray:
    """Writes a picture whose lower left corner is faintly painted."""
    (folder / "unknown").mkdir(exist_ok=True)
    image = np.zeros((size[1], size[0]), np.uint8)
    image[30:, :20] = 9
    cv2.imwrite(str(folder / "unknown" / f"{name}.png"), image)
    return image > 0


def unknown(folder: Path, cameras: list[str] | None = None) -> dict[str, np.ndarray]:
    return Recording.without_frames(folder, cameras).unknown()


def test_what_is_not_black_is_unknown(folder):
    mask = painted(folder)
    found = unknown(folder)
    assert list(found) == ["cam_1"]
    np.testing.assert_array_equal(found["cam_1"], mask)


def test_polygons_are_filled_and_added_to_what_is_painted(folder):
    mask = painted(folder)
    (folder / "recording.toml").write_text(
        f"[unknown]\ncam_1 = [{SQUARE}, [[50.4, 0], [63, 0], [63, 10]]]\ncam_2 = [{SQUARE}]\n"
    )
    found = unknown(folder)
    mask[20:41, 10:31] = True
    assert (found["cam_1"] & mask).sum() == mask.sum()
    assert found["cam_1"][2, 60] and not found["cam_1"][9, 51]
    assert found["cam_2"].sum() == 21 * 21


def test_polygons_may_lie_beyond_the_picture(folder):
    (folder / "recording.toml").write_text(
        "[unknown]\ncam_1 = [[[-100, 24], [900, 24], [900, 5000], [-100, 5000]]]\n"
    )
    mask = unknown(folder)["cam_1"]
    assert mask[24:].all() and not mask[:24].any()


def test_nothing_is_unknown_where_nothing_is_marked(folder):
    assert unknown(folder) == {}
    (folder / "recording.toml").write_text("[unknown]\ncam_1 = []\n")
    assert unknown(folder) == {}


def test_cameras_that_are_not_used_may_have_places(folder):
    painted(folder)
    (folder / "recording.toml").write_text(f"[unknown]\ncam_1 = [{SQUARE}]\n")
    assert unknown(folder, ["cam_2"]) == {}


def test_a_picture_of_another_size_is_refused(folder):
    painted(folder, size=(32, 24))
    with pytest.raises(
        InputError, match=r"cam_1\.png is 32 x 24 px, but camera cam_1 was calibrated at 64 x 48"
    ):
        unknown(folder)


@pytest.mark.parametrize("place", ["unknown", "regions", "background"])
def test_pictures_of_a_camera_that_there_is_not_are_refused(folder, place):
    painted(folder, "Cam_1-empty")
    (folder / "unknown").rename(folder / place)
    recording = Recording.without_frames(folder, ["cam_2"])
    read = {"unknown": recording.unknown, "regions": recording.regions}
    with pytest.raises(InputError, match=r"none of the cameras cam_1, cam_2: rename Cam_1-empty"):
        read.get(place, recording.backgrounds)()
    for name in ("cam_1", "cam_2"):
        shutil.copy(folder / place / "Cam_1-empty.png", folder / place / f"{name}.png")
    assert list(read.get(place, recording.backgrounds)()) == ["cam_2"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[unknown]\ncam_7 = []", "no camera 'cam_7'"),
        ("[furniture]\ncam_1 = []", "'furniture' is not known"),
        ("unknown = 3", "unknown is no table"),
        ("[unknown]\ncam_1 = 3", "no list of polygons"),
        ("[unknown]\ncam_1 = [[1, 2], [3, 4], [5, 6]]", "no list of polygons"),
        ("[unknown]\ncam_1 = [[[1, 2], [3, 4]]]", "three or more corners"),
        ("[unknown]\ncam_1 = [[[1, 2], [3, 4], [5, nan]]]", "no list of polygons"),
        ("[unknown]\ncam_1 = [[[1, 2], [3, 4], [5, 1e9]]]", "no list of polygons"),
        ('[unknown]\ncam_1 = [[[1, 2], [3, 4], [5, "6"]]]', "no list of polygons"),
        ("[unknown]\ncam_1 = [[[1, 2], [3, 4], [true, 6]]]", "no list of polygons"),
        ("[unknown", "no valid TOML"),
    ],
)
def test_what_are_no_polygons_is_refused_in_one_line(folder, text, words):
    (folder / "recording.toml").write_text(text)
    with pytest.raises(InputError, match=words) as refused:
        unknown(folder)
    assert "recording.toml" in str(refused.value) and "\n" not in str(refused.value)
