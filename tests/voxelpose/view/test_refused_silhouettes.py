"""Silhouettes that are refused are drawn beside the result, and no longer where they are not."""

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.image.plausibility import (
    ImplausibleSilhouettesError,
    check_plausible,
    telling_frames,
)
from silhouette_core.image.silhouettes import UndistortedView
from tests.sources import ring, write_recording
from voxelpose.recording.folder import Recording
from voxelpose.view.images.overlay import draw_refused, refusal_drawn

RIG = ring(3, (160, 120), (-0.2, 0.05, 0.0, 0.0))
WALL = np.zeros((60, 80), bool)
WALL[10:50, 20:60] = True


@pytest.fixture
def recording(tmp_path):
    return Recording.open(write_recording(tmp_path / "walk", RIG, 9))


def refuse(names, frame_count):
    lenses = {camera.name: UndistortedView.from_camera(camera, 80) for camera in RIG}
    masks = [WALL] * len(telling_frames(frame_count))
    check_plausible(dict.fromkeys(names, masks), least=2, lenses=lenses)


def test_the_picture_is_named_and_goes_when_the_command_succeeds(recording, tmp_path):
    out, picture = tmp_path / "out", tmp_path / "out.silhouettes.png"
    named = pytest.raises(InputError, match=r"see .*out\.silhouettes\.png, and why with")
    with named, refusal_drawn(recording, out):
        refuse(["cam_1", "cam_3"], 9)
    assert cv2.imread(str(picture)) is not None and not out.exists()
    with pytest.raises(InputError, match="another"), refusal_drawn(recording, out):
        raise InputError("another")
    assert picture.exists()
    with refusal_drawn(recording, out):
        pass
    assert not picture.exists()


def test_where_nothing_can_be_written_the_refusal_stands(recording, tmp_path):
    plain = pytest.raises(InputError, match="look at them with `voxelpose setup`")
    with plain, refusal_drawn(recording, tmp_path / "nowhere" / "out"):
        refuse(["cam_1"], 9)


@pytest.mark.parametrize("count", [1, 2, 9])
def test_inside_is_coloured_and_the_rest_is_grey(tmp_path, count):
    recording = Recording.open(write_recording(tmp_path / "take", RIG, count))
    with pytest.raises(ImplausibleSilhouettesError) as caught:
        refuse(["cam_1"], count)
    sheet = draw_refused(recording, caught.value)
    tile = sheet[-28 - 60 :][:30].astype(int)  # above the lower edge of the only row
    colourful = np.ptp(tile, axis=2) > 30
    assert 0.03 < colourful.mean() < 0.6
