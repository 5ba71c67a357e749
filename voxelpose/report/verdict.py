"""Assessment of a result by its numbers, in plain words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from silhouette_core.motion.dynamics import is_person_tree
from voxelpose.report.cameras import CameraCheck
from voxelpose.results import Result
from voxelpose.tuning import RELIABILITY, REPORT
from voxelpose.view.viewer.legend import display_name

Level = Literal["good", "look", "bad"]

_RANGES = 6  # listed one by one
_WORST = 3  # joints that are named
_TRUNK = ("pelvis", "lumbar", "abdomen", "thorax", "upper_thorax", "neck", "head")
_SMALL = ("thumb", "fingers", "toes")


@dataclass(frozen=True)
class Finding:
    """Assessment of one aspect of a result.

    Attributes:
        level: "good", "look" closer, or "bad".
        words: the assessment.
        advice: what to do; empty where nothing is wrong.
    """

    level: Level
    title: str
    words: str
    advice: str = ""


def findings(result: Result, cameras: CameraCheck) -> list[Finding]:
    """Assesses a result by its own numbers and the agreement of its cameras, worst first."""
    assessed = [
        *_verdict(result),
        _lost(result),
        *_outlines(result),
        *_parts(result),
        *_joints(result),
        *_cameras(cameras),
    ]
    return sorted(assessed, key=lambda finding: ("bad", "look", "good").index(finding.level))


def overall(assessed: Sequence[Finding]) -> tuple[Level, str]:
    """The worst level, and a sentence for the top of the page."""
    levels: list[Level] = [finding.level for finding in assessed]
    if "bad" in levels:
        return "bad", "Parts of this result are not reliable; problems and remedies follow below."
    if "look" in levels:
        return "look", "Most of this result is reliable; check the parts and frames listed below."
    return (
        "good",
        "The numbers show no problem with this result. Check the pictures nevertheless: they show"
        " errors that no number does.",
    )


def noun_of(result: Result) -> str:
    """What was filmed, in texts: a person, or an object of any other kind."""
    return "person" if is_person_tree(result.motion.model.tree) else "object"


def ranges_text(frames: NDArray[np.int64]) -> str:
    """Frame numbers (n,) in ascending order, as text: "frames 3–5, 9 and 4 more ranges"."""
    runs = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
    listed = [f"{run[0]}–{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs[:_RANGES]]
    more = f" and {len(runs) - _RANGES} more ranges" if len(runs) > _RANGES else ""
    return f"frame{'' if len(frames) == 1 else 's'} {', '.join(listed)}{more}"


def _verdict(result: Result) -> list[Finding]:
    """The program's own verdict, where it doubts."""
    verdict: Any = result.summary.get("verdict", {})
    if verdict.get("level") != "doubtful":
        return []
    advice = f"Look at the contact sheet below before anything else: is that the {noun_of(result)}?"
    reason = str(verdict["reason"])
    return [Finding("bad", "Doubtful", f"{reason[:1].upper()}{reason[1:]}.", advice)]


def _lost(result: Result) -> Finding:
    summary: Any = result.summary
    lost = np.array(summary["frames"]["lost"], np.int64)
    count = summary["frames"]["with_pose"] + len(lost)
    if not len(lost):
        return Finding("good", "Frames", f"All {count} frames have a pose.")
    noun = noun_of(result)
    count_filled = int(result.motion.filled.sum())
    filled = f" {count_filled} of them were filled by interpolation." if count_filled else ""
    return Finding(
        "bad" if len(lost) > RELIABILITY.lost * count else "look",
        "Frames",
        f"{len(lost)} of {count} frames have no pose: {ranges_text(lost)}.{filled}",
        f"No {noun} was detected there. If at least two cameras show the {noun}, check the"
        " silhouettes: voxelpose view shows them frame by frame.",
    )


def _outlines(result: Result) -> list[Finding]:
    if "outline_agreement" not in result.motion.quality:
        return []
    agreement = np.asarray(result.motion.quality["outline_agreement"], float)
    median = float(np.nanmedian(agreement))
    doubtful = agreement < RELIABILITY.agreement
    level: Level = "look" if median < REPORT.sure or doubtful.any() else "good"
    if median < RELIABILITY.agreement:
        level = "bad"
    words = f"The body's outline and the silhouettes agree to {100 * median:.0f} % (median)."
    if doubtful.any():
        runs = ranges_text(result.motion.frames[doubtful])
        words += f" Below {100 * RELIABILITY.agreement:.0f} %: {runs}."
    noun = noun_of(result)
    advice = (
        f"Play the video at those frames. If the body misses the {noun}, check the silhouettes in"
        " voxelpose view: film the empty room, avoid clothes of the walls' colour, keep other"
        f" people out. If body and {noun} are shifted in one camera only, that camera was moved."
    )
    return [Finding(level, "Outlines", words, "" if level == "good" else advice)]


def _parts(result: Result) -> list[Finding]:
    overlap = result.motion.quality.get("part_overlap")
    if overlap is None:
        return []
    model = result.motion.model
    trunk = _TRUNK if is_person_tree(model.tree) else model.names[:1]
    # Parts too small to be measured are nan.
    uncovered = np.mean(np.asarray(overlap) < REPORT.covered, axis=0)
    weak = {
        name: share
        for name, share in zip(model.names, uncovered.tolist(), strict=True)
        if share > RELIABILITY.lost and not name.endswith(_SMALL)
    }
    if not weak:
        return [Finding("good", "Body parts", "Every limb lies inside the carved hull.")]
    level: Level = "bad" if any(name in trunk for name in weak) else "look"
    listed = ", ".join(
        f"{display_name(name)} ({100 * share:.0f} % of frames)" for name, share in weak.items()
    )
    return [
        Finding(
            level,
            "Body parts",
            f"Often outside the carved hull: {listed}.",
            "Thin parts are lost where one camera's silhouette has a hole: check it in voxelpose"
            " view. Limbs beside the trunk are occluded by it: cameras at other heights help.",
        )
    ]


def _joints(result: Result) -> list[Finding]:
    """Joints that are said to be uncertain, or the error to be expected from one camera."""
    verdict: Any = result.summary.get("verdict", {})
    if verdict.get("error_mm") is not None:
        return [_joints_of_one_camera(result, verdict["error_mm"])]
    listed = [display_name(name) for name in verdict.get("uncertain", ())]
    if not listed:
        return []
    return [
        Finding(
            "look",
            "Joints",
            f"More likely than not farther than 30 mm from the truth: {', '.join(listed)}.",
            "The outlines say little of them: silhouettes that miss them, a limb that is held"
            " against the body, or unusual proportions. Look at them in the video first.",
        )
    ]


def _joints_of_one_camera(result: Result, error_mm: float) -> Finding:
    summary: Any = result.summary
    each: dict[str, float] = summary["quality"].get("joint_error_mm", {})
    worst = sorted(each, key=lambda name: -each[name])[:_WORST]
    listed = ", ".join(f"{display_name(name)} ({each[name]:.0f} mm)" for name in worst)
    return Finding(
        "look",
        "Joints",
        f"To be expected from one camera: joints {error_mm:.0f} mm off relative to the pelvis"
        + (f"; in the room, most for {listed}." if listed else "."),
        "Most of it lies along the line of sight: a second camera from the side settles it.",
    )


def _cameras(check: CameraCheck) -> list[Finding]:
    if len(check.lines) < 2:
        return []
    apart = [line.camera for line in check.lines if line.apart]
    if not apart:
        words = f"The body agrees equally well with all {len(check.lines)} cameras."
        return [Finding("good", "Cameras", words)]
    return [
        Finding(
            "look",
            "Cameras",
            f"{', '.join(apart)} {'agrees' if len(apart) == 1 else 'agree'} less than the others"
            " with the body, or with their outlines.",
            "It may have been moved, be out of synchrony, or have bad silhouettes: voxelpose"
            " calibrate check RECORDING reports which, and how to repair it. Or fit again without"
            " it (--cameras lists those to use).",
        )
    ]
