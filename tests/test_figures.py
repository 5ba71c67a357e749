"""The drawings of docs/ show what the program does."""

import numpy as np
import pytest

from calib.board import BoardView
from docs.figures import angle_signs, board_on_floor, camera_places, silhouette_quality
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.anatomical import anatomical_angles


def test_the_drawn_board_is_found_with_its_first_corner_at_the_origin():
    camera = board_on_floor.view_camera()
    found = board_on_floor.BOARD.find(board_on_floor.board_seen(camera))
    assert isinstance(found, BoardView)
    world = board_on_floor.BOARD.points_m @ board_on_floor.WORLD_FROM_BOARD.T
    assert np.abs(found.pixels - camera.project(world)[0]).max() < 0.5
    assert not world[0].any()
    assert (world[:, 0] >= 0).all() and (world[:, 1] <= 0).all()


@pytest.mark.parametrize("count", camera_places.PLACES)
def test_every_camera_of_a_plan_sees_the_whole_volume(count):
    angle = np.linspace(0, 2 * np.pi, 37)
    circle = camera_places.VOLUME_RADIUS_M * np.column_stack([np.cos(angle), np.sin(angle)])
    rim = np.vstack([np.insert(circle, 2, z, axis=1) for z in (0.0, camera_places.REACH_M)])
    for camera in camera_places.rig_of(camera_places.PLACES[count]):
        pixels, _ = camera.project(rim)
        assert (pixels >= 0).all() and (pixels <= np.array(camera.size) - 1).all(), camera.name


def test_no_two_cameras_of_a_plan_face_each_other():
    for places in camera_places.PLACES.values():
        azimuths = np.array([azimuth for azimuth, _ in places]) % 180
        apart = np.abs(azimuths[:, None] - azimuths)
        np.fill_diagonal(apart, 90)
        assert np.minimum(apart, 180 - apart).min() >= 180 / len(places) - 1e-9


@pytest.mark.parametrize("sign", angle_signs.SIGNS[::3], ids=lambda sign: sign.angle)
def test_a_drawn_pose_has_the_angle_under_it(sign):
    model = BodyModel.from_sizes(BodySizes(1.7, sex="male"))
    motion = angle_signs.motion_of(model, {**sign.others, sign.angle: sign.degrees})
    found = anatomical_angles(motion)
    for name, degrees in {**sign.others, sign.angle: sign.degrees}.items():
        assert found[name][0] == pytest.approx(degrees, abs=1.0)


def test_filming_well_pays(tmp_path):
    good, shadow = (
        silhouette_quality.film(case, tmp_path / case.title)[1:]
        for case in silhouette_quality.CASES[:2]
    )
    missing, extra = ((a & ~b).sum() for a, b in ((good[1], good[0]), (shadow[0], shadow[1])))
    assert missing < 0.05 * good[1].sum() < extra
