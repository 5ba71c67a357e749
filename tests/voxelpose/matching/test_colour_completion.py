"""The person's colours are learned and found in the pictures of all cameras, in step."""

from contextlib import closing

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.image.person_colours import ColouredSilhouette
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.progress import SilentReporter
from tests.voxelpose.carving.carving_scenes import look_at
from voxelpose.matching.colour_completion import ColourFinder
from voxelpose.matching.mask_store import MaskStore

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
    return ColourFinder(Film(), ByColour(), LENSES, LATE, SilentReporter())


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
