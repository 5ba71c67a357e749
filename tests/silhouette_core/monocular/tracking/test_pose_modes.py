"""Modes of the proposal over time: headings, merging, evidence."""

import numpy as np
import pytest

from silhouette_core.image.seen_joints import SeenJoints
from silhouette_core.monocular.proposal.shipped import shipped_proposal
from silhouette_core.monocular.proposal.silhouette_features import (
    SilhouetteCodes,
    mirrored_seen_codes,
    seen_codes,
)
from silhouette_core.monocular.tracking.body_heading import (
    HeadingFilter,
    body_headings,
    smooth_headings,
)
from silhouette_core.monocular.tracking.pose_modes import (
    FrameModes,
    ModeFinder,
    ModeView,
    _features,
    merge_modes,
)
from silhouette_core.monocular.window import STATURE_PX, Window
from tests.silhouette_core.monocular.filming import camera_at, performed, prior_at

TIMES = np.arange(20) / 30
STANDING = performed("walk").landmarks()[0]


def two_headings(certain: dict[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Two opposite headings, equally probable but in frames where one is certain."""
    heading = np.tile([0.3, 0.3 + np.pi], (len(TIMES), 1))
    probability = np.full((len(TIMES), 2), 0.5)
    for frame, mode in certain.items():
        probability[frame] = 0.01
        probability[frame, mode] = 0.99
    return heading, probability


def test_sure_frames_decide_the_heading_of_ambiguous_ones():
    found = smooth_headings(*two_headings({3: 1, 15: 1}), TIMES)
    assert (found[:, 1] > 0.9).all()
    assert found.sum(axis=1) == pytest.approx(np.ones(len(TIMES)))


def test_the_heading_expected_at_first_decides_where_nothing_else_does():
    heading, probability = two_headings({})
    for mode in (0, 1):
        found = smooth_headings(heading, probability, TIMES, first_rad=heading[0, mode])
        assert (found[:, mode] > 0.9).all()
    sure = two_headings({frame: 0 for frame in range(20)})
    assert (smooth_headings(*sure, TIMES, first_rad=heading[0, 1])[1:, 0] > 0.9).all()


def test_a_turn_is_followed():
    heading = np.linspace(0, np.pi, len(TIMES))[:, None] + [0.0, np.pi]
    probability = np.full(heading.shape, 0.5)
    probability[:4] = [0.95, 0.05]
    assert (smooth_headings(heading, probability, TIMES)[:, 0] > 0.8).all()


def test_headings_frame_by_frame_are_those_of_the_past():
    heading, probability = two_headings({3: 1, 15: 0})
    causal, found = HeadingFilter(), []
    for t, time_s in enumerate(TIMES):
        found.append(causal.update(heading[t], probability[t], time_s))
        past = smooth_headings(heading[: t + 1], probability[: t + 1], TIMES[: t + 1])
        assert found[-1] == pytest.approx(past[-1])
    assert abs(smooth_headings(heading, probability, TIMES) - found).max() > 0.1
    expected = HeadingFilter()
    assert expected.update(heading[0], probability[0], 0.0, heading[0, 1])[1] > 0.9


def test_headings_are_those_of_hips_and_shoulders():
    turned = STANDING @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # by 90 degrees
    quarter = body_headings(turned) - body_headings(STANDING)
    assert (quarter + np.pi) % (2 * np.pi) - np.pi == pytest.approx(np.pi / 2, abs=1e-9)


def test_like_modes_are_merged_and_unlike_ones_kept():
    joints = np.stack([STANDING, STANDING, STANDING]) - STANDING[0]
    joints[1, 1:] += 0.02
    joints[2, 9:] += 0.4
    merged, probability, weights = merge_modes(joints, np.array([0.3, 0.3, 0.4]))
    assert len(merged) == 2 and probability == pytest.approx([0.6, 0.4])
    assert weights.sum(axis=1) == pytest.approx([1, 1])
    assert merged[0, 5] == pytest.approx(joints[:2, 5].mean(axis=0), abs=2e-3)


def test_poses_at_a_probable_mode_cost_least():
    other = STANDING.copy()
    other[9:, 1] -= 0.3
    priors = [prior_at(joints, 0.05) for joints in (STANDING, other)]
    modes = FrameModes(np.array([0.9, 0.1]), priors, 4.0)
    far = STANDING + np.random.default_rng(0).normal(0, 0.3, STANDING.shape)
    costs = modes.cost(np.stack([STANDING, other, far]))
    assert costs[0] < costs[1] < costs[2]
    assert costs[1] - costs[0] == pytest.approx(np.log(9), abs=0.7)
    assert modes.nearest(other + 0.01) is modes.priors[1]


def test_joints_that_are_seen_are_read_where_they_are_in_the_window():
    camera = camera_at((0, -4, 1.5), size=(320, 240))
    mask = np.zeros((240, 320), bool)
    mask[80:200, 150:180] = True
    finder = ModeFinder(shipped_proposal(), camera, 1.75)
    window = finder.window(mask, 3.7)
    pixels = np.random.default_rng(0).uniform(60, 180, (15, 2))
    seen_m = window.unproject(pixels, 3.0) @ camera.rotation.T + camera.translation
    joints = SeenJoints(seen_m / seen_m[:, 2:], np.linspace(0, 1, 15))
    one, mirrored = finder.view(window, 0.0, joints).codes.joints
    wanted = seen_codes((pixels - window.axis_px) / STATURE_PX, joints.visibility)
    np.testing.assert_allclose(one, wanted, atol=1e-5)
    np.testing.assert_allclose(mirrored, mirrored_seen_codes(one))
    assert not finder.view(window, 0.0).codes.joints.any()


def test_without_a_floor_the_person_stands_at_the_usual_height():
    def features(height_m):
        window = Window(
            np.zeros((0, 0), bool), np.zeros((0, 0), bool), np.eye(3)[:, [0, 2, 1]] * [1, -1, 1],
            np.array([0.0, -4.0, height_m]), 360.0, np.array([159.5, 119.5]), 4.0,
        )  # fmt: skip
        codes = SilhouetteCodes(
            *np.zeros((3, 2, 3), np.float32), np.zeros(2, bool), np.zeros((2, 45))
        )
        return _features([ModeView(window, codes, 0.1 * k) for k in range(3)], 1.75)

    assert features(0.9).anchor[:, 2] == pytest.approx(0.9 / 1.75)
    assert features(-3.0).anchor[:, 2] == pytest.approx(features(5.0).anchor[:, 2])
    assert 0.4 < features(-3.0).anchor[0, 2] < 0.7
