"""How far a result can be relied on, from its own numbers: one word and the reason for it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

Level = Literal["failed", "doubtful", "reliable"]

_LOST = 0.1  # fraction of frames without a pose
_RIGHT = 0.5  # probability below which a frame counts as wrong
_WRONG = 0.25  # fraction of wrong frames
_APART = 0.75  # outline agreement below which that is the reason, and the measure of one camera
_OPEN_MM = 75.0  # error to expect from one camera above which the pose is open
_SEAM_MM = 80.0  # mean distance of the joints of two pieces in the frames that they share
_UNCERTAIN = 0.5  # probability of a joint to be within 30 mm, below which it is named
_TURN = 1.5  # half-turn ratio below which the heading is the reason


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
    wrong more likely than not (several cameras), or if body and silhouettes have less than three
    quarters of their union in common (one camera), or if the poses that one camera leaves are so
    far apart that the joints' mean error is likely above 75 mm, or if it was joined of pieces that
    do not meet. So is one from which an object was left out that nobody marked: legs that do not
    move may have been taken for it.

    Args:
        summary: contents of summary.json; `frames`, `quality` and `facts` are read.
    """
    frames, quality, facts = summary["frames"], summary["quality"], summary.get("facts", {})
    lost, posed = len(frames["lost"]), frames["with_pose"]
    agreement = _known(quality.get("outline_agreement", {}).get("median"), 1.0)
    right = quality.get("right_probability", {}).get("lower_quarter")
    if lost > _LOST * (lost + posed):
        reason = f"{lost} of {lost + posed} frames have no pose: look at their silhouettes"
        return Verdict("doubtful", f"{reason} (voxelpose view)")
    apart = [seam for seam in facts.get("seams_mm", ()) if seam is not None and seam > _SEAM_MM]
    if apart:
        return Verdict(
            "doubtful",
            f"two pieces of the recording are {max(apart):.0f} mm apart where they meet: look at"
            " the frames around it (facts in summary.json), or give longer --pieces",
        )
    if (right is None and agreement < _APART) or (right is not None and right < _RIGHT):
        if agreement >= _APART and _known(facts.get("half_turn_ratio"), _TURN) < _TURN:
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
    error_mm = quality.get("pose_error_mm", {}).get("median")
    if error_mm is not None and error_mm > _OPEN_MM:
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
    if error_mm is not None:
        return Verdict("reliable", error_mm=error_mm)
    near = quality.get("landmark_confidence", {})
    uncertain = (name for name in near if _known(near[name], 1.0) < _UNCERTAIN)
    return Verdict("reliable", "", tuple(uncertain))


def _known(value: float | None, otherwise: float) -> float:
    """A number of the summary, where null stands for one that is not known."""
    return otherwise if value is None else value
