"""How far a result can be relied on, from its own numbers: one word and the reason for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from voxelpose.tuning import RELIABILITY

Level = Literal["failed", "doubtful", "reliable"]


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
    that alone.

    Args:
        summary: contents of summary.json; `frames`, `quality` and `facts` are read.
    """
    frames, quality, facts = summary["frames"], summary["quality"], summary.get("facts", {})
    lost, posed = len(frames["lost"]), frames["with_pose"]
    agreement = _known(quality.get("outline_agreement", {}).get("median"), 1.0)
    right = quality.get("right_probability", {}).get("lower_quarter")
    if lost > RELIABILITY.lost * (lost + posed):
        reason = f"{lost} of {lost + posed} frames have no pose: look at their silhouettes"
        return Verdict("doubtful", f"{reason} (voxelpose view)")
    seam_mm = max((seam for seam in facts.get("seams_mm", ()) if seam is not None), default=0.0)
    if seam_mm > RELIABILITY.seam_mm:
        return Verdict(
            "doubtful",
            f"two pieces of the recording are {seam_mm:.0f} mm apart where they meet: look at"
            " the frames around it (facts in summary.json), or give longer --pieces",
        )
    apart = agreement < RELIABILITY.agreement
    # A quarter of the frames is more likely wrong than right.
    wrong = apart if right is None else right < 0.5
    if wrong:
        turn = facts.get("half_turn_ratio")
        if not apart and turn is not None and turn < RELIABILITY.half_turn:
            return Verdict(
                "doubtful",
                "turned half round, the body explains the silhouettes nearly as well: look which"
                " way it faces",
            )
        return Verdict(
            "doubtful",
            f"body and silhouettes have only {100 * agreement:.0f} % in common: look at the contact"
            " sheet, at background and calibration, and at clothes of the walls' colours",
        )
    turn_deg_s, frame = facts.get("fastest_turn") or (0.0, 0)
    if turn_deg_s > RELIABILITY.turn_deg_s:
        return Verdict(
            "doubtful",
            f"at frame {frame} the body turns faster than people do, by {turn_deg_s:.0f} degrees a"
            " second: before or after it, front and back are exchanged; look at the overlay",
        )
    error_mm = quality.get("pose_error_mm", {}).get("median")
    if error_mm is not None and error_mm > RELIABILITY.open_mm:
        return Verdict(
            "doubtful",
            f"one camera leaves several poses open, and joints are likely {error_mm:.0f} mm off:"
            " look at hypotheses.csv and at the silhouettes, or add a second camera",
            error_mm=error_mm,
        )
    if facts.get("objects_share") and not facts.get("objects_apart"):
        return Verdict(
            "doubtful",
            "something that stands beside the person, as a chair does, was left out: look at the"
            " contact sheet whether legs were taken for it; mark it as unknown to be sure",
        )
    if facts.get("cut_by_body"):
        return Verdict(
            "doubtful",
            "the body explained the silhouettes poorly, so they were cut anew where it was found:"
            " look at the contact sheet, above all at hands and feet, and record the empty view",
        )
    if error_mm is not None:
        return Verdict("reliable", error_mm=error_mm)
    near = quality.get("landmark_confidence", {})
    uncertain = tuple(name for name in near if _known(near[name], 1.0) < 0.5)
    # Of 13 right results of random recordings none has more than 3 of 15; a wrong one had 11.
    if len(uncertain) > len(near) / 2:
        return Verdict(
            "doubtful",
            f"{len(uncertain)} of {len(near)} joints are likely over 30 mm off: look at the contact"
            " sheet, and at whether the cameras see the person from different sides",
        )
    return Verdict("reliable", "", uncertain)


def _known(value: float | None, otherwise: float) -> float:
    """A number of the summary, where null stands for one that is not known."""
    return otherwise if value is None else value
