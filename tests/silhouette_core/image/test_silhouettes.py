"""Views without lens distortion: silhouettes, and parts of the pictures that they come from."""

import numpy as np
import pytest

from silhouette_core.image.silhouettes import UndistortedView
from tests.sources import ring


@pytest.mark.parametrize("distortion", [(), (-0.2, 0.05, 0.0, 0.0)])
@pytest.mark.parametrize("scale", [1, 2])
def test_a_part_of_a_picture_is_undistorted_as_its_silhouette_is(distortion, scale):
    camera = ring(1, (320, 240), distortion).cameras[0]
    lens = UndistortedView.from_camera(camera, 320 // scale)
    mask = np.zeros((240, 320), bool)
    mask[40:200, 90:200] = True
    picture = np.repeat(mask[..., None].astype(np.uint8) * 255, 3, axis=2)
    whole = lens.undistort(mask[scale // 2 :: scale, scale // 2 :: scale])
    corner, size = (50 // scale, 30 // scale), (120 // scale, 140 // scale)
    part = lens.undistort_part(picture, corner, size)
    assert part.shape == (size[1], size[0], 3)
    seen = whole[corner[1] : corner[1] + size[1], corner[0] : corner[0] + size[0]]
    assert ((part[..., 1] > 127) != seen).mean() < 0.02 and seen.any() and not seen.all()
