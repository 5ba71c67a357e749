"""The report's assessment of a result's numbers."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from tests.clips import waving
from tests.sources import ring
from voxelpose.findings import ranges_text
from voxelpose.reliability import findings_of, verdict_of
from voxelpose.report.verdict import CameraCheck, CameraLine, findings, headline
from voxelpose.results import Result, as_json


def result(tmp_path, lost=(), outline_agreement=0.9, **overlaps):
    motion = waving(20)
    overlap = np.ones((20, 27))
    for name, share in overlaps.items():
        overlap[:, motion.model.names.index(name)] = share
    quality = {
        "outline_agreement": np.broadcast_to(np.asarray(outline_agreement, float), 20),
        "part_overlap": overlap,
    }
    agreement = {"median": float(np.median(quality["outline_agreement"]))}
    summary = {
        "frames": {"with_pose": 20 - len(lost), "lost": list(lost)},
        "quality": {"joint_sigma_mm": {}, "outline_agreement": agreement},
    }
    return Result(tmp_path, replace(motion, quality=quality), ring(2), summary, {})


def test_all_is_well(tmp_path):
    good = result(tmp_path, left_thumb=0.0)
    assessed = findings(good, CameraCheck())
    assert {finding.level for finding in assessed} == {"good"}
    assert not any(finding.remedy for finding in assessed)
    verdict, sentence = headline(good, assessed)
    assert str(verdict) == "reliable" and "nevertheless" in sentence


@pytest.mark.parametrize(
    ("away", "words"),
    [
        ([4, 5, 6], "away in frames 4–6; that who came back is who left is a guess"),
        ([0, 1, 19], "away in frames 0–1, 19"),
    ],
)
def test_who_is_away_is_told_and_no_fault(tmp_path, away, words):
    whole = result(tmp_path)
    kept = np.setdiff1d(np.arange(20), away)
    whole.summary["frames"]["away"] = away
    came = replace(whole, motion=whole.motion.select(kept))
    told = next(one for one in findings(came, CameraCheck()) if one.about == "Presence")
    assert told.level == "good" and words in told.words
    assert ("guess" in told.words) == (4 in away)


@pytest.mark.parametrize(
    ("change", "level", "words"),
    [
        ({"lost": [4, 5, 6, 9]}, "bad", "4 of 20 frames have no pose, frames 4–6, 9"),
        ({"lost": [4]}, "look", "1 of 20 frames have no pose, frame 4"),
        ({"outline_agreement": 0.5}, "bad", "only 50 % in common, below 75 % in frames 0–19"),
        ({"outline_agreement": [0.9] * 18 + [0.6] * 2}, "look", "below 75 % in frames 18–19"),
        ({"left_forearm": 0.3}, "look", "left forearm (100 % of frames)"),
        ({"thorax": 0.3, "left_forearm": [0.9] * 19 + [0.1]}, "look", "thorax (100 % of frames)"),
    ],
)
def test_what_is_wrong_comes_first_with_what_to_do(tmp_path, change, level, words):
    faulty = result(tmp_path, **change)
    first, *others = assessed = findings(faulty, CameraCheck())
    assert first.level == level and first.remedy
    assert words in f"{first.words}, {first.where}"
    assert [finding.level for finding in others] == ["good", "good"]
    verdict, sentence = headline(faulty, assessed)
    assert "nevertheless" not in sentence
    assert verdict.level == ("doubtful" if level == "bad" else "reliable")


def test_frames_that_were_filled_are_told(tmp_path):
    gapped = result(tmp_path, lost=[4, 5])
    motion = replace(gapped.motion, filled=np.isin(np.arange(20), [4, 5]))
    told = findings(replace(gapped, motion=motion), CameraCheck())[0]
    assert told.where == "frames 4–5; 2 of them were filled by interpolation"


def test_what_was_found_is_kept_in_the_result(tmp_path):
    faulty = result(tmp_path, outline_agreement=[0.9] * 18 + [0.6] * 2)
    found = findings_of(faulty.summary, faulty.motion)
    kept = {**faulty.summary, "findings": json.loads(as_json({"": [asdict(f) for f in found]}))[""]}
    assert findings_of(kept) == found and "18–19" in found[0].where
    kept["findings"][0]["level"] = "bad"
    assert str(verdict_of(kept)) == f"doubtful: {found[0]}"


def test_a_camera_apart_is_named(tmp_path):
    lines = tuple(
        CameraLine(name, 0.9, 0.05, 0.05, 12, 0.2, name == "cam_2")
        for name in ("cam_1", "cam_2", "cam_3")
    )
    first = findings(result(tmp_path), CameraCheck(lines))[0]
    assert first.level == "look" and first.where == "cam_2"
    assert "calibrate check" in first.remedy
    whole = findings(result(tmp_path), CameraCheck(lines[::2]))
    assert whole[-1].words == "the body agrees equally well with all 2 cameras"


def test_many_ranges_are_not_all_listed():
    frames = np.arange(100, 140)
    text = ranges_text(frames[frames % 4 == 0])
    assert text == "frames 100, 104, 108, 112, 116, 120 and 4 more ranges"


def test_the_headline_is_the_verdict_of_the_terminal(tmp_path):
    plain = result(tmp_path)
    facts = {"fastest_turn": (2000.0, 7)}
    doubted = replace(plain, summary={**plain.summary, "facts": facts})
    verdict, sentence = headline(doubted, findings(doubted, CameraCheck()))
    assert verdict == verdict_of(doubted.summary) and verdict.level == "doubtful"
    assert sentence == "Look first at the contact sheet: is that the person?"


def test_uncertain_joints_are_named(tmp_path):
    plain = result(tmp_path)
    quality = {"landmark_confidence": {"left_wrist": 0.2, "neck": 0.9, "head_top": 0.9}}
    unsure = replace(plain, summary={**plain.summary, "quality": quality})
    found = findings(unsure, CameraCheck())
    (joints,) = [one for one in found if one.about == "Joints"]
    assert joints.level == "look" and joints.where == "left wrist"
    assert str(headline(unsure, found)[0]).startswith("reliable, but for left_wrist")
    assert not [one for one in findings(plain, CameraCheck()) if one.about == "Joints"]
