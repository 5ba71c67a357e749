"""Hands and bare arms before the trunk are found by the colours of the head."""

import cv2
import numpy as np
import pytest

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.head_colours import ColourCrop, HeadColours, quantise
from silhouette_core.image.raster import render_parts
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.colour_evidence import ColourEvidence
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.window import look_at
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.silhouette_error import posed_mesh
from tests.silhouette_core.monocular.filming import (
    STATURE_M,
    body,
    camera_at,
    joints_at,
    window_pixels,
)

CAMERA = camera_at((0.0, -4.0, 1.2))
SKIN, SHIRT, WALL = (130, 160, 215), (60, 90, 40), (120, 118, 125)
BARE = ("neck", "head", "forearm", "hand", "thumb", "fingers")


def folded_arms():
    """Forearms before the belly."""
    model = body()
    angles = np.zeros(model.dof_count)
    for side in ("left", "right"):
        for name, degrees in (
            ("upper_arm.forward", 25), ("upper_arm.twist", 50), ("forearm.flexion", 95),
        ):  # fmt: skip
            angles[model.tree.dof_names.index(f"{side}_{name}")] = np.radians(degrees)
    low, high = model.tree.dof_limits_rad.T
    return model, Pose(np.array([0.0, 0, 0.95]), np.eye(3), np.clip(angles, low, high))


@pytest.fixture(scope="module")
def scene():
    """Person in front of the camera, and how much of every pixel of the picture is bare."""
    model, pose = folded_arms()
    seen = posed_mesh(model, pose) @ CAMERA.rotation.T + CAMERA.translation
    parts = render_parts(seen, model.faces, model.face_part, CAMERA.matrix, CAMERA.size)[0]
    bare_parts = [any(name in part for name in BARE) for part in model.names]
    bare = np.array([False, *bare_parts])[parts]
    mask = parts > 0
    rng = np.random.default_rng(0)
    picture = np.where(bare[..., None], SKIN, np.where(mask[..., None], SHIRT, WALL))
    picture = np.clip(picture + rng.normal(0, 4, picture.shape), 0, 255).astype(np.uint8)
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    corner = int(columns[0]), int(rows[0])
    part = picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return Person(mask, False, ColourCrop.of(part, corner)), bare, joints_at(model, pose)


def through(window, mask):
    """What a window shows of a mask of the camera."""
    height, width = window.mask.shape
    u, v = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    seen = CAMERA.project(window.unproject(np.column_stack([u.ravel(), v.ravel()]), 4.0))[0]
    maps = seen.reshape(height, width, 2).astype(np.float32)
    return cv2.remap(mask.astype(np.float32), maps, None, cv2.INTER_LINEAR) > 0.5


def test_arms_before_the_trunk_have_the_colours_of_the_head(scene):
    person, bare, joints = scene
    evidence = ColourEvidence(CAMERA)
    window = look_at(CAMERA, person.mask, 4.0, STATURE_PX / STATURE_M)
    assert evidence.inside(window, person) is None
    assert evidence.learn([person] * 3, [joints] * 3)
    inside = evidence.inside(window, person)
    assert inside is not None and inside.skin.shape == inside.shading.shape == (60, 80)
    found = inside.skin
    truth = through(window, bare).reshape(60, 4, 80, 4).sum(axis=(1, 3)) / 4
    assert np.abs(found - truth).mean() < 0.02 * 4
    for name in ("left_wrist", "right_wrist"):
        u, v = window_pixels(window, joints[LANDMARK_NAMES.index(name)])[0] / 4
        assert found[int(v) - 1 : int(v) + 2, int(u) - 1 : int(u) + 2].max() >= 3
    u, v = window_pixels(window, joints[LANDMARK_NAMES.index("left_knee")])[0] / 4
    assert not found[int(v) - 1 : int(v) + 2, int(u) - 1 : int(u) + 2].any()


def test_shading_is_that_of_the_surface_whatever_its_colour(scene):
    """The upper half of the picture is lit twice as brightly."""
    person, _, joints = scene
    window = look_at(CAMERA, person.mask, 4.0, STATURE_PX / STATURE_M)
    middle = person.colours.bins.shape[0] // 2
    picture = np.full((*person.colours.bins.shape, 3), SHIRT, np.uint8)
    picture[:, ::2] = SKIN
    picture[middle:] //= 2
    lit = Person(person.mask, False, ColourCrop.of(picture, person.colours.corner))
    evidence = ColourEvidence(CAMERA)
    evidence.learn([person, lit, lit, lit], [joints] * 4)
    inside = evidence.inside(window, lit)
    assert inside is not None
    shading = inside.shading.astype(int) - 32
    covered = window.mask.reshape(60, 4, 80, 4).sum(axis=(1, 3)) == 16
    upper, lower = shading[:27][covered[:27]], shading[36:][covered[36:]]
    # The colours' means lie between, nearer to the half with more pixels.
    assert np.median(upper) - np.median(lower) == pytest.approx(48 * np.log(2), abs=4)
    assert upper.std() < 3 and lower.std() < 3
    assert np.median(lower) < 0 < np.median(upper)
    assert not shading[window.mask.reshape(60, 4, 80, 4).sum(axis=(1, 3)) == 0].any()


def test_people_without_colours_are_passed_over(scene):
    person, _, joints = scene
    evidence = ColourEvidence(CAMERA)
    window = look_at(CAMERA, person.mask, 4.0, STATURE_PX / STATURE_M)
    assert not evidence.learn([Person(person.mask, False)], [joints])
    assert evidence.learn([person, Person(person.mask, False)] * 3, [joints] * 6)
    assert evidence.inside(window, Person(person.mask, False)) is None


def test_a_head_behind_the_camera_teaches_nothing(scene):
    person, _, joints = scene
    assert not ColourEvidence(CAMERA).learn([person] * 3, [joints - (0, 9, 0)] * 3)


def test_clothes_of_the_same_colours_are_not_taken_for_skin():
    rng = np.random.default_rng(0)
    picture = np.clip(rng.normal(SKIN, 4, (100, 50, 3)), 0, 255).astype(np.uint8)
    colours, person = HeadColours(), np.ones((100, 50), bool)
    head = person & (np.arange(100) < 20)[:, None]
    colours.add(quantise(picture), head, person)
    likelihood = colours.likelihood()
    assert likelihood is not None
    assert likelihood[quantise(picture)].mean() == pytest.approx(0.5, abs=0.1)


def test_colours_that_nobody_has_are_no_evidence(scene):
    person, _, _ = scene
    colours = HeadColours()
    assert colours.likelihood() is None
    head = np.zeros(person.colours.bins.shape, bool)
    head[:40] = True
    colours.add(person.colours.bins, head, person.colours.part(person.mask))
    likelihood = colours.likelihood()
    assert likelihood is not None
    blue = quantise(np.full((1, 1, 3), (255, 30, 10), np.uint8))
    assert likelihood[blue] < 0.05
