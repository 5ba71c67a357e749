"""Which of two arms is the near one, told by bare forearms."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.body.joints import PART_NAMES
from silhouette_core.image.head_colours import ColourCrop
from silhouette_core.image.raster import render_parts
from silhouette_core.monocular.occlusion import standing_areas
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.colour_evidence import (
    BareParts,
    ColourEvidence,
    SkinEvidence,
)
from silhouette_core.monocular.tracking.frame_costs import CostSettings
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker, TrackerSettings
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.silhouette_error import posed_mesh
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    joints_of,
    observed_by,
    prior_of,
    proposed,
)

CAMERA = camera_at((-4.0, 0.0, 1.2))  # sees the right side of somebody who faces -y
MODEL = body()
SKIN, SHIRT, WALL = (130, 160, 215), (60, 90, 40), (120, 118, 125)
SHORT_SLEEVES = ("neck", "head", "forearm", "hand", "thumb", "fingers")
LONG_SLEEVES = ("neck", "head", "hand", "thumb", "fingers")
FOREARM, THIGH = PART_NAMES.index("right_forearm"), PART_NAMES.index("left_thigh")


def standing(forward_deg):
    """Somebody whose right arm hangs forward by an angle and whose left arm by the opposite one."""
    angles = np.zeros(MODEL.dof_count)
    for side, sign in (("right", 1), ("left", -1)):
        for name, degrees in (
            ("upper_arm.abduction", -65), ("upper_arm.forward", sign * forward_deg),
            ("forearm.flexion", 20),
        ):  # fmt: skip
            angles[MODEL.tree.dof_names.index(f"{side}_{name}")] = np.radians(degrees)
    low, high = MODEL.tree.dof_limits_rad.T
    return Pose(np.array([0.0, 0, 0.95]), np.eye(3), np.clip(angles, low, high))


NEAR_FORWARD, FAR_FORWARD, HANGING = standing(30), standing(-30), standing(0)


def pictured(pose, bare_names):
    """Silhouette and colours of a pose, some of its parts bare."""
    seen = posed_mesh(MODEL, pose) @ CAMERA.rotation.T + CAMERA.translation
    parts = render_parts(seen, MODEL.faces, MODEL.face_part, CAMERA.matrix, CAMERA.size)[0]
    bare = np.array([False, *(any(one in part for one in bare_names) for part in MODEL.names)])
    mask = parts > 0
    picture = np.where(bare[parts][..., None], SKIN, np.where(mask[..., None], SHIRT, WALL))
    noise = np.random.default_rng(0).normal(0, 4, picture.shape)
    picture = np.clip(picture + noise, 0, 255).astype(np.uint8)
    return Person(mask, False, ColourCrop.of(picture, (0, 0)))


def skin_of(pose, bare_names, observed):
    person = pictured(pose, bare_names)
    evidence = ColourEvidence(CAMERA)
    assert evidence.skin(observed.weights, person) is None
    assert evidence.learn([person] * 5, [joints_of(MODEL, pose)] * 5, 1.0)
    assert evidence.skin(observed.weights, Person(person.mask, False)) is None
    skin = evidence.skin(observed.weights, person)
    assert skin is not None
    return skin


def costs(skin, observed, poses):
    return skin.cost(observed.weights.part_images(MODEL, poses), observed.weights.mask)


@pytest.fixture(scope="module")
def observed():
    return observed_by(CAMERA, NEAR_FORWARD)


@pytest.mark.parametrize("bare_names", [SHORT_SLEEVES, LONG_SLEEVES])
def test_sleeves_are_learned(observed, bare_names):
    skin = skin_of(NEAR_FORWARD, bare_names, observed)
    if bare_names is SHORT_SLEEVES:
        assert skin.bare[FOREARM] > 0.8
    else:
        assert skin.bare[FOREARM] < 0.15
    assert skin.bare[THIGH] == pytest.approx(0.05, abs=0.03)
    assert skin.bare[PART_NAMES.index("head")] == 0.95
    assert skin.bare[PART_NAMES.index("right_fingers")] > 0.8


def test_hands_are_no_head_under_a_cap(observed):
    """Nothing but the head has its colours."""
    skin = skin_of(NEAR_FORWARD, ("head",), observed)
    assert skin.bare[PART_NAMES.index("right_fingers")] < 0.15


def test_earlier_sleeves_are_forgotten(observed):
    evidence = ColourEvidence(CAMERA)
    joints = [joints_of(MODEL, NEAR_FORWARD)] * 5
    person = pictured(NEAR_FORWARD, LONG_SLEEVES)
    evidence.learn([pictured(NEAR_FORWARD, SHORT_SLEEVES)] * 5, joints, 1.0)
    evidence.learn([person] * 5, joints, 0.1)
    skin = evidence.skin(observed.weights, person)
    assert skin is not None and skin.bare[FOREARM] < 0.15


def test_a_bare_forearm_before_the_trunk_is_the_near_one(observed):
    skin = skin_of(NEAR_FORWARD, SHORT_SLEEVES, observed)
    right, wrong = costs(skin, observed, [NEAR_FORWARD, FAR_FORWARD])
    assert right == 0 and 1 < wrong < 5
    for alone in (NEAR_FORWARD, FAR_FORWARD):
        assert costs(skin, observed, [alone]) == 0


def test_the_tracker_asks_for_it(observed, monkeypatch):
    """The wrong arm is proposed as more probable: what the colours tell decides."""
    poses = [FAR_FORWARD, NEAR_FORWARD]
    modes = proposed(poses, [0.9, 0.1])
    settings = TrackerSettings(CostSettings(silhouette=1.0))
    tracker = HypothesisTracker(MODEL, CAMERA, standing_areas(MODEL), settings, CpuBackend())
    found = poses, [prior_of(pose) for pose in poses]
    monkeypatch.setattr(HypothesisTracker, "_found", lambda *_: found)

    def chosen(one):
        beam = tracker.step(one, modes, (None, None))
        return np.abs(beam.joints[beam.best] - joints_of(MODEL, NEAR_FORWARD)).max() < 1e-6

    assert not chosen(observed)
    skin = skin_of(NEAR_FORWARD, SHORT_SLEEVES, observed)
    assert chosen(replace(observed, skin=skin))


def teach(learned, found, moved_m=(0, 0, 0)):
    """Frames of somebody with hanging arms, all of whose pixels have a likelihood in each."""
    joints = joints_of(MODEL, HANGING) + moved_m
    mask = pictured(HANGING, ()).mask
    for one in found:
        learned.add(np.full(mask.shape, one, np.float32), mask, (0, 0), CAMERA, joints)


def test_what_was_learned_fades():
    learned = BareParts()
    teach(learned, [1] * 5)
    assert learned.probability()[FOREARM] == 0.95
    learned.fade(0.1)
    teach(learned, [0] * 5)
    assert learned.probability()[FOREARM] == 0.05


def test_sleeves_are_those_of_the_frames_in_which_a_bare_arm_is_found():
    """In two of five frames the forearm is not where the pose has it."""
    learned = BareParts()
    teach(learned, [1, 0, 1, 0, 1])
    assert learned.probability()[FOREARM] == 0.95


def test_too_few_frames_or_a_person_behind_the_camera_teach_nothing():
    learned = BareParts()
    teach(learned, [1] * 2)  # of two arms
    teach(learned, [1] * 9, (-9, 0, 0))
    assert learned.probability()[FOREARM] == 0.5


def test_what_is_neither_drawn_nor_silhouette_costs_nothing():
    drawn = np.zeros((2, 4, 4), np.uint8)
    drawn[0, 0, 0] = 1 + THIGH
    mask = np.zeros((4, 4), bool)
    mask[1] = True
    skin = SkinEvidence(np.ones((4, 4), np.float32), np.full(27, 0.05))
    assert skin.cost(drawn, mask) == pytest.approx([0, 0])
