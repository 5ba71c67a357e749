"""Agreement of the cameras with the fitted body, and of their outlines with one another."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.agreement import agreement
from calib.camera import Camera
from calib.errors import InputError
from calib.moments import even_moments
from calib.tangency import OutlineTrack
from voxelpose.tuning import REPORT
from voxelpose.view.images.figure import body_parts
from voxelpose.view.viewer.result_scenes import ResultScenes

_MOMENTS = 12


@dataclass(frozen=True)
class CameraLine:
    """Agreement of one camera.

    Attributes:
        camera: its name.
        overlap: mean intersection over union of the projected body and the silhouette, 0 to 1.
        uncovered: mean fraction of the silhouette that the body does not cover.
        beyond: mean fraction of the projected body that lies outside the silhouette.
        moments: number of moments at which the camera shows the body.
        outline_px: error of its outlines against those of the other cameras, independent of the
            body; None where it cannot be measured.
        apart: whether it agrees clearly less than the others.
        unknown: share of its picture that is marked as unknown.
    """

    camera: str
    overlap: float
    uncovered: float
    beyond: float
    moments: int
    outline_px: float | None
    apart: bool
    unknown: float = 0.0


@dataclass(frozen=True)
class CameraCheck:
    """Agreement of all cameras.

    Attributes:
        lines: one per camera that shows the body.
        summary: result of comparing the outlines alone, as a sentence; empty where there is none.
    """

    lines: tuple[CameraLine, ...] = ()
    summary: str = ""


def check_cameras(scenes: ResultScenes) -> CameraCheck:
    """Compares body and silhouettes, and the outlines, at moments spread over the recording; empty
    where that is missing.

    Raises:
        InputError: the recording cannot be read.
    """
    motion = scenes.motion
    if motion is None or scenes.recording is None:
        return CameraCheck()
    rows = even_moments(len(motion), _MOMENTS, margin=0)
    masks: dict[str, list[NDArray[np.bool_]]] = {name: [] for name in scenes.rig.names}
    compared: dict[str, list[tuple[float, float, float]]] = {name: [] for name in masks}
    cameras: dict[str, tuple[Camera, NDArray[np.bool_] | None]] = {}
    for frame in motion.frames[rows].tolist():
        body = scenes.body(frame)
        for camera_frame in scenes.camera_frames(frame):
            camera, mask = camera_frame.camera, camera_frame.mask
            if body is not None and mask is not None:
                unknown = camera_frame.unknown
                cameras[camera.name] = camera, unknown
                drawn = body_parts(motion.model, body.vertices_m, camera, cull_back=True) > 0
                if unknown is not None:
                    drawn, mask = drawn & ~unknown, mask & ~unknown
                masks[camera.name].append(mask)
                if drawn.any() and mask.any():
                    compared[camera.name].append(_compare(drawn, mask))
    pixels, culprits, words = _outlines(cameras, masks, motion.time_s[rows])
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


def _outlines(
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
