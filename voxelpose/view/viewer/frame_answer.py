"""What the page asks for a frame: its hull, pictures and words, as JSON."""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from silhouette_core.body.model import BodyModel
from voxelpose.export.player_scene import numbers, other_poses, packed
from voxelpose.view.images import canvas
from voxelpose.view.images.figure import body_parts
from voxelpose.view.viewer.scene import (
    CameraFrame,
    CarvedHull,
    Pictures,
    Scene,
    camera_picture,
    frame_lines,
)

_FARTHEST_MM = 65535  # as two bytes hold it


def frame_answer(scene: Scene, pictures: Pictures | None) -> dict[str, Any]:
    """A frame of the page: hull, other poses, what is said about it, and pictures, if wanted."""
    return {
        "frame": scene.frame,
        "lines": [{"person": person, "text": text} for person, text in frame_lines(scene)],
        "notes": list(scene.notes),
        "hull": None if scene.hull is None else _hull(scene.hull),
        "hypotheses": other_poses(
            [(pose.probability, pose.joints_m[pose.bones]) for pose in scene.hypotheses]
        ),
        "pictures": {} if pictures is None else _pictures(scene, pictures),
    }


def outlined_picture(
    scene: Scene, models: Sequence[BodyModel], camera_frame: CameraFrame, pictures: Pictures
) -> bytes | None:
    """JPEG of what a camera shows, with the outlines of the fitted bodies; None: nothing."""
    picture = camera_picture(camera_frame, pictures, max(camera_frame.camera.size))
    if picture is None:
        return None
    image = np.ascontiguousarray(picture[..., ::-1])
    line = max(1, round(image.shape[0] / 600))
    for k, (model, body) in enumerate(zip(models, scene.bodies, strict=True)):
        if body is None:
            continue
        parts = body_parts(model, body.vertices_m, camera_frame.camera)
        inside = (parts > 0).astype(np.uint8)
        outlines, _ = cv2.findContours(inside, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
        colour = canvas.PEOPLE[k % len(canvas.PEOPLE)] if len(scene.bodies) > 1 else canvas.INK
        for outline in outlines:
            points = np.asarray(outline, float)[:, 0]
            canvas.stroke(image, points, canvas.PAPER, line + 1, closed=True)
            canvas.stroke(image, points, colour, line, closed=True)
    return canvas.encoded(image, ".jpg")


def _hull(hull: CarvedHull) -> dict[str, Any]:
    """Surface and the voxels at it, each with the cameras, the part next to it, the distance."""
    outer, far = hull.outer, np.nan_to_num(1000 * hull.outer.distance_m, posinf=_FARTHEST_MM)
    return {
        "size_m": hull.grid.voxel_size_m,
        "vertices": packed(hull.vertices_m.astype(np.float32)),
        "faces": numbers(hull.faces),
        "at_vertex": numbers(outer.at_vertex),
        "voxels": packed(outer.centres_m.astype(np.float32)),
        "part": packed(outer.part.astype(np.int16)),
        "person": packed(outer.person.astype(np.int8)),
        "cameras": numbers(outer.cameras),
        "far_mm": packed(np.minimum(far, _FARTHEST_MM).astype(np.uint16)),
    }


def _pictures(scene: Scene, pictures: Pictures) -> dict[str, bytes]:
    images = {one.camera.name: camera_picture(one, pictures) for one in scene.camera_frames}
    return {
        name: canvas.encoded(picture[..., ::-1], ".jpg")
        for name, picture in images.items()
        if picture is not None
    }
