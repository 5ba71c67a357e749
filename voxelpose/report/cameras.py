"""Does every camera show the person where the fitted body is? Where one does not, its calibration or its silhouettes are wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.image.raster import render_parts
from voxelpose.view.exhibit import Exhibit

_MOMENTS = 12
_APART = 0.06  # from the median camera


@dataclass(frozen=True)
class CameraLine:
    """One camera's agreement with the fitted body.

    Attributes:
        camera: its name.
        overlap: mean intersection over union of the body's outline and the silhouette, 0 to 1.
        uncovered: mean share of the silhouette that the body leaves free.
        beyond: mean share of the body's outline that lies outside the silhouette.
        moments: at how many moments it saw the body.
        apart: whether it agrees clearly less than the others.
    """

    camera: str
    overlap: float
    uncovered: float
    beyond: float
    moments: int
    apart: bool = False


def camera_lines(exhibit: Exhibit, moments: int = _MOMENTS) -> list[CameraLine]:
    """Lays the fitted body over the silhouettes at some moments, spread over the recording.

    Returns:
        A line per camera that saw the body; none where the recording is gone.

    Raises:
        InputError: the recording cannot be read.
    """
    motion = exhibit.motion
    if motion is None or exhibit.recording is None:
        return []
    seen: dict[str, list[tuple[float, float, float]]] = {name: [] for name in exhibit.rig.names}
    for row in np.unique(np.linspace(0, len(motion) - 1, min(moments, len(motion))).round().astype(int)):
        frame = int(motion.frames[row])
        body = exhibit.body(frame)
        for shot in exhibit.shots(frame):
            if body is not None and shot.mask is not None:
                drawn = _outline(motion.model, body.vertices_m, shot.camera)
                if drawn.any() and shot.mask.any():
                    seen[shot.camera.name].append(_compare(drawn, shot.mask))
    means = {name: np.mean(found, axis=0) for name, found in seen.items() if found}
    middle = np.median([mean[0] for mean in means.values()]) if means else 0.0
    return [
        CameraLine(
            name, *(float(value) for value in mean), moments=len(seen[name]), apart=len(means) > 2 and bool(mean[0] < middle - _APART)
        )
        for name, mean in means.items()
    ]


def _outline(model: BodyModel, vertices_m: np.ndarray, camera) -> np.ndarray:
    in_camera = vertices_m @ camera.rotation.T + camera.translation
    parts, _ = render_parts(in_camera, model.faces, model.face_part, camera.matrix, camera.size, cull_back=True)
    return parts > 0


def _compare(drawn: np.ndarray, mask: np.ndarray) -> tuple[float, float, float]:
    common, body, person = (np.count_nonzero(pixels) for pixels in (drawn & mask, drawn, mask))
    return common / (body + person - common), 1 - common / person, 1 - common / body
