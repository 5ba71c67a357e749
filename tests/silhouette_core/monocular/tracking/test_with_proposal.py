"""One camera with the program's proposal: each part of the estimate is worth something."""

import numpy as np
import pytest

from benchmarks.silhouette_source import SilhouetteSource
from silhouette_core.body.sizes import SHAPE_AXES
from silhouette_core.estimator import Settings
from silhouette_core.monocular.monocular_estimator import MonocularEstimator
from silhouette_core.monocular.tracking import trajectory
from silhouette_core.monocular.tracking.colour_evidence import ColourEvidence
from silhouette_core.motion.keyposes import keypose_motions
from silhouette_core.progress import SilentReporter
from tests.silhouette_core.monocular.filming import STATURE_M, body, camera_at, films

pytestmark = pytest.mark.slow

CAMERA = camera_at((1.2, -3.8, 1.9))
FPS = 30.0
STOUT = {"trunk_width": 0.2, "trunk_depth": 0.15, "thigh_girth": 0.2, "upper_arm_girth": 0.15}


@pytest.fixture(scope="module")
def filmed():
    """A stout person's performance of a movement, another than those of the library."""
    stout = body([STOUT.get(axis.name, 0.0) for axis in SHAPE_AXES])
    motion = keypose_motions(stout)["reach aside 2"]
    step = max(1, round(motion.fps / FPS))
    rows = range(0, min(len(motion), 30 * step), step)
    return motion.landmarks()[list(rows)], films(motion, CAMERA, rows)


def track(masks, smooth=True, sex="unknown"):
    settings = Settings(STATURE_M, sex=sex, smooth=smooth, threads=2, options={"start": "any"})
    source = SilhouetteSource(CAMERA, masks, FPS)
    return MonocularEstimator().estimate(source, settings, SilentReporter())


@pytest.fixture(scope="module")
def tracked(filmed):
    return track(filmed[1])


def root_mm(estimate, truth):
    found = estimate.motion.landmarks()
    return 1000 * np.linalg.norm((found - found[:, :1]) - (truth - truth[:, :1]), axis=-1).mean()


def test_the_distance_is_found(tracked, filmed):
    truth, _ = filmed
    apart = np.linalg.norm(tracked.motion.landmarks()[:, 0] - truth[:, 0], axis=-1)
    assert np.median(apart) < 0.04 * np.linalg.norm(truth[0, 0] - CAMERA.center_m)


def test_the_body_is_adapted(tracked):
    stouter = [axis.name in ("trunk_width", "thigh_girth") for axis in SHAPE_AXES]
    assert tracked.motion.model.shape[stouter].mean() > 0.04


def test_frames_are_refined_together(tracked, filmed, monkeypatch):
    def jitter(estimate):
        return np.linalg.norm(np.diff(estimate.motion.landmarks(), 2, axis=0), axis=-1).mean()

    floors = []

    def unrefined(surface, frames, poses, floor, **_):
        floors.append(floor)
        return poses

    monkeypatch.setattr(trajectory, "fit_trajectory", unrefined)
    assert jitter(tracked) < 0.8 * jitter(track(filmed[1]))
    assert floors == [True]  # who stands at z = 0 stands on the floor


def test_hypotheses_are_those_that_decide(tracked):
    """Before frames are refined together, the likeliest hypothesis is the one that was chosen."""
    joints = tracked.motion.landmarks()
    near = [
        np.linalg.norm(poses - joints[frame], axis=-1).mean(axis=-1).min()
        for frame, _, poses in tracked.hypotheses
    ]
    assert np.median(near) < 0.05


def test_nothing_later_is_read_without_smoothing(filmed):
    masks = filmed[1][:14]
    whole, part = (track(some, smooth=False) for some in (masks, masks[:8]))
    np.testing.assert_array_equal(whole.motion.angles_rad[:8], part.motion.angles_rad)


class PaintedSource(SilhouetteSource):
    """The silhouettes as pictures of a red person before a wall."""

    silhouettes_given = False

    def backgrounds(self):
        return {self.camera.name: [np.full((*self.masks[0].shape, 3), 90, np.uint8)] * 4}

    def at(self, steps):
        for pictures in super().at(steps):
            yield {
                name: np.where(picture > 0, (40, 40, 200), 90).astype(np.uint8)
                for name, picture in pictures.items()
            }


@pytest.mark.parametrize("outline_only", [False, True])
def test_colours_are_read_unless_the_outline_is_to_do(outline_only, filmed, monkeypatch):
    learned, learn = [], ColourEvidence.learn

    def counted(self, people, *args):
        learned.append([person.colours is not None for person in people])
        return learn(self, people, *args)

    monkeypatch.setattr(ColourEvidence, "learn", counted)
    options = {"start": "any", "outline_only": outline_only}
    settings = Settings(STATURE_M, threads=2, options=options)
    source = PaintedSource(CAMERA, filmed[1][:8], FPS, silhouettes_given=False)
    estimate = MonocularEstimator().estimate(source, settings, SilentReporter())
    assert estimate.facts["colours"] is not outline_only
    assert learned == [[not outline_only] * 8]
    if not outline_only:  # of eight outlines this small library leaves the heading open
        assert root_mm(estimate, filmed[0][:8]) < 140
