"""Do the cameras agree: each with the fitted body, and their outlines with one another?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.agreement import agreement
from calib.camera import Camera
from calib.errors import InputError
from calib.tangency import OutlineTrack
from silhouette_core.body.model import BodyModel
from silhouette_core.image.raster import render_parts
from voxelpose.view.viewer.result_scenes import ResultScenes

_MOMENTS = 12
_APART = 0.06  # from the median camera


@dataclass(frozen=True)
class CameraLine:
    """One camera's agreement.

    Attributes: camera: its name. overlap: mean intersection over union of the fitted body's outline
        and the silhouette, 0 to 1. uncovered: mean share of the silhouette that the body leaves
        free. beyond: mean share of the body's outline that lies outside the silhouette. moments: at
        how many moments it saw the body. outline_px: how far its outlines are from fitting to the
        others', whatever the body; None where that cannot be measured. apart: whether it agrees
        clearly less than the others.
    """

    camera: str
    overlap: float
    uncovered: float
    beyond: float
    moments: int
    outline_px: float | None
    apart: bool


@dataclass(frozen=True)
class CameraCheck:
    """All cameras.

    Attributes:
        lines: one per camera that saw the body.
        words: what the outlines alone say, in a sentence; empty where they say nothing.
    """

    lines: tuple[CameraLine, ...] = ()
    words: str = ""


def check_cameras(scenes: ResultScenes, moments: int = _MOMENTS) -> CameraCheck:
    """Lays the fitted body over the silhouettes, and the outlines over one another, at moments
    spread over the recording.

    Returns:
        The check; empty where the recording is gone.

    Raises:
        InputError: the recording cannot be read.
    """
    motion = scenes.motion
    if motion is None or scenes.recording is None:
        return CameraCheck()
    rows = np.unique(np.linspace(0, len(motion) - 1, min(moments, len(motion))).round().astype(int))
    masks: dict[str, list[NDArray[np.bool_]]] = {name: [] for name in scenes.rig.names}
    seen: dict[str, list[tuple[float, float, float]]] = {name: [] for name in scenes.rig.names}
    cameras: dict[str, Camera] = {}
    for frame in motion.frames[rows].tolist():
        body = scenes.body(frame)
        for camera_frame in scenes.camera_frames(frame):
            if body is not None and camera_frame.mask is not None:
                cameras[camera_frame.camera.name] = camera_frame.camera
                masks[camera_frame.camera.name].append(camera_frame.mask)
                drawn = _outline(motion.model, body.vertices_m, camera_frame.camera)
                if drawn.any() and camera_frame.mask.any():
                    seen[camera_frame.camera.name].append(_compare(drawn, camera_frame.mask))
    pixels, culprits, words = _outlines(cameras, masks, motion.time_s[rows])
    means = {name: np.mean(found, axis=0) for name, found in seen.items() if found}
    middle = float(np.median([mean[0] for mean in means.values()])) if means else 0.0
    lines = []
    for name, (overlap, uncovered, beyond) in means.items():
        apart = name in culprits or (len(means) > 2 and bool(overlap < middle - _APART))
        lines.append(
            CameraLine(
                name,
                float(overlap),
                float(uncovered),
                float(beyond),
                len(seen[name]),
                pixels.get(name),
                apart,
            )
        )
    return CameraCheck(tuple(lines), words)


def _outlines(
    cameras: dict[str, Camera],
    masks: dict[str, list[NDArray[np.bool_]]],
    times_s: NDArray[np.float64],
) -> tuple[dict[str, float], tuple[str, ...], str]:
    """Returns every camera's error in px, the cameras to blame, and a sentence."""
    if len(cameras) < 2:
        return {}, (), ""
    try:
        found = agreement(
            [
                OutlineTrack.from_masks(camera, times_s, masks[name])
                for name, camera in cameras.items()
            ],
            times_s,
        )
    except InputError:  # too little is seen at once
        return {}, (), ""
    return {line.camera: line.error_px for line in found.table}, found.culprits, found.words


def _outline(
    model: BodyModel, vertices_m: NDArray[np.float64], camera: Camera
) -> NDArray[np.bool_]:
    in_camera = vertices_m @ camera.rotation.T + camera.translation
    parts, _ = render_parts(
        in_camera, model.faces, model.face_part, camera.matrix, camera.size, cull_back=True
    )
    return parts > 0


def _compare(drawn: NDArray[np.bool_], mask: NDArray[np.bool_]) -> tuple[float, float, float]:
    common, body, person = (np.count_nonzero(pixels) for pixels in (drawn & mask, drawn, mask))
    return common / (body + person - common), 1 - common / person, 1 - common / body
