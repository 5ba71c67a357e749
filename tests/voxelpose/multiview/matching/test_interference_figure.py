"""Fig. 2 of paper B: where movable areas interfere, the plain matcher errs and the joint one does
not.
"""

import cv2
import numpy as np
import pytest

from docs.figures.interference import (
    PICTURE,
    draw,
    errors_m,
    make_example,
    match_example,
    matched_joints,
)
from silhouette_core.body.joints import LANDMARK_NAMES


@pytest.fixture(scope="module")
def example():
    return make_example()


def true_joint(example, name):
    return example.joints_m[LANDMARK_NAMES.index(name)]


# The default step, and another, so that the figure does not hang on where the samples happen to
# lie.
@pytest.mark.parametrize(("step_deg", "worst_m"), [(15.0, 0.08), (12.0, 0.09)])
def test_plain_puts_both_shins_into_one_leg_and_joint_does_not(example, step_deg, worst_m):
    plain, joint = (
        match_example(example, interference, np.radians(step_deg)) for interference in (False, True)
    )
    wrong, right = errors_m(example, plain), errors_m(example, joint)
    assert wrong["left_ankle"] > 0.30
    # It is the right leg's voxels that mislead it: the shin lies along them.
    shin = 0.5 * (
        matched_joints(example, plain)["left_knee"] + matched_joints(example, plain)["left_ankle"]
    )
    middles = {
        side: 0.5 * (true_joint(example, f"{side}_knee") + true_joint(example, f"{side}_ankle"))
        for side in ("left", "right")
    }
    assert np.linalg.norm(shin - middles["right"]) < 0.8 * np.linalg.norm(shin - middles["left"])
    assert max(right.values()) < worst_m
    assert joint.explained > plain.explained


def test_legs_are_what_interferes(example):
    groups = match_example(example, True).groups
    assert any({"left_shin", "right_shin"} <= set(group) for group in groups)
    assert any({"left_thigh", "right_thigh"} <= set(group) for group in groups)
    assert all(len(group) == 1 for group in match_example(example, False).groups)


def test_picture_of_the_docs_is_the_one_that_is_made_here(example):
    made = draw(example, match_example(example, False), match_example(example, True))
    kept = cv2.imread(str(PICTURE))
    assert kept is not None and PICTURE.stat().st_size < 300_000
    # The letters differ with the version of OpenCV, the bodies do not.
    figures = slice(0, 680)
    assert kept.shape == made.shape
    assert np.abs(kept[figures].astype(int) - made[figures]).mean() < 1.0
