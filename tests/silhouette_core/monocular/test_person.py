"""Which piece of a silhouette image is the person."""

import numpy as np
import pytest

from silhouette_core.monocular.person import find_person, upright_distance
from tests.silhouette_core.monocular.filming import (
    STATURE_M,
    body,
    camera_at,
    performed,
    poses_of,
    silhouette,
)


def picture(*boxes, shape=(240, 320)):
    mask = np.zeros(shape, bool)
    for top, left, bottom, right in boxes:
        mask[top:bottom, left:right] = True
    return mask


BODY, ARM = (60, 140, 200, 180), (110, 180, 120, 214)
NEAR = {"near_px": np.array([160.0, 130.0]), "usual_px": 5600.0}


@pytest.mark.parametrize(
    ("person", "others"),
    [
        pytest.param(
            [BODY, (100, 186, 112, 196)], [(70, 184, 72, 186), (20, 20, 60, 50)], id="a hand"
        ),
        # The first reflection lies within the box about the body and its arm.
        pytest.param([BODY, ARM], [(66, 200, 78, 212)], id="a reflection"),
        pytest.param([BODY, ARM], [(100, 234, 112, 246)], id="a reflection, farther away"),
        pytest.param([BODY], [(210, 100, 280, 230)], id="a larger board on the floor"),
        pytest.param([BODY], [(300, 100, 370, 230)], id="a larger board, farther away"),
        # The shirt has the wall's colour: head and arms, and the smaller legs.
        pytest.param([(40, 120, 120, 200), (130, 140, 230, 174)], [], id="halves"),
        pytest.param([(180, 60, 220, 220)], [(20, 20, 60, 30)], id="who lies"),
    ],
)
def test_the_person_is_the_largest_piece_with_what_is_nearer_than_it_is_large(person, others):
    result = find_person(picture(*person, *others, shape=(480, 320)))
    expected = picture(*person, shape=(480, 320))
    assert result is not None and (result.mask == expected).all() and not result.cut


def test_a_piece_may_hang_on_a_piece():
    """The shirt has the wall's colour: the head, 45 px above the legs, lies near an arm."""
    legs, head, arm = (110, 140, 230, 174), (20, 150, 44, 170), (50, 142, 100, 150)
    result, without = find_person(picture(legs, arm, head)), find_person(picture(legs, head))
    assert result is not None and result.mask[picture(head)].all()
    assert without is not None and not without.mask[picture(head)].any()


def test_nobody_and_crumbs_are_no_person():
    assert find_person(picture()) is None
    assert find_person(picture((10, 10, 20, 20))) is None
    small = picture((100, 100, 120, 120))
    assert find_person(small) is not None
    assert find_person(small, usual_px=5000.0) is None


@pytest.mark.parametrize(
    "larger", [(40, 10, 220, 60), (20, 240, 220, 296)], ids=["other", "passer-by"]
)
def test_a_piece_where_the_person_was_wins_over_a_larger_one(larger):
    """Who passes by is twice as large, a person's height away."""
    for known, expected in (({}, picture(larger)), (NEAR, picture(BODY))):
        result = find_person(picture(BODY, larger), **known)
        assert result is not None and (result.mask == expected).all()
    gone = find_person(picture((20, 240, 220, 296)), **NEAR)
    assert gone is not None and (gone.mask == picture((20, 240, 220, 296))).all()


@pytest.mark.parametrize(
    "box", [(0, 140, 120, 180), (120, 140, 240, 180), (60, 0, 200, 40), (60, 280, 200, 320)]
)
def test_a_person_at_the_border_is_cut(box):
    result = find_person(picture(box))
    assert result is not None and result.cut


def test_a_toe_at_the_border_does_not_count():
    result = find_person(picture(BODY, (200, 150, 240, 153)))
    assert result is not None and not result.cut


@pytest.mark.parametrize("place", [(0, -4, 1.3), (2, -3, 2.2), (0, -7, 0.8)])
def test_the_distance_of_somebody_upright(place):
    camera = camera_at(place, size=(640, 480))
    pose = poses_of(performed("wave"))[0]
    distance = upright_distance(camera, silhouette(body(), pose, camera), STATURE_M)
    assert distance == pytest.approx(np.linalg.norm(camera.center_m - pose.root_m), rel=0.09)
