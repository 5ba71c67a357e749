"""Silhouettes are cut anew where the body was found."""

from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.estimator import Settings
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.progress import SilentReporter, StageClock
from silhouette_core.refinement.observation import PinholeViews
from tests.voxelpose.multiview.carving.carving_scenes import look_at
from tests.voxelpose.multiview.matching_scenes import (
    board_on_floor,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.silhouettes.body_evidence import BodyEvidence, cut_by_bodies
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.prepared_silhouettes import (
    Footage,
    PreparationSettings,
    PreparedSilhouettes,
)

VIEWS, BODY = views(2, (240, 240)), other_body()
PLACES = [(x, 0.5 * x) for x in np.linspace(-0.9, 0.5, 8)]
POSES = [stance(BODY, place_m=place) for place in PLACES]
CLOTHES, WALL = np.array((88.0, 84, 80)), np.array((170.0, 175, 180))
SHADOW = 0.55  # of the wall's brightness: as dark as the clothes


class Walk:
    """Somebody walks, beside whom lies a shadow as dark as the clothes; nobody filmed the empty
    view, and one camera's pictures come a frame late.
    """

    rig, fps, frame_count, silhouettes_given, late = VIEWS.rig, 10.0, len(PLACES), False, (0, 1)

    def __init__(self):
        rng = np.random.default_rng(7)
        self.truth = [photograph(VIEWS, BODY, pose) for pose in POSES]
        self.pictures = []
        for t in range(len(PLACES)):
            shown = {}
            for c, name in enumerate(self.rig.names):
                at = max(t - self.late[c], 0)
                x, y = PLACES[at]
                body, shadow = self.truth[at][c], board_on_floor(VIEWS, (x + 0.05, y - 0.9))[c]
                picture = np.where(shadow[..., None], SHADOW * WALL, WALL)
                picture[body] = CLOTHES + rng.normal(0, 8, (np.count_nonzero(body), 1))
                picture = cv2.GaussianBlur(picture, (0, 0), 0.7)
                picture += rng.normal(0, 2, picture.shape)
                shown[name] = np.rint(picture).clip(0, 255).astype(np.uint8)
            self.pictures.append(shown)

    def __iter__(self):
        for t, shown in enumerate(self.pictures):
            yield t, t / self.fps, shown

    def at(self, steps):
        return (self.pictures[t] for t in steps)

    def backgrounds(self):
        return {}

    regions = unknown = backgrounds


@pytest.fixture(scope="module")
def walk():
    return Walk()


@pytest.fixture(scope="module")
def prepared(walk):
    """The silhouettes as they are found without a body, in step."""
    lenses = [UndistortedView.from_camera(camera, None) for camera in walk.rig]
    late = dict(zip(walk.rig.names, walk.late, strict=True))
    footage = Footage(walk, Settings(), lenses, late)
    store = MaskStore([camera.size for camera in walk.rig], len(PLACES))
    silhouettes = footage.silhouettes()
    for t, (_, _, frames) in enumerate(walk):
        found = silhouettes.of(frames)
        store.put(t, [found[name] for name in walk.rig.names])
    store.advance([0, 1])
    observer = SimpleNamespace(views=VIEWS)
    at = np.arange(len(PLACES)), np.arange(len(PLACES)) / walk.fps
    settings = PreparationSettings(0.02, 0, "off")
    yield PreparedSilhouettes(store, observer, None, walk.rig, *at, {}, settings, footage)
    store.close()


def overlaps(store, truth):
    """Intersection over union with the truth at all moments but the last, (T - 1, 2)."""
    return np.array(
        [
            [
                np.count_nonzero(mask & true) / np.count_nonzero(mask | true)
                for mask, true in zip(store[t], masks, strict=True)
            ]
            for t, masks in enumerate(truth[:-1])
        ]
    )


def cut(prepared, poses):
    return cut_by_bodies(prepared, [(BODY, poses)], StageClock(), SilentReporter())


def test_a_shadow_in_the_colours_of_the_clothes_is_cut_off(walk, prepared):
    before = overlaps(prepared.store, walk.truth)
    assert before.mean() < 0.75
    with cut(prepared, POSES) as again:
        assert overlaps(again.store, walk.truth).min() > 0.93


def test_a_wrong_pose_does_not_make_itself_right(walk, prepared):
    aside = [replace(pose, root_m=pose.root_m + np.array([0.1, 0.2, 0])) for pose in POSES]
    drawn = [photograph(VIEWS, BODY, pose) for pose in aside]
    with cut(prepared, aside) as again:
        assert overlaps(again.store, drawn).mean() < 0.7
        assert overlaps(again.store, walk.truth).mean() > overlaps(again.store, drawn).mean()


def test_without_a_pose_pixels_decide(prepared):
    with cut(prepared, [None] * len(POSES)) as again:
        for t in range(len(POSES) - 1):
            assert all(map(np.array_equal, again.store[t], prepared.store[t]))


def test_a_body_is_drawn_where_the_lens_shows_it():
    camera = look_at("cam", (2.5, 0.2, 1.2), (0, 0, 0.9), distortion=(-0.3, 0.12, 0, 0, -0.01))
    lens = UndistortedView.from_camera(camera, None)
    rig = Rig((lens.pinhole,))
    pose = stance(BODY)
    odds = BodyEvidence([(BODY, [pose])], rig, Rig((camera,)), [0])("cam", 0, camera.size)
    (true,) = photograph(PinholeViews.from_rig(rig), BODY, pose)
    seen = lens.undistort(odds > 0)
    assert np.count_nonzero(seen & true) > 0.95 * np.count_nonzero(seen | true)
    assert np.abs(odds).max() == pytest.approx(4.5)


def test_of_several_bodies_the_one_that_says_most_is_asked():
    (near, far), (camera, _) = (stance(BODY), stance(BODY, place_m=(0.3, 0.9))), VIEWS.rig
    places = VIEWS.rig, VIEWS.rig, [0, 0]

    def odds(*poses):
        evidence = BodyEvidence([(BODY, [pose]) for pose in poses], *places)
        return evidence(camera.name, 0, camera.size)

    apart = [odds(near), odds(far)]
    assert np.array_equal(odds(near, far), np.maximum(*apart))
    # Somebody who was not found may be anywhere: nothing speaks against any pixel.
    assert np.array_equal(odds(near, None), np.maximum(apart[0], 0))
