"""The verdict on a result, from summary.json."""

import pytest

from voxelpose.reliability import Verdict, verdict_of, verdict_of_people

DARK = "30 % of the person is as dark as a shadow"


def summary(lost=0, agreement=0.92, right=None, turn=3.0, error=None, **facts):
    quality = {"outline_agreement": {"median": agreement}}
    if error is not None:
        quality["pose_error_mm"] = {"mean": error}
    if right is not None:
        quality["right_probability"] = {"lower_quarter": right}
    frames = {"with_pose": 100 - lost, "lost": list(range(lost))}
    return {"frames": frames, "quality": quality, "facts": {"half_turn_ratio": turn} | facts}


@pytest.mark.parametrize(
    ("numbers", "level", "words"),
    [
        ({"right": 0.98}, "reliable", ""),
        ({"right": 0.55, "agreement": 0.74}, "reliable", ""),
        ({"lost": 10, "right": 0.9}, "reliable", ""),
        ({"lost": 11, "right": 0.9}, "doubtful", "11 of 100 frames have no pose"),
        ({"right": 0.45, "agreement": 0.7}, "doubtful", "only 70 % in common"),
        ({"right": 0.45, "agreement": 0.8, "turn": 1.1}, "doubtful", "turned half round"),
        ({"right": 0.45, "agreement": 0.8}, "doubtful", "only 80 % in common"),
        ({"agreement": 0.9}, "doubtful", "states no errors"),
        ({"agreement": 0.6}, "doubtful", "only 60 % in common"),
        ({"agreement": 0.7, "error": 40.0}, "doubtful", "only 70 % in common"),
        ({"agreement": 0.8, "error": 44.0}, "reliable", ""),
        ({"agreement": 0.9, "error": 46.0}, "doubtful", "joints are likely 46 mm off"),
        ({"right": 0.9, "frames_merged": 10}, "reliable", ""),
        (
            {"right": 0.9, "frames_merged": 11},
            "doubtful",
            "in 11 of 100 frames people have one sil",
        ),
        ({"right": 0.9, "objects_share": {"cam_1": 0.03}}, "doubtful", "mark it as unknown"),
        ({"right": 0.9, "objects_share": {"cam_1": 0.03}, "objects_apart": True}, "reliable", ""),
        ({"right": 0.9, "objects_share": {}, "objects_apart": False}, "reliable", ""),
        ({"right": 0.9, "by_texture": {"cam_1": 0.4, "cam_2": 0.2}}, "doubtful", DARK),
        ({"right": 0.9, "by_texture": {"cam_1": 0.4, "cam_2": 0.05}}, "reliable", ""),
        ({"error": 40.0, "by_texture": {"cam_1": None}}, "doubtful", "filter it over time"),
        (
            {"right": 0.9, "moving_cameras": ["cam_1"], "by_texture": {"cam_1": 0.9}},
            "doubtful",
            "doubtful: the picture of cam_1 moves as a whole",
        ),
        ({"error": 43.0, "fastest_turn": [1550.0, 191]}, "doubtful", "at frame 191"),
        ({"error": 43.0, "fastest_turn": [846.0, 191]}, "reliable", ""),
        (
            {"right": 0.98, "unexplained_frames": 0.25},
            "doubtful",
            "25 % of the frames something as",
        ),
        ({"right": 0.98, "unexplained_frames": 0.0}, "reliable", ""),
    ],
)
def test_a_result_is_called_what_its_numbers_say(numbers, level, words):
    verdict = verdict_of(summary(**numbers))
    assert verdict.level == level
    assert words in str(verdict) and bool(verdict.reason) == (level != "reliable")


def test_joints_that_are_likely_wrong_are_named():
    numbers = summary(right=0.9)
    numbers["quality"]["landmark_confidence"] = {"left_wrist": 0.49, "neck": 0.51, "pelvis": 0.9}
    verdict = verdict_of(numbers)
    assert verdict == Verdict("reliable", "", ("left_wrist",))
    assert str(verdict) == "reliable, but for left_wrist: likely over 30 mm off"
    numbers["quality"]["right_probability"]["lower_quarter"] = 0.1
    assert verdict_of(numbers).uncertain == ()


def test_one_camera_tells_how_far_off_the_joints_are():
    numbers = summary(error=38.4)
    numbers["quality"]["landmark_confidence"] = {"left_wrist": 0.2, "neck": 0.3}
    verdict = verdict_of(numbers)
    assert verdict == Verdict("reliable", error_mm=38.4)
    assert str(verdict) == "reliable: joints are about 38 mm off"
    numbers["facts"]["stature_given"] = False
    assumed = "reliable: joints are about 38 mm off, if the person is as tall as is assumed"
    assert str(verdict_of(numbers)) == assumed


def test_numbers_that_are_not_known_leave_no_doubt():
    numbers = summary(right=0.9, agreement=None, turn=None)
    numbers["quality"]["landmark_confidence"] = {"left_wrist": None}
    assert verdict_of(numbers) == Verdict("reliable")
    numbers["quality"]["right_probability"]["lower_quarter"] = 0.1
    assert verdict_of(numbers).level == "doubtful"


def test_a_result_of_which_more_than_a_third_of_the_joints_are_likely_wrong_is_doubtful():
    numbers = summary(right=0.9)
    names = "left_wrist", "right_wrist", "left_ankle", "neck"
    confidence = dict(zip(names, (0.3, 0.4, 0.9, 0.9), strict=True))
    numbers["quality"]["landmark_confidence"] = confidence
    verdict = verdict_of(numbers)
    assert verdict.level == "doubtful" and verdict.reason.startswith("2 of 4 joints")
    confidence["right_wrist"] = 0.55
    assert verdict_of(numbers).level == "reliable"


def test_the_least_reliable_person_is_named():
    good, unsure = Verdict("reliable"), Verdict("reliable", uncertain=("neck",))
    bad = Verdict("doubtful", "lost")
    assert str(verdict_of_people({"a": good, "b": bad, "c": bad})) == "doubtful: b: lost"
    words = "reliable, but for b neck: likely over 30 mm off"
    assert str(verdict_of_people({"a": good, "b": unsure})) == words
