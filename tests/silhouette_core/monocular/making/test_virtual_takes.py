"""Virtual takes: what they show is where they say it is."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from silhouette_core.body.joints import LANDMARK_NAMES, PART_NAMES
from silhouette_core.jit import cores, set_threads
from silhouette_core.monocular.making.virtual_takes import (
    VirtualBodies,
    _bare_parts,
    film_take,
    mirror_image,
    plan_takes,
)
from silhouette_core.monocular.proposal.silhouette_features import (
    GRID,
    NEUTRAL,
    STATURE_CELLS,
    feet_grid,
    level_axes,
)
from silhouette_core.motion.motion import Motion
from tests.silhouette_core.monocular.tree.small_library import swaying

MIDDLE = (np.array(GRID[::-1]) - 1) / 2


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def motion():
    return swaying(frames=40)


@pytest.fixture(scope="module")
def bodies(motion):
    return VirtualBodies(motion.model)


@pytest.fixture(scope="module")
def takes(motion, bodies):
    """Every other one in a mirror."""
    filmed = [film_take(motion, bodies, np.random.default_rng(seed)) for seed in range(12)]
    return [mirror_image(take) if number % 2 else take for number, take in enumerate(filmed)]


def test_joints_lie_on_the_silhouette(takes):
    """In weak perspective, from the pelvis's place in the window and the poses."""
    hits = []
    for take in takes:
        right, away, up = np.moveaxis(take.joints, -1, 0)
        cosine, sine = np.cos(take.pitch_rad)[:, None], np.sin(take.pitch_rad)[:, None]
        nearer = np.exp(take.offset[:, 2:])
        x = take.offset[:, :1] + right / nearer
        y = take.offset[:, 1:2] - (sine * away + cosine * up) / nearer
        for cover, u, v in zip(take.coverage, x, y, strict=True):
            there = binary_dilation(cover > 0, iterations=2)
            column, row = np.round(np.stack([u, v]) * STATURE_CELLS + MIDDLE[:, None]).astype(int)
            inside = (row >= 0) & (row < GRID[0]) & (column >= 0) & (column < GRID[1])
            hits.append(there[row[inside], column[inside]])
    assert np.concatenate(hits).mean() > 0.95


def test_a_mirror_exchanges_left_and_right(motion, bodies, rng):
    take = film_take(motion, bodies, rng)
    image = mirror_image(take)
    for name in ("coverage", "skin", "shading"):
        assert (getattr(image, name) == getattr(take, name)[..., ::-1]).all()
    hips = [LANDMARK_NAMES.index(f"{side}_hip") - 1 for side in ("left", "right")]
    np.testing.assert_array_equal(image.joints[:, hips[0]], take.joints[:, hips[1]] * [-1, 1, 1])
    # The pelvis on the optical axis: right and away of the anchor's steps, by the heading.
    axes = [level_axes(one.heading_rad)[:-1] for one in (take, image)]
    steps = [np.diff(one.anchor, axis=0) for one in (take, image)]
    right, away = (
        [np.einsum("ti,ti->t", a[:, k], b) for a, b in zip(axes, steps, strict=True)]
        for k in (0, 1)
    )
    np.testing.assert_allclose(right[1], -right[0], atol=1e-6)
    np.testing.assert_allclose(away[1], away[0], atol=1e-6)


def test_the_feet_in_a_mirror_are_those_of_the_mirrored_silhouette(takes, rng):
    masks = rng.random((5, 90, 120)) > 0.97
    masks[:, :, :30] = masks[:, :, 90:] = False
    masks[:, 60:] &= rng.random((30, 120)) > 0.5
    take = replace(takes[0], feet=feet_grid(masks))
    np.testing.assert_array_equal(
        mirror_image(take).feet[..., 1:], feet_grid(masks[..., ::-1])[..., 1:]
    )


def test_silhouettes_are_centred(takes):
    for take in takes:
        total = take.coverage.sum(axis=(1, 2))
        x = (take.coverage.sum(axis=1) * np.arange(GRID[1])).sum(axis=1) / total
        y = (take.coverage.sum(axis=2) * np.arange(GRID[0])).sum(axis=1) / total
        assert total.min() > 250
        np.testing.assert_allclose(x, MIDDLE[0], atol=0.6)
        np.testing.assert_allclose(y, MIDDLE[1], atol=0.6)


def test_the_person_stands_on_the_floor(takes):
    """The anchor is near the body's middle; a wrong distance moves it along the sloping axis. Few
    hang in the air.
    """
    heights = np.concatenate([take.anchor[:, 2] for take in takes])
    assert 0.4 < np.median(heights) < 0.65 and heights.min() > 0.1 and heights.max() < 1.0
    errors = np.array([take.offset[:, 2].mean() for take in takes])
    assert 0.03 < errors.std() < 0.2


def test_bodies_cameras_and_silhouettes_differ(takes):
    assert np.std([take.pitch_rad.mean() for take in takes]) > 0.05
    thighs = [np.linalg.norm(take.joints[0, 1] - take.joints[0, 0]) for take in takes]
    assert 0.2 < np.mean(thighs) < 0.3 and np.std(thighs) > 0.003
    assert np.std([take.coverage[0].sum() for take in takes]) > 100


def test_the_lowest_part_is_drawn_finer(takes):
    for take in takes:
        coarse = (take.coverage > 1).any(axis=2)
        lowest = GRID[0] - 1 - coarse[:, ::-1].argmax(axis=1)
        shown = np.array([
            take.coverage[k, max(row - 13, 0) : row + 1].sum() for k, row in enumerate(lowest)
        ])  # fmt: skip
        finer = (take.feet > 0).sum(axis=(1, 2))
        assert np.median(np.abs(finer / shown - 1)) < 0.15


def test_hands_have_the_colours_of_the_head_and_clothes_do_not(takes):
    share = [take.skin.sum() / take.coverage.sum() for take in takes]
    assert 0.05 < np.median(share) < 0.35
    joints = [LANDMARK_NAMES.index(name) - 1 for name in ("head_top", "left_wrist", "left_hip")]
    found = {joint: [] for joint in joints}
    for take in takes:
        right, away, up = np.moveaxis(take.joints, -1, 0)
        cosine, sine = np.cos(take.pitch_rad)[:, None], np.sin(take.pitch_rad)[:, None]
        x = (take.offset[:, :1] + right) * STATURE_CELLS + MIDDLE[0]
        y = (take.offset[:, 1:2] - sine * away - cosine * up) * STATURE_CELLS + MIDDLE[1]
        for joint, values in found.items():
            for skin, u, v in zip(take.skin, x[:, joint], y[:, joint], strict=True):
                rows, columns = (slice(max(int(p) - 2, 0), int(p) + 3) for p in (v, u))
                values.append(skin[rows, columns].max(initial=0))
    head, wrist, hip = (np.mean(values) for values in found.values())
    assert head > 1.7 and wrist > 1.2 and hip < 0.5 * wrist


def test_under_a_cap_nothing_else_has_the_colours_of_the_head(rng):
    drawn = np.array([_bare_parts(rng) for _ in range(2000)])
    head, neck, hand, forearm, shin = (
        drawn[:, PART_NAMES.index(name)]
        for name in ("head", "neck", "left_hand", "left_forearm", "left_shin")
    )
    assert head.all() and (~neck).mean() == pytest.approx(0.2, abs=0.03)
    assert hand[neck].mean() == pytest.approx(0.96, abs=0.02) and (hand | ~forearm).all()
    assert not hand[~neck].any() and shin[~neck].mean() < 0.06 < shin[neck].mean()


def test_what_faces_up_is_brighter(takes):
    """Shoulders and the top of the head against what hangs below them, in most takes; nothing
    outside the silhouettes.
    """
    brighter = []
    for take in takes:
        shading = take.shading.astype(float) - NEUTRAL
        assert not shading[take.coverage == 0].any()
        inside = take.coverage == 4
        top = inside & ~np.roll(inside, 2, axis=1)
        bottom = inside & ~np.roll(inside, -2, axis=1)
        brighter.append(shading[top].mean() - shading[bottom].mean())
        assert abs(shading[inside].mean()) < 6
    assert np.mean(np.array(brighter) > 0) > 0.8 and np.median(brighter) > 3


@pytest.mark.skipif(cores() < 2, reason="one core")
def test_a_take_depends_on_its_random_numbers_alone(motion, bodies, takes):
    set_threads(1)
    try:
        again = film_take(motion, bodies, np.random.default_rng(4))
    finally:
        set_threads()
    for name, array in vars(again).items():
        assert (array == getattr(takes[4], name)).all()


def test_frames_are_taken_equally_often(motion):
    plan = plan_takes([motion, motion], 8 * 80, np.random.default_rng(0))
    used = np.concatenate([stretch.frames for stretch in plan])
    assert 8 * 80 <= len(used) < 8 * 80 + 110
    counts = np.bincount(used, minlength=40)
    assert counts.min() > 8 and counts.max() < 24


def test_faster_motion_is_thinned_and_too_short_motion_left_out(motion):
    rng = np.random.default_rng(0)
    fast = replace(motion, fps=60.0, time_s=motion.time_s / 2)
    assert all(len(stretch) <= 20 for stretch in plan_takes([fast], 100, rng))
    short: Motion = motion.select(slice(0, 8))
    assert plan_takes([short], 100, rng) == []
