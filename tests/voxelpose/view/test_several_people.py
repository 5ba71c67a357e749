"""Several people in one scene."""

import cv2
import numpy as np
import pytest

from tests.browsing import new_page, until
from tests.clips import waving_couple
from tests.voxelpose.multiview.carving.carving_scenes import voxels_at
from voxelpose.cli import run
from voxelpose.people_marks import COLOURS
from voxelpose.view.images.hull_picture import skeleton_of
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.result_scenes import ResultScenes
from voxelpose.view.viewer.scene import frame_lines
from voxelpose.view.viewer.silhouette_page import FitSilhouettes


@pytest.fixture(scope="module")
def scenes(couple_once):
    opened = ResultScenes(couple_once, voxel_size_m=0.04)
    yield opened
    opened.close()


def test_everybody_is_in_the_hull_and_nobody_leaves_the_others_unexplained(scenes, couple_once):
    scene = scenes.scene(3)
    alone = ResultScenes(couple_once / "person_2", voxel_size_m=0.04)
    hull, (first, second) = scene.hull, scene.bodies
    for body, motion in zip(scene.bodies, waving_couple(5), strict=True):
        row = motion.frames.tolist().index(3)
        np.testing.assert_allclose(body.joints_m[0], motion.root_m[row], atol=1e-6)
        inside = voxels_at(hull.grid, body.joints_m)
        assert hull.occupancy[tuple(inside.T)].mean() > 0.85
        # What one explains the other need not.
        assert hull.far[tuple(inside.T)].mean() < 0.1  # but finger tips between coarse voxels
    assert np.linalg.norm(first.joints_m[0] - second.joints_m[0]) > 1
    own = alone.scene(3).hull
    assert own.litres(own.occupancy) < 0.7 * hull.litres(hull.occupancy)
    alone.close()


def test_who_has_no_pose_is_named(scenes):
    scene = scenes.scene(1)
    assert scene.bodies[1] is None and scene.hull.occupancy.any()
    assert scene.notes == ("no pose of person 2 was found in this frame",)
    lost = scenes.scene(1).hull.nearest.person
    assert set(np.unique(lost)) == {-1, 0}  # who is lost has no part of the hull
    hull = scenes.scene(3).hull
    litres = [hull.litres(hull.nearest.person == k) for k in range(2)]
    assert min(litres) > 20 and sum(litres) == pytest.approx(hull.litres(hull.occupancy))
    for k, name in enumerate(("Person 1", "Person 2")):
        words = [text for person, text in frame_lines(scenes.scene(3)) if person == k]
        assert words[0].startswith(f"{name}: Little inside")
        assert f"{name}: Hull {litres[k]:.0f} litres." in words


def test_pictures_have_the_colours_of_people(scenes, couple):
    skeleton = skeleton_of(scenes.scene(3))
    assert {colour[::-1] for colour in skeleton.colours} == set(COLOURS[:2])
    assert skeleton.bones.max() == len(skeleton.joints_m) - 1
    for words in (["--png", "a.png"], ["--video", "a.webm"]):
        assert run(["view", "couple", "--voxel", "0.06", *words]) == 0
        assert (couple.parent / words[1]).stat().st_size > 1000


def test_everybody_is_outlined_among_the_silhouettes(scenes):
    evidence = FitSilhouettes(scenes)
    frames = scenes.reader._read(3)
    found = evidence.of(3, frames, scenes.reader.silhouettes)
    for one in found.values():
        assert np.count_nonzero(one.body & one.used) / np.count_nonzero(one.body | one.used) > 0.85


@pytest.mark.slow
def test_people_are_switched_on_and_off(scenes):
    browser = Browser(scenes, Address(port=8398), 3)
    with new_page(900, 600) as (page, faults):
        page.goto(browser.url)
        page.get_by_text("Person 2: Little inside").wait_for(timeout=60_000)
        assert page.get_by_label("Colours of the body").input_value() == "person"
        triangles = "viewer.hull.mesh.count / 3"
        whole = page.evaluate(triangles)
        page.get_by_label("Hull", exact=True).uncheck()
        page.get_by_label("Skeleton").uncheck()
        both = _coloured(page)
        page.get_by_label("person 2", exact=True).uncheck()
        first = _coloured(page)
        assert 0.3 < page.evaluate(triangles) / whole < 0.7
        assert "Person 1: Hull" in page.inner_text(".told")
        for place in (".told", ".legend"):
            assert "person 2" not in page.inner_text(place).lower()
        assert both[0] > 100 < both[1] and first[0] > 100 and first[1] < 20, (both, first)
        assert faults == []
    browser.close()


def _coloured(page) -> list[int]:
    """How many pixels of the scene have about the hue of each of two people."""
    until(page, "!viewer.player.wanted")
    page.wait_for_timeout(150)
    data = page.locator("canvas.space").screenshot()
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    hue = cv2.cvtColor(picture, cv2.COLOR_BGR2HSV).astype(int)
    vivid = (hue[..., 1] > 90) & (hue[..., 2] > 90)
    wanted = cv2.cvtColor(np.array([COLOURS[:2]], np.uint8), cv2.COLOR_RGB2HSV)[0, :, 0]
    return [int(np.count_nonzero(vivid & (abs(hue[..., 0] - one) < 8))) for one in wanted]
