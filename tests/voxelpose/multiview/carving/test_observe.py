"""Silhouettes stored as bits, one body selected from them, and its agreement with a pose."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.motion.kinematics import place, rotation_matrices
from tests.voxelpose.multiview.carving.carving_scenes import voxels_at
from tests.voxelpose.multiview.matching_scenes import (
    board_on_floor,
    fitting_model,
    other_body,
    photograph,
    stance,
    views,
)
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import (
    COMPONENT,
    HullObserver,
    _label_bodies,
    _small_components,
    _without_crumbs,
)
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.quality.quality import assess
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.tuning import QUALITY

VOLUME = VoxelGrid.from_bounds((-1.6, -1.2, -0.1), (1.6, 1.2, 2.1), 0.05)


def body_at(x: float):
    body = other_body()
    pose = stance(body, {"left_upper_arm.abduction": 20.0}, (x, 0.0))
    return body, pose


@pytest.fixture(scope="module")
def observer():
    return HullObserver(views(4), VOLUME, 0.04, CarveRule(least_agreeing=3))


@pytest.fixture(scope="module")
def masks(observer):
    return photograph(observer.views, *body_at(0.0))


def test_what_is_kept_comes_back_as_it_was():
    """Widths that fill no whole bytes, and cameras of different size."""
    rng = np.random.default_rng(0)
    sizes = [(37, 20), (64, 48)]
    frames = [[rng.random((height, width)) < 0.3 for width, height in sizes] for _ in range(3)]
    with closing(MaskStore(sizes, 3)) as store:
        for t in (2, 0, 1):
            store.put(t, frames[t])
        assert len(store) == 3
        for t, frame in enumerate(frames):
            for kept, given in zip(store[t], frame, strict=True):
                assert kept.dtype == np.bool_
                np.testing.assert_array_equal(kept, given)


def test_of_what_only_some_cameras_show_small_pieces_stay():
    mask = np.zeros((40, 50), bool)
    mask[5:8, 5:8] = True
    mask[20:30, 20:30] = True
    found = _small_components(mask, 20)
    assert found[5:8, 5:8].all() and found.sum() == 9


@pytest.mark.parametrize("joined_m", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_pieces_are_one_that_lie_above_one_another_or_near(axis, joined_m):
    """Up to 0.25 m above one another, up to `joined_m` in any direction."""
    grid = VoxelGrid(np.zeros(3), 0.02, (40, 40, 40))
    most_m = max(joined_m, 0.25 if axis == 2 else 0.0)
    for gap in range(1, 25):
        occupancy = np.zeros((40, 40, 40), bool)
        occupancy[5:8, 5:8, 5:8] = True
        place = [slice(5, 8)] * 3
        place[axis] = slice(8 + gap, 11 + gap)
        occupancy[tuple(place)] = True
        one = len(_label_bodies(occupancy, grid, joined_m).sizes) == 2
        if abs(gap * 0.02 - most_m) > 0.03:
            assert one == (gap * 0.02 <= most_m)


def test_the_window_reaches_beyond_the_coarse_hull(observer, masks):
    components = observer.components(masks)
    body = observer.body(components, None)
    grid = observer.window(components, body)
    low, high = components["bounds_m"][body]
    assert (grid.origin_m <= low - 0.1 + 1e-9).all()
    assert (grid.origin_m + grid.size_m >= high + 0.1 - 1e-9).all()
    assert (grid.size_m < high - low + 0.3).all()


def test_crumbs_of_a_hull_are_left_out():
    occupancy = np.zeros((60, 12, 12), bool)
    occupancy[:10, :10, :10] = True
    for k, edge in enumerate((1, 2, 3, 4)):  # cubes; 27 of 1000 are a crumb
        occupancy[20 + 10 * k : 20 + 10 * k + edge, :edge, :edge] = True
    kept = _without_crumbs(occupancy)
    assert [int(kept[20 + 10 * k : 30 + 10 * k].sum()) for k in range(4)] == [0, 0, 0, 64]
    assert kept[:10].sum() == 1000


def test_the_hull_holds_the_body(observer, masks):
    observed = observer.observe(masks)
    assert observed is not None and observed.occupancy.shape == observed.grid.shape
    body, pose = body_at(0.0)
    points = voxels_at(
        observed.grid, np.concatenate([p @ r.T + o for p, r, o in _placed(body, pose)])
    )
    assert (points >= 0).all() and (points < observed.grid.shape).all()
    assert observed.occupancy[tuple(points.T)].mean() > 0.97
    volume = observed.occupancy.sum() * observed.grid.voxel_size_m**3
    assert 0.05 < volume < 0.25


def _placed(body, pose):
    from silhouette_core.motion.kinematics import forward, quaternions

    rotation, origin = forward(
        body, pose.root_m[None], quaternions(pose.root_rotation[None]), pose.angles_rad[None]
    )
    return zip(body.part_points(0.05), rotation[0], origin[0], strict=True)


def test_of_two_bodies_the_one_nearby_is_taken(observer):
    """And the other one's silhouettes are dropped."""
    here, there = body_at(-0.9), body_at(0.9)
    alone = photograph(observer.views, *here)
    both = [a | b for a, b in zip(alone, photograph(observer.views, *there), strict=True)]
    for x in (-0.9, 0.9):
        observed = observer.observe(both, np.array([x, 0.0, 0.9]))
        middle = observed.grid.occupied_points(observed.occupancy).mean(0)
        assert np.linalg.norm(middle[:2] - (x, 0)) < 0.15
    observed = observer.observe(both, np.array([-0.9, 0.0, 0.9]))
    for kept, mask, joined in zip(observed.observation.masks, alone, both, strict=True):
        assert kept[mask].mean() > 0.95
        # Where the other one stands beside, and not behind, it is gone.
        others = joined & ~mask
        assert kept[others].mean() < 0.1 or np.count_nonzero(others) < 0.9 * np.count_nonzero(mask)


def test_a_person_is_taken_and_not_a_board_of_larger_hull():
    """Cameras at one height see a board on the floor as a double pyramid."""
    room = VoxelGrid.from_bounds((-1.6, -1.6, -0.8), (1.6, 1.6, 2.1), 0.05)
    observer = HullObserver(views(4), room, 0.04, CarveRule(least_agreeing=3))
    person = photograph(observer.views, *body_at(-1.0))
    board = board_on_floor(observer.views, (-0.1, -0.4))
    masks = [a | b for a, b in zip(person, board, strict=True)]
    components = observer.components(masks)
    largest = int(components["volume_m3"].argmax())
    taken = observer.body(components, None)
    assert taken is not None and components["center_m"][taken, 0] < -0.7
    assert taken != largest and components["center_m"][largest, 0] > 0.2
    assert HullObserver(observer.views, room, 0.04, person=False).body(components, None) == largest
    frame = observer.observe(masks)
    assert frame is not None
    assert abs(frame.grid.occupied_points(frame.occupancy).mean(axis=0)[0] + 1.0) < 0.1


def test_of_several_people_the_one_with_the_largest_hull_is_taken(observer):
    volume_m3 = np.array([0.11, 0.12, 0.1])
    bounds_m = np.zeros((3, 2, 3))
    bounds_m[:, 1] = (0.5, 0.6, 1.7)
    people = np.array([*zip(volume_m3, bounds_m.mean(axis=1), bounds_m, strict=True)], COMPONENT)
    assert observer.body(people, None) == 1


def test_stray_pieces_of_one_camera_are_dropped(observer, masks):
    stray = [mask.copy() for mask in masks]
    stray[1][5:40, 5:40] = True
    assert not masks[1][5:40, 5:40].any()
    observed = observer.observe(stray)
    assert not observed.observation.masks[1][5:40, 5:40].any()
    for kept, mask in zip(observed.observation.masks, masks, strict=True):
        assert np.count_nonzero(kept ^ mask) < 0.02 * np.count_nonzero(mask)


@pytest.mark.parametrize("blind", [0, 2])
def test_limbs_that_one_camera_misses_stay_in_the_others(observer, blind):
    """That one alone is explained then: the hull lacks the limbs, and not the other cameras."""
    actor, aside = other_body(), {"left_upper_arm.abduction": 95.0, "left_thigh.abduction": 40.0}
    spread = stance(actor, aside | {"right_upper_arm.abduction": 95.0})
    whole = photograph(observer.views, actor, spread)
    trunk = photograph(observer.views, actor, stance(actor))
    masks = [own & trunk[c] if c == blind else own for c, own in enumerate(whole)]
    observed = observer.observe(masks)
    for c, (kept, mask) in enumerate(zip(observed.masks, masks, strict=True)):
        assert c == blind or kept[mask & ~trunk[c]].mean() > 0.8


@pytest.mark.parametrize("pair", [(0, 1), (1, 2), (0, 3)])
def test_what_two_of_four_cameras_show_is_dropped_where_the_others_are_explained(observer, pair):
    masks = photograph(observer.views, *body_at(0.0))
    stray = [mask.copy() for mask in masks]
    for c in pair:
        stray[c][5:60, 5:60] = True
        assert not masks[c][5:60, 5:60].any()
    for kept in observer.observe(stray).masks:
        assert not kept[5:55, 5:55].any()


def test_nothing_and_specks_are_no_body(observer, masks):
    assert observer.observe([np.zeros_like(mask) for mask in masks]) is None
    specks = [np.zeros_like(mask) for mask in masks]
    for c, camera in enumerate(observer.views.rig):
        ((x, y),) = np.rint(camera.project(np.array([[0.0, 0.0, 1.0]]))[0]).astype(int)
        specks[c][y - 3 : y + 4, x - 3 : x + 4] = True
    assert observer.observe(specks) is None


def test_quality_says_which_parts_the_voxels_support(observer, masks):
    observed = observer.observe(masks)
    model = fitting_model()
    body_volume = BodyVolume.from_model(model, 0.04, "cpu")
    pose = stance(model, {"left_upper_arm.abduction": 20.0})
    right = assess(body_volume, pose, observed)
    assert right.part_overlap.shape == (27,)
    assert np.nanmin(right.part_overlap) >= 0 and np.nanmax(right.part_overlap) <= 1
    # Four cameras and large voxels: the hull is much larger than the body.
    assert 0.1 < right.unexplained < 0.75
    parts = "pelvis", "thorax", "left_thigh", "right_shin", "head"
    core = [model.names.index(name) for name in parts]
    assert right.part_overlap[core].min() > 0.6
    # An arm stretched to where nobody has one.
    wrong = assess(body_volume, stance(model, {"left_upper_arm.abduction": 110.0}), observed)
    forearm = model.names.index("left_forearm")
    limit = min(QUALITY.unsupported, right.part_overlap[forearm])
    assert wrong.part_overlap[forearm] < limit
    assert wrong.unexplained > right.unexplained
    away = assess(body_volume, stance(model, place_m=(5.0, 0.0)), observed)
    sampled = [part for part, points in enumerate(body_volume.part_points) if len(points)]
    assert away.part_overlap[sampled].max() == 0 and away.unexplained == 1
    assert len(sampled) >= 24
    # What is smaller than a voxel was not measured.
    assert np.isnan(away.part_overlap).sum() == 27 - len(sampled)


def test_a_body_explains_its_own_voxels(observer, masks):
    """Its points leave no holes, whichever way the body is turned against the grid."""
    observed = observer.observe(masks)
    model = fitting_model()
    body_volume = BodyVolume.from_model(model, observed.grid.voxel_size_m, "cpu")
    pose = replace(stance(model), root_rotation=rotation_matrices(np.array([0.9, 0.1, 0.2, 0.38])))
    points = np.concatenate(posed_points(body_volume, pose))
    low = points.min(axis=0) - 0.1
    grid = VoxelGrid.from_bounds(low, points.max(axis=0) + 0.1, observed.grid.voxel_size_m)
    occupancy = np.zeros(grid.shape, bool)
    # Filled ten times as densely as by the points that are compared.
    fine = np.concatenate(posed_points(BodyVolume.from_model(model, 0.012, "cpu"), pose))
    occupancy[tuple(((fine - grid.origin_m) / grid.voxel_size_m).astype(int).T)] = True
    own = assess(body_volume, pose, replace(observed, grid=grid, occupancy=occupancy))
    assert own.unexplained < 0.08


def posed_points(volume, pose):
    rotation, origin = place(
        volume.model, pose.root_m[None], pose.root_rotation[None], pose.angles_rad[None]
    )
    return [
        points @ rotation[0, part].T + origin[0, part]
        for part, points in enumerate(volume.part_points)
        if len(points)
    ]


def test_a_stripe_of_the_walls_colour_does_not_halve_the_body(observer, masks):
    """One camera lacks a band across the trunk: what is above it stays."""
    whole = observer.observe(masks)
    torn = [mask.copy() for mask in masks]
    camera = observer.views.rig.cameras[0]
    rows = camera.project(np.array([[0.0, 0.0, 1.25], [0.0, 0.0, 1.15]]))[0][:, 1]
    torn[0][int(rows[0]) : int(rows[1])] = False
    observed = observer.observe(torn)
    heights = [frame.grid.occupied_points(frame.occupancy)[:, 2] for frame in (whole, observed)]
    assert heights[1].max() > heights[0].max() - 0.1
    assert not ((heights[1] > 1.18) & (heights[1] < 1.21)).any()
