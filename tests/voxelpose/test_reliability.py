"""The verdict on a result, from summary.json."""

import pytest

from voxelpose.reliability import Verdict, verdict_of, verdict_of_people


def summary(lost=0, agreement=0.92, right=None, turn=3.0, error=None):
    quality = {"outline_agreement": {"median": agreement}}
    if error is not None:
        quality["pose_error_mm"] = {"mean": error}
    if right is not None:
        quality["right_probability"] = {"lower_quarter": right}
    frames = {"with_pose": 100 - lost, "lost": list(range(lost))}
    return {"frames": frames, "quality": quality, "facts": {"half_turn_ratio": turn}}


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
    ],
)
def test_a_result_is_called_what_its_numbers_say(numbers, level, words):
    verdict = verdict_of(summary(**numbers))
    assert verdict.level == level
    assert words in verdict.reason and bool(verdict.reason) == (level != "reliable")


def test_people_in_one_silhouette_leave_a_doubt_though_they_are_told_apart():
    for shared, level in ((10, "reliable"), (11, "doubtful")):
        numbers = summary(right=0.9)
        numbers["facts"]["frames_merged"] = shared
        assert verdict_of(numbers).level == level
    assert "in 11 of 100 frames people have one silhouette" in verdict_of(numbers).reason


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
    numbers["facts"] = numbers.get("facts", {}) | {"stature_given": False}
    told = "reliable: joints are about 38 mm off, if the person is as tall as is assumed"
    assert str(verdict_of(numbers)) == told


def test_an_object_that_nobody_marked_leaves_a_doubt():
    numbers = summary(right=0.9)
    numbers["facts"]["objects_share"] = {"cam_1": 0.03}
    assert verdict_of(numbers).level == "doubtful"
    assert "mark it as unknown" in verdict_of(numbers).reason
    numbers["facts"]["objects_apart"] = True
    assert verdict_of(numbers).level == "reliable"
    numbers["facts"] |= {"objects_share": {}, "objects_apart": False}
    assert verdict_of(numbers).level == "reliable"


def test_grey_cameras_leave_a_doubt_where_much_of_the_person_might_be_a_shadow():
    numbers = summary(right=0.9)
    numbers["facts"]["by_texture"] = {"cam_1": 0.4, "cam_2": 0.2}
    assert verdict_of(numbers).level == "doubtful"
    assert "30 % of the person is as dark as a shadow" in verdict_of(numbers).reason
    numbers["facts"]["by_texture"]["cam_2"] = 0.05
    assert verdict_of(numbers).level == "reliable"


def test_a_camera_that_moves_is_doubted_before_all_else():
    numbers = summary(right=0.9)
    numbers["facts"] |= {"moving_cameras": ["cam_1"], "by_texture": {"cam_1": 0.9}}
    assert verdict_of(numbers).level == "doubtful"
    assert verdict_of(numbers).reason.startswith("the picture of cam_1 moves as a whole")


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


def test_nobody_turns_round_within_a_tenth_of_a_second():
    numbers = summary(error=43.0)
    numbers["facts"]["fastest_turn"] = [1550.0, 191]
    verdict = verdict_of(numbers)
    assert verdict.level == "doubtful" and "at frame 191" in verdict.reason
    numbers["facts"]["fastest_turn"] = [846.0, 191]
    assert verdict_of(numbers).level == "reliable"


def test_grey_cameras_leave_a_doubt_where_nobody_looked_beforehand():
    numbers = summary(error=40.0)
    numbers["facts"]["by_texture"] = {"cam_1": None}
    assert verdict_of(numbers).level == "doubtful"
    assert "leave --no-smooth out" in verdict_of(numbers).reason


def test_the_least_reliable_person_is_named():
    good, unsure = Verdict("reliable"), Verdict("reliable", uncertain=("neck",))
    bad = Verdict("doubtful", "lost")
    assert str(verdict_of_people({"a": good, "b": bad, "c": bad})) == "doubtful: b: lost"
    words = "reliable, but for b neck: likely over 30 mm off"
    assert str(verdict_of_people({"a": good, "b": unsure})) == words


def test_somebody_who_is_seen_and_was_not_found_makes_a_result_doubtful():
    numbers = summary(right=0.98)
    numbers["facts"]["unexplained_frames"] = 0.25
    verdict = verdict_of(numbers)
    assert verdict.level == "doubtful" and "25 % of the frames something as large as" in str(
        verdict
    )
    numbers["facts"]["unexplained_frames"] = 0.0
    assert verdict_of(numbers).level == "reliable"
