"""The picture of a rig is drawn whatever its size."""

from dataclasses import replace

import numpy as np
import pytest

from calib.camera import Rig
from tests.sources import ring
from voxelpose.calibration.pictures import _shade, rig_picture


@pytest.mark.parametrize("far_m", [3.0, 300.0, 1e6])
def test_a_camera_far_away_is_drawn(far_m):
    near = ring(3)
    far = replace(near.cameras[0], name="far", translation=np.array([0.0, 0.0, far_m]))
    picture = rig_picture(Rig((*near, far)))
    assert picture.shape == rig_picture(near).shape and picture.dtype == np.uint8
    # Not only paper: cameras, axes and names are there.
    assert (picture != picture[0, 0]).any(axis=2).mean() > 0.01


def test_what_more_cameras_see_is_brighter():
    shades = _shade(np.array([[0, 1, 2, 3, 4]]), 4).sum(axis=2)[:, 0]
    assert shades[0] == shades[1] and (np.diff(shades[1:]) > 0).all()
