"""Frames for the tests of sending and drawing, made without cameras and estimation."""

from functools import cache

import cv2
import numpy as np

from calib.camera import Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.image.raster import render_parts
from silhouette_core.motion import kinematics
from silhouette_core.motion.pose import Pose
from voxelpose.live.live_frame import LiveFrame, PosedBody


@cache
def person(stature_m: float = 1.7) -> BodyModel:
    return BodyModel.from_sizes(BodySizes(stature_m))


def posed(
    degrees: dict[str, float] | None = None,
    turn: np.ndarray | None = None,
    root_m: tuple[float, float, float] | None = None,
    model: BodyModel | None = None,
) -> PosedBody:
    """A body with some joint angles, degrees by name; the others are zero."""
    model = model or person()
    angles = np.zeros(model.dof_count)
    for name, angle in (degrees or {}).items():
        angles[model.tree.dof_names.index(name)] = np.radians(angle)
    root = model.joints_m[0] if root_m is None else np.array(root_m)
    pose = Pose(root, np.eye(3) if turn is None else turn, angles)
    rotation, origin = kinematics.place(
        model, pose.root_m[None], pose.root_rotation[None], angles[None]
    )
    joints_m = kinematics.landmarks(model, rotation, origin)[0]
    confidence = np.linspace(0.5, 1, 15), 0.875
    return PosedBody(model, pose, rotation[0], origin[0], joints_m, *confidence)


def bare_frame(number: int = 3, body: PosedBody | None = None) -> LiveFrame:
    """A frame without pictures."""
    return LiveFrame(number, number / 25, {}, people=(body,), captured_unix_s=1.75e9 + number / 25)


def staged_frame(rig: Rig, body: PosedBody, number: int = 0) -> LiveFrame:
    """A frame with the pictures and silhouettes of a body before a wall."""
    pictures, silhouettes = {}, {}
    skin = kinematics.skin(body.model, body.part_rotation, body.part_origin_m)
    for camera in rig:
        mesh = skin @ camera.rotation.T + camera.translation, body.model.faces, body.model.face_part
        parts, _ = render_parts(*mesh, camera.matrix, camera.size)
        room = np.full((camera.size[1], camera.size[0], 3), (112, 120, 124), np.uint8)
        room[int(0.62 * camera.size[1]) :] = (84, 92, 100)
        shaded = np.where(parts[..., None] > 0, np.array([150, 110, 70], np.uint8), room)
        pictures[camera.name] = cv2.GaussianBlur(shaded.astype(np.uint8), (3, 3), 0)
        silhouettes[camera.name] = (parts > 0)[::2, ::2]
    return LiveFrame(number, number / 25, pictures, silhouettes, (body,))
