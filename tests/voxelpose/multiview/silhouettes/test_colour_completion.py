"""The person's colours are learned and found in the pictures of all cameras, in step."""

from contextlib import closing, contextmanager

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.image.person_colours import ColouredSilhouette
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.progress import SilentReporter, StageClock
from tests.voxelpose.multiview.carving.carving_scenes import look_at
from tests.voxelpose.multiview.matching_scenes import other_body, photograph, stance, views
from tests.voxelpose.multiview.silhouettes.test_completion import overlap, without_clothes
from voxelpose.multiview.silhouettes.colour_completion import ColourFinder
from voxelpose.multiview.silhouettes.mask_store import MaskStore, mask_stores
from voxelpose.multiview.silhouettes.prepared_silhouettes import (
    PreparationSettings,
    _Preparation,
)

COUNT, SIZE = 6, (64, 48)
COLOUR = (40, 90, 200)
LATE = {"cam_2": 2}
RIG = Rig(tuple(look_at(f"cam_{k}", (3, k, 1), (0, 0, 1), SIZE, 60) for k in (1, 2)))
LENSES = [UndistortedView.from_camera(camera, None) for camera in RIG]


def square(moment):
    """Where the person is at a moment."""
    mask = np.zeros(SIZE[::-1], bool)
    mask[10:30, 5 + 6 * moment : 20 + 6 * moment] = True
    return mask


class Film:
    """Camera 2 shows everything two frames late."""

    rig, frame_count, fps = RIG, COUNT, 30.0

    def __iter__(self):
        for t in range(COUNT):
            pictures = {}
            for name in RIG.names:
                pictures[name] = np.full((*SIZE[::-1], 3), 255, np.uint8)
                pictures[name][square(max(t - LATE.get(name, 0), 0))] = COLOUR
            yield t, t / 30, pictures


class ByColour:
    """Finds the density's likeliest colour."""

    colours_tell = True

    def of_colours(self, frames, density):
        likeliest = np.array(np.unravel_index(density.log_density.argmax(), (32, 32, 32)))
        masks = {name: (frame >> 3 == likeliest).all(axis=2) for name, frame in frames.items()}
        return {name: ColouredSilhouette(mask, ~mask) for name, mask in masks.items()}


@pytest.fixture
def finder():
    return ColourFinder(Film(), ByColour(), LENSES, LATE, StageClock(), SilentReporter())


def test_colours_are_found_in_step(finder):
    with closing(MaskStore([SIZE, SIZE], COUNT)) as store:
        assert finder.learn(store) is None  # nobody is seen
        for t in range(COUNT):
            store.put(t, [square(t), square(min(t, COUNT - 3))])
        density = finder.learn(store)
        assert density is not None
        likeliest = density.log_density[tuple(value >> 3 for value in COLOUR)]
        assert likeliest == density.log_density.max()
        white = density.log_density[31, 31, 31]
        assert white == pytest.approx(np.log(0.01 / 256**3), abs=0.01)  # no background is learned
        with finder.find(density) as (likely, alike):
            for t in range(COUNT - 2):
                for c in range(2):
                    assert (likely[t][c] == square(t)).all() and (alike[t][c] == ~square(t)).all()


class Found:
    """A finder that finds the given silhouettes in every frame."""

    useful = True

    def __init__(self, likely, count):
        self.likely, self.count, self.asked = likely, count, 0

    def learn(self, store):
        self.asked += 1
        return object()

    @contextmanager
    def find(self, density):
        with mask_stores(2, [mask.shape[::-1] for mask in self.likely], self.count) as stores:
            for store in stores:
                for t in range(self.count):
                    store.put(t, self.likely)
            yield stores


@pytest.fixture
def holed():
    """Preparation of three moments at which two of four cameras miss the shirt, and the truth."""
    seen_by, body = views(4), other_body()
    truth = photograph(seen_by, body, stance(body, {"left_upper_arm.abduction": 40.0}))
    masks = [*map(without_clothes, truth[:2]), *truth[2:]]
    sizes = [camera.size for camera in seen_by.rig]
    with mask_stores(2, sizes, 3) as stores:
        for t in range(3):
            stores[0].put(t, masks)
        settings = PreparationSettings(0.02, 0, "off")
        work = _Preparation(Film(), stores, None, settings, StageClock(), SilentReporter())
        yield work, seen_by.rig, truth, masks


def test_what_colours_explain_is_kept(holed):
    work, rig, truth, masks = holed
    before = work.stores[0].pixels()
    assert work.complete_by_colours(Found(truth, 3), rig)
    share = work.stores[0].pixels() / before - 1
    assert (share[:2] > 0.1).all() and (share[2:] < 0.01).all()
    for c in range(2):
        assert overlap(work.stores[0][1][c], truth[c]) > 0.97 > 0.9 > overlap(masks[c], truth[c])


def test_colours_that_explain_little_are_taken_back(holed):
    """As where a chair in some silhouettes is what the hull does not explain."""
    work, rig, truth, masks = holed
    little = [without_clothes(mask, (0.285, 0.45)) for mask in truth]
    finder = Found(little, 3)
    with finder.find(None) as coloured:
        before = work.stores[0].pixels()
        work.complete(rig, coloured)
        assert (work.stores[0].pixels() > 1.01 * before).any()
    for t in range(3):
        work.stores[0].put(t, masks)
    assert not work.complete_by_colours(finder, rig) and finder.asked == 1
    for t in range(3):
        for mask, stored in zip(masks, work.stores[0][t], strict=True):
            assert (mask == stored).all()


def test_whole_silhouettes_are_not_asked_for_colours(holed):
    work, rig, truth, _ = holed
    for t in range(3):
        work.stores[0].put(t, truth)
    finder = Found(truth, 3)
    assert not work.complete_by_colours(finder, rig) and not finder.asked
