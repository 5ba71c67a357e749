"""Agreement of the cameras with the fitted body, and of their outlines with one another, and what
is found in a result with it.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.agreement import agreement
from calib.camera import Camera
from calib.errors import InputError
from calib.moments import even_moments
from calib.tangency import OutlineTrack
from silhouette_core.motion.dynamics import is_person_tree
from voxelpose.findings import Finding, worst_first
from voxelpose.reliability import Verdict, findings_of, verdict_of
from voxelpose.results import Result
from voxelpose.tuning import REPORT
from voxelpose.view.images.figure import body_parts
from voxelpose.view.viewer.result_scenes import ResultScenes

_MOMENTS = 12


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


def findings(result: Result, cameras: CameraCheck, changed: str = "") -> list[Finding]:
    """What is found in a result, by the agreement of its cameras, and by what changed in its
    recording since, worst first.
    """
    of_result = findings_of(result.summary, result.motion)
    return worst_first([*of_result, *recording_findings(cameras, changed)])


def recording_findings(cameras: CameraCheck, changed: str) -> list[Finding]:
    """As `findings`, without those of a result: of what several people have in common."""
    findings, apart = [], [line.camera for line in cameras.lines if line.apart]
    if changed:
        advice = "estimate again; until then, this page shows the cameras as they are now"
        findings.append(Finding("Recording", "look", changed, remedy=advice))
    if apart:
        words = "the body agrees less with these than with the others, or their outlines do"
        advice = (
            "it may have been moved, be out of synchrony, or have bad silhouettes:"
            " `voxelpose calibrate check RECORDING` reports which, and how to repair it; or"
            " estimate again without it (--cameras lists those to use)"
        )
        findings.append(Finding("Cameras", "look", words, ", ".join(apart), advice))
    elif len(cameras.lines) > 1:
        words = f"the body agrees equally well with all {len(cameras.lines)} cameras"
        findings.append(Finding("Cameras", "good", words))
    return findings


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
