"""The picture of a rig is drawn whatever its size."""

from dataclasses import replace

import numpy as np
import pytest

from calib.camera import Rig
from tests.sources import ring
from voxelpose.calibration import rig_picture
from voxelpose.calibration.rig_picture import rig_picture as draw


@pytest.mark.parametrize("far_m", [3.0, 300.0, 1e6])
def test_a_camera_far_away_is_drawn_with_few_lines(monkeypatch, far_m):
    lines = []
    monkeypatch.setattr(
        rig_picture, "stroke", lambda image, points, *args, **options: lines.append(points)
    )
    near = ring(3)
    far = replace(near.cameras[0], name="far", translation=np.array([0.0, 0.0, far_m]))
    picture = draw(Rig((*near, far)))
    assert picture.shape[0] < 3000 and picture.shape[1] < 3000
    assert 10 < len(lines) < 400


def test_lines_are_a_metre_apart_where_they_can_be_seen():
    assert [rig_picture._spacing_m(extent) for extent in (8.0, 60.0, 300.0, 1e6)] == [
        *(1, 2, 10),
        20_000,
    ]
