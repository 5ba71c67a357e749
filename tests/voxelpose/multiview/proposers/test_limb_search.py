"""A limb searched on the silhouettes where its two parts are hard to tell apart."""

import numpy as np
import pytest

from silhouette_core.body.joints import LANDMARK_NAMES
from tests.voxelpose.multiview.matching_scenes import (
    fitting_model,
    joint_errors_m,
    observe,
    stance,
    views,
)
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.limbs import CHAINS, within_limits
from voxelpose.multiview.proposers.limb_search import _scores, place_limb

BODY = BodyVolume.from_model(fitting_model(), 0.03, "cpu")
LEFT_ARM, RIGHT_ARM, LEFT_LEG, RIGHT_LEG = range(4)
ENDS = ("left_elbow left_wrist", "right_elbow right_wrist", "left_knee left_ankle")
ENDS = (*ENDS, "right_knee right_ankle")
AXES = {"arm": ("abduction", "forward", "twist"), "leg": ("flexion", "abduction", "rotation")}


@pytest.mark.parametrize(
    ("limb", "above_deg", "below_deg", "cameras"),
    [
        (LEFT_LEG, (35, 55, -45), 80, 3),
        (RIGHT_LEG, (80, -25, 50), 85, 6),
        (RIGHT_LEG, (85, 30, 45), 155, 4),
        (RIGHT_ARM, (140, 30, 55), 70, 3),
        (RIGHT_ARM, (-65, -75, -60), 50, 4),
        (LEFT_ARM, (-30, 80, -45), 25, 6),
    ],
    ids=["leg aside", "knee up", "heel at the seat", "arm overhead", "arm back", "arm forward"],
)
def test_both_parts_of_a_limb_are_found(limb, above_deg, below_deg, cameras):
    """The body in the pictures is the one that is placed: all but the limb stands right."""
    upper, lower = CHAINS[limb]
    axes = AXES["arm" if limb < LEFT_LEG else "leg"]
    turns = {f"{upper.name}.{axis}": deg for axis, deg in zip(axes, above_deg, strict=True)}
    truth = stance(BODY.model, turns | {f"{lower.name}.flexion": below_deg})
    start = stance(BODY.model)
    result = place_limb(BODY, observe(views(cameras), BODY.model, truth), start, CHAINS[limb])
    ends = [LANDMARK_NAMES.index(name) for name in ENDS[limb].split()]
    assert joint_errors_m(BODY.model, result, BODY.model, truth)[ends].max() < 0.1
    assert within_limits(result.angles_rad)


def test_limbs_count_by_their_volume():
    """All of whose points are seen where nothing is explained, however many are looked up."""
    seen_by, pose = views(3), stance(BODY.model)
    observation = observe(seen_by, BODY.model, pose)
    images = np.full((3, 320, 320), 2, np.int8)
    for limb in BODY.limbs[1:]:
        (score,) = _scores(BODY, observation, images, limb, pose, pose.angles_rad[None])
        assert score == pytest.approx(2 * 3 * len(BODY.points[limb.name]), rel=0.06)
