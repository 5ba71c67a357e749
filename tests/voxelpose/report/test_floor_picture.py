"""The picture of the body: whole, on its floor, and of a moment that shows something."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.motion.gait import find_gait
from tests.clips import walking, waving
from voxelpose.report.floor_picture import SIZE, floor_picture, telling_row
from voxelpose.view.images.canvas import INK


@pytest.mark.parametrize("turned_deg", [0, 70, 180])
def test_the_body_is_seen_whole_wherever_it_is(turned_deg):
    motion = waving(4)
    half = np.radians(turned_deg) / 2
    quaternion = np.tile([np.cos(half), 0, 0, np.sin(half)], (4, 1))
    motion = replace(
        motion, root_m=motion.root_m + np.array([3.0, -5.0, 0]), root_quaternion=quaternion
    )
    picture = floor_picture(motion, 2)
    assert picture.shape == (SIZE[1], SIZE[0], 3) and picture.dtype == np.uint8
    rows, columns = np.nonzero((picture == INK).all(axis=2))  # the outline
    assert np.ptp(rows) > SIZE[1] / 2
    assert rows.min() > 5 and rows.max() < SIZE[1] - 6
    assert columns.min() > 5 and columns.max() < SIZE[0] - 6
    # From the same side of the body, whatever way it faces: a raised arm and a bent knee are wide.
    straight = replace(motion, root_quaternion=np.tile([1.0, 0, 0, 0], (4, 1)))
    _, expected = np.nonzero((floor_picture(straight, 2) == INK).all(axis=2))
    assert np.ptp(columns) == pytest.approx(np.ptp(expected), rel=0.1)


def test_of_a_gait_a_contact_is_shown_else_the_best_agreement():
    motion = walking()
    gait = find_gait(motion)
    assert gait is not None
    row = telling_row(motion, gait)
    contacts = np.concatenate([*gait.contacts_s.values()])
    assert np.abs(contacts - motion.time_s[row]).min() <= 0.5 / motion.fps
    agreement = np.linspace(0.5, 0.9, 6)
    agreement[5] = np.nan
    assert telling_row(replace(waving(6), quality={"outline_agreement": agreement}), None) == 4
    assert telling_row(replace(waving(6), quality={}), None) == 3
