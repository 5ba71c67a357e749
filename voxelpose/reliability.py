"""How far a result can be relied on, from its own numbers: one word and the reason for it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any, Literal

from voxelpose.tuning import RELIABILITY

Level = Literal["failed", "doubtful", "reliable"]
LEVELS: tuple[Level, ...] = ("failed", "doubtful", "reliable")
"""From the worst on."""
_Table = Mapping[str, Any]
_STATED = {"pose_error_mm", "joint_sigma_mm", "right_probability", "landmark_confidence"}
"""Of the quality, what says how far off poses are; overlap with the silhouettes does not."""


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
    """The verdict on a result, by `frames`, `quality` and `facts` of its summary.json: doubtful for
    the first of the reasons below.
    """
    frames, quality, facts = summary["frames"], summary["quality"], summary.get("facts", {})
    error_mm = _error_mm(quality)
    doubts = chain(_doubts_of_poses(frames, quality, facts), _doubts_of_silhouettes(quality, facts))
    reason = next(doubts, "")
    if reason:
        is_open = reason == _open_poses(error_mm)
        return Verdict("doubtful", reason, error_mm=error_mm if is_open else None)
    if error_mm is None:
        return Verdict("reliable", "", _uncertain(quality))
    return Verdict("reliable", "", (), error_mm, not facts.get("stature_given", True))


def verdict_of_people(verdicts: Mapping[str, Verdict]) -> Verdict:
    """The verdict on several people's results, by their names: that of the least reliable one, the
    first of these, who is named; where all are reliable, with the uncertain joints of all.
    """
    name, worst = min(verdicts.items(), key=lambda item: LEVELS.index(item[1].level))
    if worst.reason:
        return replace(worst, reason=f"{name}: {worst.reason}")
    uncertain = [f"{who} {joint}" for who, each in verdicts.items() for joint in each.uncertain]
    return replace(worst, uncertain=tuple(uncertain))


def _doubts_of_poses(frames: _Table, quality: _Table, facts: _Table) -> Iterator[str]:
    """What speaks against the poses, of which the first is said."""
    if moving := facts.get("moving_cameras"):
        yield (
            f"{', '.join(moving)}: the picture moves as a whole, so that no background can be told"
            " from the person: film from a tripod, or take --frames in which the camera stands"
            " still"
        )
    lost, posed = len(frames["lost"]), frames["with_pose"]
    if lost > RELIABILITY.lost * (lost + posed):
        yield (
            f"{lost} of {lost + posed} frames have no pose: look at their silhouettes (voxelpose"
            " view)"
        )
    shared = facts.get("frames_merged", 0)
    if shared > RELIABILITY.lost * (lost + posed):
        yield (
            f"in {shared} of {lost + posed} frames people have one silhouette, and what one hides"
            " of another is a guess: look at the overlay"
        )
    seam_mm = max((seam for seam in facts.get("seams_mm", ()) if seam is not None), default=0.0)
    if seam_mm > RELIABILITY.seam_mm:
        yield (
            f"two pieces of the recording are {seam_mm:.0f} mm apart where they meet: look at"
            " the frames around it (facts in summary.json), or give longer --pieces"
        )
    agreement = _number_or(quality.get("outline_agreement", {}).get("median"), 1.0)
    right = quality.get("right_probability", {}).get("lower_quarter")
    disagrees, turn = agreement < RELIABILITY.agreement, facts.get("half_turn_ratio")
    # A quarter of the frames is more likely wrong than right.
    if disagrees if right is None else right < 0.5:
        if not disagrees and turn is not None and turn < RELIABILITY.half_turn:
            yield (
                "turned half round, the body explains the silhouettes nearly as well: look which"
                " way it faces"
            )
        yield (
            f"body and silhouettes have only {100 * agreement:.0f} % in common: look at the contact"
            " sheet, at silhouettes and calibration, and at clothes of the walls' colours"
        )
    error_mm = _error_mm(quality)
    if error_mm is not None and error_mm > RELIABILITY.open_mm:
        yield _open_poses(error_mm)
    turn_deg_s, frame = facts.get("fastest_turn") or (0.0, 0)
    if turn_deg_s > RELIABILITY.turn_deg_s:
        yield (
            f"at frame {frame} the body turns faster than people do, by {turn_deg_s:.0f} degrees a"
            " second: before or after it, front and back are exchanged; look at the overlay"
        )
    if not quality.keys() & _STATED:
        yield (
            "its estimator states no errors to be expected, so that nobody knows: look at the"
            " contact sheet"
        )


def _open_poses(error_mm: float | None) -> str:
    return (
        f"one camera leaves several poses open, and joints are likely {error_mm or 0:.0f} mm off:"
        " look at hypotheses.csv and at the silhouettes, or add a second camera"
    )


def _doubts_of_silhouettes(quality: _Table, facts: _Table) -> Iterator[str]:
    """What speaks against a result whose poses are plausible."""
    if facts.get("objects_share") and not facts.get("objects_apart"):
        yield (
            "something that stands beside the person, as a chair does, was left out: look at the"
            " contact sheet whether legs were taken for it; mark it as unknown to be sure"
        )
    shares = list(facts.get("by_texture", {}).values())
    if None in shares:
        yield (
            "cameras without colour: how much of the person is as dark as a shadow was not looked"
            " at beforehand: leave --no-smooth out, or look at the contact sheet"
        )
    share = sum(share or 0.0 for share in shares) / max(len(shares), 1)
    if share > 0.25:  # walk4 turned grey had 0.31, and 1.9 times the error of its colours
        yield (
            f"cameras without colour: {100 * share:.0f} % of the person is as dark as a shadow,"
            " from which only its texture tells it: look at the contact sheet; wear what is"
            " brighter than the walls, or much darker"
        )
    share = facts.get("unexplained_frames", 0.0)
    if share > RELIABILITY.lost:
        yield (
            f"in {100 * share:.0f} % of the frames something as large as a person is seen beside"
            " those who were found: look at the contact sheet, and if it is somebody, tell by"
            " --people how many there are"
        )
    confidence, uncertain = quality.get("landmark_confidence", {}), _uncertain(quality)
    # Of 13 right results of random recordings none has more than 3 of 15; wrong ones had 7 and 11.
    if _error_mm(quality) is None and len(uncertain) > len(confidence) / 3:
        yield (
            f"{len(uncertain)} of {len(confidence)} joints are likely over 30 mm off: look at the"
            " contact sheet, and at whether the cameras see the person from different sides"
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
