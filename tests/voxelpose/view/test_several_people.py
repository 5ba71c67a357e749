"""Several people in one scene."""

import numpy as np
import pytest

from tests.clips import waving_couple
from tests.voxelpose.multiview.carving.carving_scenes import voxels_at
from voxelpose.cli import run
from voxelpose.people_marks import COLOURS
from voxelpose.view.images.hull_picture import skeleton_of
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.legend import legend_html
from voxelpose.view.viewer.result_scenes import ResultScenes
from voxelpose.view.viewer.scene import frame_html
from voxelpose.view.viewer.silhouette_page import FitSilhouettes


@pytest.fixture
def scenes(couple):
    opened = ResultScenes(couple, voxel_size_m=0.04)
    yield opened
    opened.close()


def test_everybody_is_in_the_hull_and_nobody_leaves_the_others_unexplained(scenes):
    scene = scenes.scene(3)
    alone = ResultScenes(f"{scenes.title}/person_2", voxel_size_m=0.04)
    hull, (first, second) = scene.hull, scene.bodies
    for body, motion in zip(scene.bodies, waving_couple(5), strict=True):
        row = motion.frames.tolist().index(3)
        np.testing.assert_allclose(body.joints_m[0], motion.root_m[row], atol=1e-6)
        inside = voxels_at(hull.grid, body.joints_m)
        assert hull.occupancy[tuple(inside.T)].mean() > 0.85
        # What one explains the other need not.
        unexplained = voxels_at(hull.grid, hull.unexplained_m).tolist()
        assert not [voxel for voxel in inside.tolist() if voxel in unexplained]
    assert np.linalg.norm(first.joints_m[0] - second.joints_m[0]) > 1
    own = alone.scene(3).hull
    assert own.litres(own.occupancy) < 0.7 * hull.litres(hull.occupancy)
    alone.close()


def test_who_has_no_pose_is_named(scenes):
    scene = scenes.scene(1)
    assert scene.bodies[1] is None and scene.hull.occupancy.any()
    assert scene.notes == ("no pose of person 2 was found in this frame",)
    shown = frame_html(scenes.scene(3))
    assert "Person 1: Little inside" in shown and "Person 2: Little inside" in shown
    assert scenes.areas(3) == {} and scenes.limb_names == ()


def test_pictures_have_the_colours_of_people(scenes, couple):
    skeleton = skeleton_of(scenes.scene(3))
    assert {colour[::-1] for colour in skeleton.colours} == set(COLOURS[:2])
    assert skeleton.bones.max() == len(skeleton.joints_m) - 1
    for words in (["--png", "a.png"], ["--video", "a.webm"]):
        assert run(["view", "couple", "--voxel", "0.06", *words]) == 0
        assert (couple.parent / words[1]).stat().st_size > 1000
    assert "person 2" in legend_html(False, 2) and "Part inside" not in legend_html(False, 2)


def test_everybody_is_outlined_among_the_silhouettes(scenes):
    evidence = FitSilhouettes(scenes)
    frames = scenes.reader._read(3)
    found = evidence.of(3, frames, evidence.model(False))
    for one in found.values():
        assert np.count_nonzero(one.body & one.used) / np.count_nonzero(one.body | one.used) > 0.85


def test_people_are_switched_on_and_off(scenes):
    browser = Browser(scenes, Address(port=8398), 3)
    assert browser.step(1.0)
    first, second = browser._renderer._bodies
    assert all(mesh.color == COLOURS[1] for mesh in second._meshes)
    browser._choose(shown=browser.choice.shown - {"person_2"})
    assert browser.step(1.0)
    assert all(mesh.visible for mesh in first._meshes)
    assert not any(mesh.visible for mesh in second._meshes)
    browser.close()
