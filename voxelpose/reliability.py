"""How far a result can be relied on, from its own numbers: one word and the reason for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from voxelpose.tuning import RELIABILITY

Level = Literal["failed", "doubtful", "reliable"]
_Table = Mapping[str, Any]


@dataclass(frozen=True)
class Verdict:
    """Whether a result can be relied on.

    Attributes:
        level: `reliable`, `doubtful`, or `failed` where there is no result.
        reason: what speaks against it, and what helps; empty for a reliable one.
        uncertain: joints that are farther off than 30 mm more likely than not, in the mean of the
            frames; of a doubtful result none, since all may be, and of one camera none either.
        error_mm: of one camera, with a learned proposal: mean error of the joints to be expected
            relative to the pelvis, in the median frame.
    """

    level: Level
    reason: str = ""
    uncertain: tuple[str, ...] = ()
    error_mm: float | None = None

    def __str__(self) -> str:
        """The verdict as a line."""
        if self.reason:
            return f"{self.level}: {self.reason}"
        if self.error_mm is not None:
            return f"{self.level}: joints are about {self.error_mm:.0f} mm off"
        but = f", but for {', '.join(self.uncertain)}: likely over 30 mm off"
        return self.level + (but if self.uncertain else "")


def verdict_of(summary: Mapping[str, Any]) -> Verdict:
    """The verdict on a result.

    A result is doubtful if a tenth of its frames has no pose, or if a quarter of the others is
    wrong more likely than not, or most of its joints are (several cameras), or if body and
    silhouettes have less than three quarters of their union in common (one camera), or if the
    poses that one camera leaves are so far apart that the joints' mean error is likely above 75
    mm, or if it was joined of pieces that do not meet, or if it turns faster than people do. So
    is one from which an object was left out that nobody marked: legs that do not move may have
    been taken for it; and one whose silhouettes were cut by the body, with which they agree for
    that alone; and one of grey cameras in which a quarter of the person might be a shadow.

    Args:
        summary: contents of summary.json; `frames`, `quality` and `facts` are read.
    """
    for doubt in _DOUBTS:
        reason = doubt(summary["frames"], summary["quality"], summary.get("facts", {}))
        if reason:
            error_mm = _error_mm(summary["quality"]) if doubt is _poses_are_open else None
            return Verdict("doubtful", reason, error_mm=error_mm)
    error_mm = _error_mm(summary["quality"])
    if error_mm is not None:
        return Verdict("reliable", error_mm=error_mm)
    return Verdict("reliable", "", _uncertain(summary["quality"]))


def _is_lost(frames: _Table, quality: _Table, facts: _Table) -> str:
    lost, posed = len(frames["lost"]), frames["with_pose"]
    if lost <= RELIABILITY.lost * (lost + posed):
        return ""
    reason = f"{lost} of {lost + posed} frames have no pose: look at their silhouettes"
    return f"{reason} (voxelpose view)"


def _pieces_do_not_meet(frames: _Table, quality: _Table, facts: _Table) -> str:
    seam_mm = max((seam for seam in facts.get("seams_mm", ()) if seam is not None), default=0.0)
    if seam_mm <= RELIABILITY.seam_mm:
        return ""
    return (
        f"two pieces of the recording are {seam_mm:.0f} mm apart where they meet: look at"
        " the frames around it (facts in summary.json), or give longer --pieces"
    )


def _explains_little(frames: _Table, quality: _Table, facts: _Table) -> str:
    agreement = _known(quality.get("outline_agreement", {}).get("median"), 1.0)
    right = quality.get("right_probability", {}).get("lower_quarter")
    apart = agreement < RELIABILITY.agreement
    # A quarter of the frames is more likely wrong than right.
    if not (apart if right is None else right < 0.5):
        return ""
    turn = facts.get("half_turn_ratio")
    if not apart and turn is not None and turn < RELIABILITY.half_turn:
        return (
            "turned half round, the body explains the silhouettes nearly as well: look which"
            " way it faces"
        )
    return (
        f"body and silhouettes have only {100 * agreement:.0f} % in common: look at the contact"
        " sheet, at silhouettes and calibration, and at clothes of the walls' colours"
    )


def _poses_are_open(frames: _Table, quality: _Table, facts: _Table) -> str:
    error_mm = _error_mm(quality)
    if error_mm is None or error_mm <= RELIABILITY.open_mm:
        return ""
    return (
        f"one camera leaves several poses open, and joints are likely {error_mm:.0f} mm off:"
        " look at hypotheses.csv and at the silhouettes, or add a second camera"
    )


def _turns_too_fast(frames: _Table, quality: _Table, facts: _Table) -> str:
    turn_deg_s, frame = facts.get("fastest_turn") or (0.0, 0)
    if turn_deg_s <= RELIABILITY.turn_deg_s:
        return ""
    return (
        f"at frame {frame} the body turns faster than people do, by {turn_deg_s:.0f} degrees a"
        " second: before or after it, front and back are exchanged; look at the overlay"
    )


def _object_is_left_out(frames: _Table, quality: _Table, facts: _Table) -> str:
    if not facts.get("objects_share") or facts.get("objects_apart"):
        return ""
    return (
        "something that stands beside the person, as a chair does, was left out: look at the"
        " contact sheet whether legs were taken for it; mark it as unknown to be sure"
    )


def _is_cut_by_body(frames: _Table, quality: _Table, facts: _Table) -> str:
    if not facts.get("cut_by_body"):
        return ""
    return (
        "the body explained the silhouettes poorly, so they were cut anew where it was found:"
        " look at the contact sheet, above all at hands and feet, and record the empty view"
    )


def _cameras_move(frames: _Table, quality: _Table, facts: _Table) -> str:
    moving = facts.get("moving_cameras")
    if not moving:
        return ""
    return (
        f"{', '.join(moving)}: the picture moves as a whole, so that no background can be told from"
        " the person: film from a tripod, or take --frames in which the camera stands still"
    )


def _rests_on_texture(frames: _Table, quality: _Table, facts: _Table) -> str:
    shares = list(facts.get("by_texture", {}).values())
    share = sum(shares) / max(len(shares), 1)
    if share <= 0.25:  # walk4 turned grey has 0.31, and 1.9 times the error of its colours
        return ""
    return (
        f"cameras without colour: {100 * share:.0f} % of the person is as dark as a shadow, from"
        " which only its texture tells it: look at the contact sheet; wear what is brighter than"
        " the walls, or much darker"
    )


def _joints_are_uncertain(frames: _Table, quality: _Table, facts: _Table) -> str:
    near, uncertain = quality.get("landmark_confidence", {}), _uncertain(quality)
    # Of 13 right results of random recordings none has more than 3 of 15; a wrong one had 11.
    if _error_mm(quality) is not None or len(uncertain) <= len(near) / 2:
        return ""
    return (
        f"{len(uncertain)} of {len(near)} joints are likely over 30 mm off: look at the contact"
        " sheet, and at whether the cameras see the person from different sides"
    )


_DOUBTS = (
    _cameras_move,
    _is_lost,
    _pieces_do_not_meet,
    _explains_little,
    _poses_are_open,
    _turns_too_fast,
    _object_is_left_out,
    _is_cut_by_body,
    _rests_on_texture,
    _joints_are_uncertain,
)
"""What speaks against a result, the first that does is said: of frames, quality and facts."""


def _uncertain(quality: _Table) -> tuple[str, ...]:
    near = quality.get("landmark_confidence", {})
    return tuple(name for name in near if _known(near[name], 1.0) < 0.5)


def _error_mm(quality: _Table) -> float | None:
    """Error to be expected of one camera, in the median frame."""
    return quality.get("pose_error_mm", {}).get("median")


def _known(value: float | None, otherwise: float) -> float:
    """A number of the summary, where null stands for one that is not known."""
    return otherwise if value is None else value
