"""Assessment of a result by its numbers, in plain words, and the agreement of the cameras with the
fitted body and of their outlines with one another.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from calib.agreement import agreement
from calib.camera import Camera
from calib.errors import InputError
from calib.moments import even_moments
from calib.tangency import OutlineTrack
from silhouette_core.motion.dynamics import is_person_tree
from voxelpose.reliability import Verdict, verdict_of
from voxelpose.results import Result
from voxelpose.tuning import RELIABILITY, REPORT
from voxelpose.view.images.figure import body_parts
from voxelpose.view.viewer.legend import display_name
from voxelpose.view.viewer.result_scenes import ResultScenes

_MOMENTS = 12
_RANGES = 6  # listed one by one
_WORST = 3  # joints that are named
_TRUNK = ("pelvis", "lumbar", "abdomen", "thorax", "upper_thorax", "neck", "head")
_SMALL = ("thumb", "fingers", "toes")


@dataclass(frozen=True)
class CameraLine:
    """Agreement of one camera."""

    camera: str
    overlap: float  # mean intersection over union of the projected body and the silhouette, 0 to 1
    uncovered: float  # mean fraction of the silhouette that the body does not cover
    beyond: float  # mean fraction of the projected body that lies outside the silhouette
    moments: int  # number of moments at which the camera shows the body
    # Error of its outlines against those of the other cameras, independent of the body; None where
    # it cannot be measured.
    outline_px: float | None
    apart: bool  # whether it agrees clearly less than the others
    unknown: float = 0.0  # share of its picture that is marked as unknown


@dataclass(frozen=True)
class CameraCheck:
    """Agreement of all cameras that show the body, and of the outlines alone, as a sentence."""

    lines: tuple[CameraLine, ...] = ()
    summary: str = ""


def check_cameras(scenes: ResultScenes) -> CameraCheck:
    """Compares body and silhouettes, and the outlines, at moments spread over the recording; empty
    where that is missing. InputError where the recording cannot be read.
    """
    # Where somebody has no pose, that part of the silhouettes says nothing of the cameras.
    frames = [set(motion.frames.tolist()) for motion in scenes.motions] or [set()]
    together = set.intersection(*frames)
    moments = [moment for moment in scenes.time_s.items() if moment[0] in together or not together]
    times = np.array(moments).reshape(-1, 2)
    if not len(times) or scenes.recording is None:
        return CameraCheck()
    times = times[even_moments(len(times), _MOMENTS, margin=0)]
    models = [motion.model for motion in scenes.motions]
    masks: dict[str, list[NDArray[np.bool_]]] = {name: [] for name in scenes.rig.names}
    compared: dict[str, list[tuple[float, float, float]]] = {name: [] for name in masks}
    cameras: dict[str, tuple[Camera, NDArray[np.bool_] | None]] = {}
    for frame in times[:, 0].astype(int).tolist():
        bodies = scenes.bodies(frame)
        for camera_frame in scenes.camera_frames(frame):
            camera, mask = camera_frame.camera, camera_frame.mask
            if mask is not None:
                unknown = camera_frame.unknown
                cameras[camera.name] = camera, unknown
                drawn = np.zeros_like(mask)
                for model, body in zip(models, bodies, strict=True):
                    if body is not None:
                        drawn |= body_parts(model, body.vertices_m, camera, cull_back=True) > 0
                if unknown is not None:
                    drawn, mask = drawn & ~unknown, mask & ~unknown
                masks[camera.name].append(mask)
                if drawn.any() and mask.any():
                    compared[camera.name].append(_compare(drawn, mask))
    pixels, culprits, words = _outline_errors(cameras, masks, times[:, 1])
    means = {name: np.mean(values, axis=0) for name, values in compared.items() if values}
    middle = float(np.median([mean[0] for mean in means.values()])) if means else 0.0
    lines = []
    for name, mean in means.items():
        overlap, uncovered, beyond = mean.tolist()
        outlier = len(means) > 2 and overlap < middle - REPORT.camera_apart
        hidden = cameras[name][1]
        lines.append(
            CameraLine(
                name,
                overlap,
                uncovered,
                beyond,
                len(compared[name]),
                pixels.get(name),
                outlier or name in culprits,
                0.0 if hidden is None else float(hidden.mean()),
            )
        )
    return CameraCheck(tuple(lines), words)


def _outline_errors(
    cameras: dict[str, tuple[Camera, NDArray[np.bool_] | None]],
    masks: dict[str, list[NDArray[np.bool_]]],
    times_s: NDArray[np.float64],
) -> tuple[dict[str, float], tuple[str, ...], str]:
    """Error of every camera in pixels, the cameras that cause it, and a sentence."""
    if len(cameras) < 2:
        return {}, (), ""
    tracks = [
        OutlineTrack.from_masks(camera, times_s, masks[name], unknown)
        for name, (camera, unknown) in cameras.items()
    ]
    try:
        result = agreement(tracks, times_s)
    except InputError:  # too few moments at which several cameras show the person
        return {}, (), ""
    return {line.camera: line.error_px for line in result.table}, result.culprits, result.summary


def _compare(drawn: NDArray[np.bool_], mask: NDArray[np.bool_]) -> tuple[float, float, float]:
    """Overlap, uncovered and beyond, as of `CameraLine`."""
    common, body, person = (np.count_nonzero(pixels) for pixels in (drawn & mask, drawn, mask))
    return common / (body + person - common), 1 - common / person, 1 - common / body


Level = Literal["good", "look", "bad"]


@dataclass(frozen=True)
class Finding:
    """Assessment of one aspect of a result."""

    level: Level  # "good", "look" closer, or "bad"
    title: str
    words: str
    advice: str = ""  # what to do; empty where nothing is wrong


def findings(result: Result, cameras: CameraCheck, changed: str = "") -> list[Finding]:
    """Assesses a result by its own numbers, the agreement of its cameras, and what changed in its
    recording since, worst first.
    """
    of_result = [_lost(result), *_outlines(result), *_parts(result), *_joints(result)]
    return _worst_first([*_changes(changed), *of_result, *_cameras(cameras)])


def recording_findings(cameras: CameraCheck, changed: str) -> list[Finding]:
    """As `findings`, without those of a result: of what several people have in common."""
    return _worst_first([*_changes(changed), *_cameras(cameras)])


def _worst_first(assessed: Sequence[Finding]) -> list[Finding]:
    return sorted(assessed, key=lambda finding: ("bad", "look", "good").index(finding.level))


def headline(result: Result, assessed: Sequence[Finding]) -> tuple[Verdict, str]:
    """The verdict, as in the terminal, and a sentence that says what to do first."""
    verdict = verdict_of(result.summary)
    if verdict.level != "reliable":
        return verdict, f"Look first at the contact sheet: is that the {noun_of(result)}?"
    if any(finding.level != "good" for finding in assessed):
        return verdict, "Check the parts and frames that are listed below."
    return verdict, "Check the pictures nevertheless: they show errors that no number does."


def noun_of(result: Result) -> str:
    """What was filmed, in texts: a person, or an object of any other kind."""
    return "person" if is_person_tree(result.motion.model.tree) else "object"


def ranges_text(frames: NDArray[np.int64]) -> str:
    """Frame numbers (n,) in ascending order, as text: "frames 3–5, 9 and 4 more ranges"."""
    runs = np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1)
    listed = [f"{run[0]}–{run[-1]}" if len(run) > 1 else f"{run[0]}" for run in runs[:_RANGES]]
    more = f" and {len(runs) - _RANGES} more ranges" if len(runs) > _RANGES else ""
    return f"frame{'' if len(frames) == 1 else 's'} {', '.join(listed)}{more}"


def _changes(changed: str) -> Iterator[Finding]:
    if changed:
        advice = "Fit again. Until then, what this page says of cameras and silhouettes is as of"
        yield Finding("look", "Recording", f"{changed[:1].upper()}{changed[1:]}.", f"{advice} now.")


def _lost(result: Result) -> Finding:
    summary: Any = result.summary
    lost = np.array(summary["frames"]["lost"], np.int64)
    count = summary["frames"]["with_pose"] + len(lost)
    absent = np.array(summary["frames"].get("away", ()), np.int64)
    absence = f" Away in {ranges_text(absent)}." if len(absent) else ""
    first, last = result.motion.frames[[0, -1]]
    if ((absent > first) & (absent < last)).any():
        absence += " That who came back is who left is a guess."
    if not len(lost):
        return Finding("good", "Frames", f"All {count} frames have a pose.{absence}")
    noun = noun_of(result)
    count_filled = int(result.motion.filled.sum())
    filled = f" {count_filled} of them were filled by interpolation." if count_filled else ""
    return Finding(
        "bad" if len(lost) > RELIABILITY.lost * count else "look",
        "Frames",
        f"{len(lost)} of {count} frames have no pose: {ranges_text(lost)}.{filled}{absence}",
        f"No {noun} was detected there. If at least two cameras show the {noun}, check the"
        " silhouettes: voxelpose view shows them frame by frame.",
    )


def _outlines(result: Result) -> Iterator[Finding]:
    if "outline_agreement" not in result.motion.quality:
        return
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
    yield Finding(level, "Outlines", words, "" if level == "good" else advice)


def _parts(result: Result) -> Iterator[Finding]:
    overlap = result.motion.quality.get("part_overlap")
    if overlap is None:
        return
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
        yield Finding("good", "Body parts", "Every limb lies inside the carved hull.")
        return
    level: Level = "bad" if any(name in trunk for name in weak) else "look"
    listed = ", ".join(
        f"{display_name(name)} ({100 * share:.0f} % of frames)" for name, share in weak.items()
    )
    yield Finding(
        level,
        "Body parts",
        f"Often outside the carved hull: {listed}.",
        "Thin parts are lost where one camera's silhouette has a hole: check it in voxelpose"
        " view. Limbs beside the trunk are occluded by it: cameras at other heights help.",
    )


def _joints(result: Result) -> Iterator[Finding]:
    """Joints that are said to be uncertain, or the error to be expected from one camera."""
    verdict = verdict_of(result.summary)
    if verdict.error_mm is not None:
        yield _joints_of_one_camera(result, verdict.error_mm)
    listed = [display_name(name) for name in verdict.uncertain]
    if not listed:
        return
    yield Finding(
        "look",
        "Joints",
        f"More likely than not farther than 30 mm from the truth: {', '.join(listed)}.",
        "The outlines say little of them: silhouettes that miss them, a limb that is held"
        " against the body, or unusual proportions. Look at them in the video first.",
    )


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


def _cameras(check: CameraCheck) -> Iterator[Finding]:
    if len(check.lines) < 2:
        return
    apart = [line.camera for line in check.lines if line.apart]
    if not apart:
        words = f"The body agrees equally well with all {len(check.lines)} cameras."
        yield Finding("good", "Cameras", words)
        return
    yield Finding(
        "look",
        "Cameras",
        f"{', '.join(apart)} {'agrees' if len(apart) == 1 else 'agree'} less than the others"
        " with the body, or with their outlines.",
        "It may have been moved, be out of synchrony, or have bad silhouettes: voxelpose"
        " calibrate check RECORDING reports which, and how to repair it. Or fit again without"
        " it (--cameras lists those to use).",
    )
