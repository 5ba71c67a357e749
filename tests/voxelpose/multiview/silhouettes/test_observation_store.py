"""Hulls of a recording: carved once, read back bit for bit, not held in memory."""

import tracemalloc
from contextlib import closing, nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from silhouette_core.refinement.surface import Surface
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving import observe
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.proposers.pose_search import BodyGeometry
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.tracking.tracking import PoseTracker

VOXEL_M = 0.04
CARVES = 4  # of a frame: the volume, the silhouettes confirmed strictly and loosely, the window
LEFT, RIGHT = np.array([-0.9, 0.0, 0.9]), np.array([0.9, 0.0, 0.9])


@pytest.fixture(scope="module")
def observer():
    volume = VoxelGrid.from_bounds((-1.6, -1.2, -0.1), (1.6, 1.2, 2.1), 0.05)
    return HullObserver(views(4), volume, VOXEL_M, CarveRule(least_agreeing=3))


@pytest.fixture(scope="module")
def frames(observer):
    """One body, two bodies, nobody."""
    body = other_body()
    left, right = (
        photograph(observer.views, body, stance(body, place_m=(x, 0.0))) for x in (-0.9, 0.9)
    )
    both = [a | b for a, b in zip(left, right, strict=True)]
    return [left, both, [np.zeros_like(mask) for mask in left]]


@pytest.fixture
def masks(observer, frames):
    store = MaskStore([camera.size for camera in observer.views.rig], len(frames))
    for t, frame in enumerate(frames):
        store.put(t, frame)
    yield store
    store.close()


@pytest.fixture
def store(observer, masks):
    with closing(ObservationStore(observer, masks)) as opened:
        yield opened


@pytest.fixture
def carved(monkeypatch):
    """A list that grows with every grid that is carved."""
    calls, carve = [], observe.carve

    def counted(rig, masks, grid, rule, unknown):
        calls.append(grid)
        return carve(rig, masks, grid, rule, unknown)

    monkeypatch.setattr(observe, "carve", counted)
    return calls


def test_what_is_stored_is_what_is_observed(observer, frames, store):
    assert len(store) == len(frames)
    for t, near in [(1, RIGHT), (0, None), (1, LEFT), (2, None), (1, RIGHT), (0, LEFT), (1, None)]:
        given, expected = store.observe(t, near), observer.observe(frames[t], near)
        if t == 2:
            assert given is None and expected is None
            continue
        assert given.grid.shape == expected.grid.shape
        np.testing.assert_array_equal(given.grid.origin_m, expected.grid.origin_m)
        np.testing.assert_array_equal(given.occupancy, expected.occupancy)
        for name in ("masks", "outside_px", "camera", "ray", "normal"):
            for a, b in zip(
                getattr(given.observation, name), getattr(expected.observation, name), strict=True
            ):
                np.testing.assert_array_equal(a, b)


def test_a_blind_camera_takes_nothing_away(observer, frames, masks):
    masks.put(0, [np.zeros_like(frames[0][0]), *frames[0][1:]])
    with closing(ObservationStore(observer, masks)) as store:
        assert store.observe(0) is None
    blind = np.zeros((len(frames), 4), bool)
    blind[0, 0] = True
    with closing(ObservationStore(observer, masks, blind)) as store:
        seen, whole = store.observe(0), observer.observe(frames[0])
        assert store.hidden.tolist() == [0.25, 0, 0]
    assert seen.views.unknown[0].all() and not any(mask.any() for mask in seen.views.unknown[1:])
    assert seen.occupancy.sum() > 0.8 * whole.occupancy.sum()
    masks.put(0, [frames[1][0], *frames[0][1:]])  # what it shows belongs to another moment
    with closing(ObservationStore(observer, masks, blind)) as store:
        assert not store.observe(0).masks[0].any()


def test_late_cameras_and_those_that_miss_somebody_are_blind():
    counts = np.array([[1, 1, 1], [1, 0, 0], [1, 1, 0], [0, 1, 1]])
    footage = SimpleNamespace(late=[0, 1, 0], people_counted=lambda t: counts[t])
    estimated = np.array([True, True, False])
    prepared = SimpleNamespace(store=range(4), footage=footage, estimated=estimated)
    blind = PreparedSilhouettes.blind_cameras(prepared)
    # Of two cameras in frame 1 one is not enough; the third has an empty view.
    assert np.argwhere(blind).tolist() == [[3, 0], [3, 1]]
    footage.people_counted, footage.late = lambda t: None, [0, -2, 0]
    assert np.argwhere(PreparedSilhouettes.blind_cameras(prepared)).tolist() == [[0, 1], [1, 1]]


def test_each_body_of_a_frame_is_carved_once(store, carved):
    """However many stages observe the frame."""
    body = BodyGeometry.from_surface(Surface(fitting_model(), 600), VOXEL_M, "cpu")
    settings = 30.0, MatchSettings()
    for _ in range(3):
        tracker = PoseTracker(body, store, *settings, lambda _: nullcontext(), lambda: None)
        for t in (0, 1, 2, 0):
            tracker.observe(t)
    assert len(carved) == CARVES + CARVES + 1  # where nobody is, only the volume
    store.observe(1, LEFT)
    store.observe(1, RIGHT)
    assert len(carved) == 3 * CARVES  # the other body of the frame with two


def test_memory_holds_no_hulls(observer, frames):
    """A frame costs a few kilobytes; its silhouettes alone are 400."""
    count = 12
    sizes = [camera.size for camera in observer.views.rig]
    with (
        closing(MaskStore(sizes, count)) as masks,
        closing(ObservationStore(observer, masks)) as store,
    ):
        for t in range(count):
            masks.put(t, frames[0])
        store.observe(0), store.observe(1)
        tracemalloc.start()
        for t in range(2, count):
            store.observe(t)
        grown, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert grown < 4000 * (count - 2)


def test_the_scratch_file_vanishes(observer, masks, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with closing(ObservationStore(observer, masks)) as store:
        store.observe(0)
    assert not list(tmp_path.iterdir())
