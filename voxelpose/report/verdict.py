"""What a result's numbers mean, in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from voxelpose.report.cameras import CameraCheck
from voxelpose.results import Result

Level = Literal["good", "look", "bad"]

SURE, DOUBTFUL = 0.85, 0.7  # a frame's confidence from which it is sure; below which it is doubtful
COVERED = 0.7  # of a part's volume inside the hull
_LOST = 0.05  # share of frames
_MANY = 0.1
_STRETCHES = 6  # named one by one
_TRUNK = ("pelvis", "lumbar", "abdomen", "thorax", "upper_thorax", "neck", "head")
_SMALL = ("thumb", "fingers", "toes")


@dataclass(frozen=True)
class Finding:
    """One thing to know about a result.

    Attributes:
        level: how it is.
        title: what was looked at.
        words: what was found.
        advice: what to do; empty where all is well.
    """

    level: Level
    title: str
    words: str
    advice: str = ""


def findings(result: Result, cameras: CameraCheck | None = None) -> list[Finding]:
    """Judges a result by its own numbers, and by how its cameras agree where that was checked; the
    most important first.
    """
    found = [
        _lost(result),
        *_confidence(result),
        *_parts(result),
        *_cameras(cameras or CameraCheck()),
    ]
    return sorted(found, key=lambda finding: ("bad", "look", "good").index(finding.level))


def overall(found: Sequence[Finding]) -> tuple[Level, str]:
    """Returns the worst level and a sentence for the top of the page."""
    levels = {finding.level for finding in found}
    if "bad" in levels:
        return (
            "bad",
            (
                "Parts of this result should not be relied on; what is wrong, and what helps, is"
                " said below."
            ),
        )
    if "look" in levels:
        return (
            "look",
            "Most of this result holds; look at the places named below before you rely on them.",
        )
    return (
        "good",
        (
            "Nothing in the numbers speaks against this result. Look at the pictures all the same:"
            " they show what no number does."
        ),
    )


def stretches(frames: NDArray[np.int64], chosen: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Returns first and last number of every run of chosen frames."""
    numbers = frames[chosen]
    if not len(numbers):
        return []
    runs = np.split(numbers, np.flatnonzero(np.diff(numbers) > 1) + 1)
    return [(int(run[0]), int(run[-1])) for run in runs]


def spoken_stretches(runs: Sequence[tuple[int, int]]) -> str:
    """Says them: "frames 3–5, 9 and 4 more stretches"."""
    named = [f"{first}–{last}" if last > first else f"{first}" for first, last in runs[:_STRETCHES]]
    more = f" and {len(runs) - _STRETCHES} more stretches" if len(runs) > _STRETCHES else ""
    return (
        f"frame{'' if len(runs) == 1 and runs[0][0] == runs[0][1] else 's'}"
        f" {', '.join(named)}{more}"
    )


def _lost(result: Result) -> Finding:
    summary: Any = result.summary
    lost = np.array(summary["frames"]["lost"], np.int64)
    count = summary["frames"]["with_pose"] + len(lost)
    if not len(lost):
        return Finding("good", "Frames", f"All {count} frames have a pose.")
    runs = stretches(lost, np.ones(len(lost), bool))
    return Finding(
        "bad" if len(lost) > _LOST * count else "look",
        "Frames",
        f"{len(lost)} of {count} frames have no pose: {spoken_stretches(runs)}.",
        "Nobody was found there. Was the person in the picture of at least two cameras? If so, look"
        " at the silhouettes: voxelpose view shows them frame by frame.",
    )


def _confidence(result: Result) -> list[Finding]:
    if "confidence" not in result.motion.quality:
        return []
    confidence = np.asarray(result.motion.quality["confidence"], float)
    median = float(np.nanmedian(confidence))
    doubtful = confidence < DOUBTFUL
    level: Level = (
        "bad" if median < DOUBTFUL else "look" if median < SURE or doubtful.any() else "good"
    )
    words = (
        f"The body's outline and the silhouettes agree to {100 * median:.0f} % (median of all"
        " frames)."
    )
    if doubtful.any():
        words += (
            f" Below {100 * DOUBTFUL:.0f} %:"
            f" {spoken_stretches(stretches(result.motion.frames, doubtful))}."
        )
    advice = (
        "Play the video at those frames. If the body misses the person, look at the silhouettes in"
        " voxelpose view: film the empty room, avoid clothes of the walls' colour, keep other"
        " people out. If body and person are shifted in one camera only, that camera moved."
    )
    return [Finding(level, "Outlines", words, "" if level == "good" else advice)]


def _parts(result: Result) -> list[Finding]:
    overlap = result.motion.quality.get("part_overlap")
    if overlap is None:
        return []
    names = result.motion.model.names
    measured = [
        k
        for k, name in enumerate(names)
        if not name.endswith(_SMALL) and np.isfinite(overlap[:, k]).any()
    ]
    weak = [k for k in measured if np.mean(np.asarray(overlap)[:, k] < COVERED) > _MANY]
    if not weak:
        return [Finding("good", "Body parts", "Every limb lies where the cameras saw the person.")]
    level: Level = "bad" if any(names[k] in _TRUNK for k in weak) else "look"
    said = ", ".join(
        f"{names[k].replace('_', ' ')} ({100 * np.mean(np.asarray(overlap)[:, k] < COVERED):.0f} %"
        " of frames)"
        for k in weak
    )
    return [
        Finding(
            level,
            "Body parts",
            f"Often outside of what the cameras saw: {said}.",
            "Thin parts are lost where one camera's silhouette has a hole: look at it in voxelpose"
            " view. Arms held to the trunk are hidden in it: cameras from other heights help.",
        )
    ]


def _cameras(check: CameraCheck) -> list[Finding]:
    if len(check.lines) < 2:
        return []
    apart = [line.camera for line in check.lines if line.apart]
    if not apart:
        return [
            Finding(
                "good", "Cameras", f"The body agrees with all {len(check.lines)} cameras alike."
            )
        ]
    return [
        Finding(
            "look",
            "Cameras",
            f"{', '.join(apart)} {'agrees' if len(apart) == 1 else 'agree'} less than the others"
            " with the body, or with their outlines.",
            "It may have been moved, be out of step, or have bad silhouettes: voxelpose calibrate"
            " check RECORDING says which, and how to repair it. Fit once more without it (--cameras"
            " names those to use).",
        )
    ]
