"""Cameras without colour: texture tells clothes from shadows."""

import cv2
import numpy as np
import pytest

from silhouette_core.image.background import BackgroundModel
from silhouette_core.image.difference import Background, FrameView
from silhouette_core.image.grey import is_grey, texture_evidence
from silhouette_core.image.silhouettes import Silhouettes
from tests.sources import GreySource, ring

SIZE = (240, 320)
SHIRT, SHADOW = (slice(60, 150), slice(120, 170)), (slice(180, 215), slice(150, 250))


def film(rng: np.random.Generator, deep: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """An empty room and one with a shirt and a shadow of the same brightness, (H, W, 3) uint8."""
    texture = cv2.GaussianBlur(rng.normal(0, 150, SIZE), (0, 0), 6)
    folds = cv2.GaussianBlur(rng.normal(0, 90, SIZE), (0, 0), 5)
    room = 160 + texture
    taken = room.copy()
    taken[SHIRT] = (105 + deep * folds)[SHIRT]
    taken[SHADOW] *= 0.66
    noisy = (np.rint(image + rng.normal(0, 1.5, SIZE)).clip(0, 255) for image in (room, taken))
    empty, frame = (cv2.merge([image.astype(np.uint8)] * 3) for image in noisy)
    return empty, frame


@pytest.fixture
def filmed() -> tuple[np.ndarray, np.ndarray]:
    return film(np.random.default_rng(5))


def test_a_picture_is_grey_unless_a_person_is_coloured(filmed):
    empty, frame = filmed
    assert is_grey(frame) and BackgroundModel.from_frames([empty]).as_grey([frame]).grey
    frame[SHIRT] += np.array([0, 0, 20], np.uint8)
    assert not is_grey(frame)
    assert not BackgroundModel.from_frames([empty]).as_grey([empty, frame]).grey


def test_texture_speaks_against_a_shadow_where_folds_are_and_for_one_where_the_floor_shows(filmed):
    empty, frame = filmed
    background = Background.from_noise(empty.astype(np.float32), np.full(SIZE, 1.5))
    told = texture_evidence(FrameView.of(frame, background))
    assert (told[SHADOW] < 0).mean() > 0.9
    assert told[SHIRT].mean() > told[SHADOW].mean() + 3
    assert not told[:40].any()


def test_grey_clothes_as_dark_as_a_shadow_are_found_and_the_shadow_is_not(filmed):
    empty, frame = filmed
    model = BackgroundModel.from_frames([empty]).as_grey([frame]).with_colours([frame])
    found = model.silhouette(frame)
    assert found[SHIRT].mean() > 0.8 and found[SHADOW].mean() < 0.1
    assert 0.5 < model.by_texture <= 1
    blind = BackgroundModel.from_frames([empty]).with_colours([frame])
    assert blind.by_texture is None
    assert blind.silhouette(frame)[SHIRT].mean() < 0.5  # by tint, of which there is none


@pytest.mark.parametrize("cameras", [1, 2])
def test_where_several_cameras_see_a_shadow_is_the_person(filmed, cameras):
    """It lies on the floor and costs little there; an arm too few is lost."""
    empty, frame = filmed

    class Room(GreySource):
        def backgrounds(self):
            return {name: [empty] for name in self.rig.names}

        def at(self, steps):
            for _ in steps:
                yield dict.fromkeys(self.rig.names, frame)

    source = Room(ring(cameras, (320, 240)), 12)
    silhouettes = Silhouettes(source)
    found = silhouettes.of(next(source.at([0])))["cam_1"]
    assert found[SHIRT].mean() > 0.8 and not found[:40].any()
    assert (found[SHADOW].mean() > 0.8) == (cameras > 1)
    assert len(silhouettes.by_texture) == cameras
    assert all((share == 0) == (cameras > 1) for share in silhouettes.by_texture.values())


def test_without_colours_whatever_is_darker_may_belong_to_a_silhouette(filmed):
    """Other cameras decide: completion asks for what differs, and nothing grey has a tint."""
    empty, frame = filmed
    blind = BackgroundModel.from_frames([empty])
    told = [model.soft_silhouette(frame).tint for model in (blind, blind.as_grey([frame]))]
    assert [one[SHIRT].mean() > 0.8 for one in told] == [False, True]
    assert told[1][SHADOW].mean() > 0.8 and not told[1][:40].any()


def test_texture_tells_where_no_frame_was_looked_at_beforehand():
    """Live, and with --no-smooth: there are no colours of the person to cut by."""
    empty, frame = film(np.random.default_rng(5), deep=12.0)
    model = BackgroundModel.from_frames([empty]).as_grey(())
    assert model.grey and model.by_texture is None
    window = slice(40, 230), slice(90, 260)
    near = model.silhouette_near(frame, frame[window], window, model.look(frame)[1])
    for found in (model.silhouette(frame), near):
        assert found[SHIRT].mean() > 0.8 and found[SHADOW].mean() < 0.1
    assert BackgroundModel.from_frames([empty]).silhouette(frame)[SHIRT].mean() < 0.7
