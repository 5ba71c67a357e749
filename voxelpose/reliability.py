"""How far a result can be relied on, from its own numbers: what is found in it, and one word with
the reason for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import msgspec
import numpy as np

from voxelpose.findings import Finding, ranges_text, worst_first
from voxelpose.people_marks import display_name
from voxelpose.tuning import RELIABILITY, REPORT

if TYPE_CHECKING:
    from silhouette_core.motion.motion import Motion

Level = Literal["failed", "doubtful", "reliable"]
LEVELS: tuple[Level, ...] = ("failed", "doubtful", "reliable")
"""From the worst on."""
_Table = Mapping[str, Any]
_STATED = {"pose_error_mm", "joint_sigma_mm", "right_probability", "landmark_confidence"}
"""Of the quality, what says how far off poses are; overlap with the silhouettes does not."""
_WORST = 3  # joints that are named
_SMALL = ("thumb", "fingers", "toes")


@dataclass(frozen=True)
class Verdict:
    """Whether a result can be relied on."""

    level: Level  # `reliable`, `doubtful`, or `failed` where there is no result
    reason: str = ""  # what speaks against it, and what helps; empty for a reliable one
    # Joints that are farther off than 30 mm more likely than not, in the mean of the frames; of a
    # doubtful result none, since all may be, and of one camera none either.
    uncertain: tuple[str, ...] = ()
    # Of one camera, with a learned proposal: mean error of the joints to be expected relative to
    # the pelvis.
    error_mm: float | None = None
    # Of one camera, whether nobody said how tall the person is: all lengths are as assumed.
    stature_assumed: bool = False

    def __str__(self) -> str:
        """The verdict as a line."""
        if self.reason:
            return f"{self.level}: {self.reason}"
        if self.error_mm is not None:
            words = f"{self.level}: joints are about {self.error_mm:.0f} mm off"
            assumed = ", if the person is as tall as is assumed"
            return words + (assumed if self.stature_assumed else "")
        but = f", but for {', '.join(self.uncertain)}: likely over 30 mm off"
        return self.level + (but if self.uncertain else "")


def verdict_of(summary: Mapping[str, Any]) -> Verdict:
    """The verdict on a result, by what was found in it: doubtful for the first that is bad."""
    quality, error_mm = summary["quality"], _error_mm(summary["quality"])
    for finding in findings_of(summary):
        if finding.level == "bad":
            return Verdict("doubtful", str(finding), error_mm=error_mm)
    if error_mm is None:
        return Verdict("reliable", "", _uncertain(quality))
    given = summary.get("facts", {}).get("stature_given", True)
    return Verdict("reliable", "", (), error_mm, not given)


def verdict_of_people(verdicts: Mapping[str, Verdict]) -> Verdict:
    """The verdict on several people's results, by their names: that of the least reliable one, the
    first of these, who is named; where all are reliable, with the uncertain joints of all.
    """
    name, worst = min(verdicts.items(), key=lambda item: LEVELS.index(item[1].level))
    if worst.reason:
        return replace(worst, reason=f"{name}: {worst.reason}")
    uncertain = [f"{who} {joint}" for who, each in verdicts.items() for joint in each.uncertain]
    return replace(worst, uncertain=tuple(uncertain))


def findings_of(summary: Mapping[str, Any], motion: Motion | None = None) -> list[Finding]:
    """What is found in a result, worst first: what its summary.json holds, or, of results before
    2026-12, by its `frames`, `quality` and `facts`, and by the motion where that is given; and what
    was corrected by hand.
    """
    if "findings" in summary:
        stated = msgspec.convert(summary["findings"], list[Finding])
        return worst_first([*_of_corrections(summary), *stated])
    frames, quality, facts = summary["frames"], summary["quality"], summary.get("facts", {})
    return worst_first(
        [
            *_of_corrections(summary),
            *_of_frames(frames, facts, motion),
            *_of_outlines(quality, facts, motion),
            *_of_one_camera(quality),
            *_of_estimator(quality, facts),
            *_of_silhouettes(quality, facts),
            *_of_parts(motion),
        ]
    )


def _bad(about: str, words: str, remedy: str, where: str = "") -> Finding:
    return Finding(about, "bad", words, where, remedy)


def _of_corrections(summary: _Table) -> Iterator[Finding]:
    """What was corrected by hand: bad where it is much of what nothing measures."""
    if (made := summary.get("corrections")) is None:
        return
    unmeasured, count = made["unmeasured"], summary["frames"]["with_pose"]
    yield Finding(
        "Corrections",
        "bad" if unmeasured > RELIABILITY.lost * count else "look",
        f"corrected by hand: {', '.join(made['words'])}",
        "all other numbers are those of the estimate",
        f"look at these {unmeasured} frames, which nothing measures" if unmeasured else "",
    )


def _of_frames(frames: _Table, facts: _Table, motion: Motion | None) -> Iterator[Finding]:
    if moving := facts.get("moving_cameras"):
        yield _bad(
            "Cameras",
            f"the picture of {', '.join(moving)} moves as a whole, so that no background can be"
            " told from the person",
            "film from a tripod, or take --frames in which the camera stands still",
        )
    lost, where = frames["lost"], ""
    count = frames["with_pose"] + len(lost)
    if lost:
        where = ranges_text(np.array(lost, np.int64))
        if motion is not None and (filled := int(motion.filled.sum())):
            where += f"; {filled} of them were filled by interpolation"
    level = "bad" if len(lost) > RELIABILITY.lost * count else "look" if lost else "good"
    words = f"{len(lost)} of {count} frames have no pose" if lost else "all frames have a pose"
    remedy = "look at their silhouettes (voxelpose view)" if lost else ""
    yield Finding("Frames", level, words, where, remedy)
    shared = facts.get("frames_merged", 0)
    if shared > RELIABILITY.lost * count:
        yield _bad(
            "Frames",
            f"in {shared} of {count} frames people have one silhouette, and what one hides of"
            " another is a guess",
            "look at the overlay",
        )
    away = np.array(frames.get("away", ()), np.int64)
    if len(away):
        first, last = (0, 0) if motion is None else motion.frames[[0, -1]]
        guess = ((away > first) & (away < last)).any()
        words = "; that who came back is who left is a guess" if guess else ""
        yield Finding("Presence", "good", f"away in {ranges_text(away)}{words}")
    seam_mm = max((seam for seam in facts.get("seams_mm", ()) if seam is not None), default=0.0)
    if seam_mm > RELIABILITY.seam_mm:
        yield _bad(
            "Pieces",
            f"two pieces of the recording are {seam_mm:.0f} mm apart where they meet",
            "look at the frames around it (facts in summary.json), or give longer --pieces",
        )


def _of_outlines(quality: _Table, facts: _Table, motion: Motion | None) -> Iterator[Finding]:
    agreement = _number_or(quality.get("outline_agreement", {}).get("median"), 1.0)
    right = quality.get("right_probability", {}).get("lower_quarter")
    limit, turn = RELIABILITY.agreement, facts.get("half_turn_ratio")
    disagrees = agreement < limit
    # A quarter of the frames is more likely wrong than right.
    doubted = disagrees if right is None else right < 0.5
    if doubted and not disagrees and turn is not None and turn < RELIABILITY.half_turn:
        yield _bad(
            "Heading",
            "turned half round, the body explains the silhouettes nearly as well",
            "look which way it faces",
        )
    where = ""
    if motion is not None and "outline_agreement" in motion.quality:
        below = np.asarray(motion.quality["outline_agreement"], float) < limit
        if below.any():
            where = f"below {100 * limit:.0f} % in {ranges_text(motion.frames[below])}"
    level = "bad" if doubted else "look" if where or agreement < REPORT.sure else "good"
    if level != "good" or "outline_agreement" in quality:
        yield Finding(
            "Outlines",
            level,
            f"body and silhouettes have {'only ' * doubted}{100 * agreement:.0f} % in common",
            where,
            "look at the contact sheet, at silhouettes and calibration (a body that is shifted in"
            " one camera only: that one was moved), and at clothes of the walls' colours"
            if level != "good"
            else "",
        )


def _of_one_camera(quality: _Table) -> Iterator[Finding]:
    error_mm = _error_mm(quality)
    if error_mm is None:
        return
    each: dict[str, float] = quality.get("joint_error_mm", {})
    worst = sorted(each, key=lambda name: -each[name])[:_WORST]
    listed = ", ".join(f"{display_name(name)} ({each[name]:.0f} mm)" for name in worst)
    where = f"in the room, most for {listed}" if listed else ""
    if error_mm > RELIABILITY.open_mm:
        yield _bad(
            "Joints",
            f"one camera leaves several poses open, and joints are likely {error_mm:.0f} mm off",
            "look at hypotheses.csv and at the silhouettes, or add a second camera",
            where,
        )
        return
    yield Finding(
        "Joints",
        "look",
        f"to be expected from one camera: joints {error_mm:.0f} mm off relative to the pelvis",
        where,
        "most of it lies along the line of sight: a second camera from the side settles it",
    )


def _of_estimator(quality: _Table, facts: _Table) -> Iterator[Finding]:
    turn_deg_s, frame = facts.get("fastest_turn") or (0.0, 0)
    if turn_deg_s > RELIABILITY.turn_deg_s:
        yield _bad(
            "Heading",
            f"at frame {frame} the body turns faster than people do, by {turn_deg_s:.0f} degrees a"
            " second",
            "before or after it, front and back are exchanged; look at the overlay",
        )
    if not quality.keys() & _STATED:
        yield _bad(
            "Joints",
            "its estimator states no errors to be expected, so that nobody knows",
            "look at the contact sheet",
        )


def _of_silhouettes(quality: _Table, facts: _Table) -> Iterator[Finding]:
    """What is to be said of a result whose poses are plausible."""
    if facts.get("objects_share") and not facts.get("objects_apart"):
        yield _bad(
            "Objects",
            "something that stands beside the person, as a chair does, was left out",
            "look at the contact sheet whether legs were taken for it, and mark it as unknown",
        )
    shares = list(facts.get("by_texture", {}).values())
    if None in shares:
        yield _bad(
            "Colours",
            "cameras without colour: how much of the person is as dark as a shadow was not looked"
            " at beforehand",
            "filter it over time (--smooth), or look at the contact sheet",
        )
    share = sum(share or 0.0 for share in shares) / max(len(shares), 1)
    if share > 0.25:  # walk4 turned grey had 0.31, and 1.9 times the error of its colours
        yield _bad(
            "Colours",
            f"cameras without colour: {100 * share:.0f} % of the person is as dark as a shadow,"
            " from which only its texture tells it",
            "look at the contact sheet; wear what is brighter than the walls, or much darker",
        )
    share = facts.get("unexplained_frames", 0.0)
    if share > RELIABILITY.lost:
        yield _bad(
            "People",
            f"in {100 * share:.0f} % of the frames something as large as a person is seen beside"
            " those who were found",
            "look at the contact sheet, and if it is somebody, tell by --people how many there are",
        )
    confidence, uncertain = quality.get("landmark_confidence", {}), _uncertain(quality)
    if _error_mm(quality) is None and uncertain:
        # Of 13 right results of random recordings none has more than 3 of 15; wrong ones 7 and 11.
        yield Finding(
            "Joints",
            "bad" if len(uncertain) > len(confidence) / 3 else "look",
            f"{len(uncertain)} of {len(confidence)} joints are likely over 30 mm off",
            ", ".join(map(display_name, uncertain)),
            "look at the contact sheet, and at whether the cameras see the person, and limbs held"
            " against the body, from different sides",
        )


def _of_parts(motion: Motion | None) -> Iterator[Finding]:
    overlap = None if motion is None else motion.quality.get("part_overlap")
    if motion is None or overlap is None:
        return
    # Parts too small to be measured are nan.
    uncovered = np.mean(np.asarray(overlap) < REPORT.covered, axis=0).tolist()
    weak = [
        f"{display_name(name)} ({100 * share:.0f} % of frames)"
        for name, share in zip(motion.model.names, uncovered, strict=True)
        if share > RELIABILITY.lost and not name.endswith(_SMALL)
    ]
    if not weak:
        yield Finding("Body parts", "good", "every limb lies inside the carved hull")
        return
    yield Finding(
        "Body parts",
        "look",
        "often outside the carved hull",
        ", ".join(weak),
        "thin parts are lost where one camera's silhouette has a hole: check it in voxelpose view;"
        " limbs beside the trunk are occluded by it: cameras at other heights help",
    )


def _uncertain(quality: _Table) -> tuple[str, ...]:
    confidence = quality.get("landmark_confidence", {})
    return tuple(name for name in confidence if _number_or(confidence[name], 1.0) < 0.5)


def _error_mm(quality: _Table) -> float | None:
    """Error to be expected of one camera: a mean, since what is open at times is wrong then."""
    return quality.get("pose_error_mm", {}).get("mean")


def _number_or(value: float | None, otherwise: float) -> float:
    """A number of the summary, where null stands for one that is not known."""
    return otherwise if value is None else value
