"""What the live page draws, as JSON: bodies that are sent once, then where their parts are; hulls,
other likely poses, and small pictures of the cameras.
"""

import time
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from silhouette_core.body.joints import LANDMARK_BONES
from silhouette_core.body.model import BodyModel
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from voxelpose.export.player_scene import Stage, other_poses, packed, player_scene
from voxelpose.live.live_frame import LiveFrame, PosedBody
from voxelpose.people_marks import person_colour, rgb
from voxelpose.view.viewer.scene import SILHOUETTE

_HULL = (140, 150, 160)  # RGB
_PICTURE_PX = 320
_REBUILD_S = 1  # an estimation that adapts the body may give a new one with every frame
_MOST_HYPOTHESES = 3
_MOST_POINTS = 4000
_ONE = 32767  # of quaternions as 16 bits
_ALONE = rgb("#5492d6")  # of one person; several have a colour each


class SentBody:
    """A person's body as pages have it; `version` changes with it."""

    def __init__(self) -> None:
        self.version = 0
        self._model: BodyModel | None = None
        self._built_s = -np.inf

    def use(self, model: BodyModel) -> int:
        """Takes a body, if it is another and not too soon; returns the version."""
        known = self._model
        if known is None or (
            model is not known
            and time.monotonic() - self._built_s >= _REBUILD_S
            and not (model.sizes == known.sizes and np.array_equal(model.shape, known.shape))
        ):
            self._model, self._built_s = model, time.monotonic()
            self.version += 1
        return self.version

    def content(self) -> dict[str, Any]:
        """The body at rest, as the player reads it; empty where there is none yet."""
        version, model = self.version, self._model
        if model is None:
            return {}
        turn = np.array([[1.0, 0.0, 0.0, 0.0]])
        motion = Motion(1.0, model, model.joints_m[:1], turn, np.zeros((1, model.dof_count)))
        (body,) = player_scene([motion], 1.0, Stage())["bodies"]
        return body | {"version": version}


class LiveScene:
    """The room, the people in it and the cameras' pictures."""

    def __init__(self, rig: Sequence[Camera], people: int = 1) -> None:
        self.bodies = [SentBody() for _ in range(people)]
        self._views = {c.name: UndistortedView.from_camera(c, _PICTURE_PX) for c in rig}
        self._rig = Rig(tuple(camera.pinhole() for camera in rig))

    def stage(self, title: str) -> dict[str, Any]:
        """What the page shows at first: the cameras, without anybody."""
        scene = player_scene([], 1.0, Stage(title, self._rig, (0, 1)))
        colours = [person_colour(k) for k in range(len(self.bodies))]
        return scene | {"colours": colours if len(colours) > 1 else [_ALONE], "hull_colour": _HULL}

    def moment(self, frame: LiveFrame) -> dict[str, Any]:
        """Where everybody's parts are in a frame, the hull, and other poses of one camera."""
        hulls = [one.hull_m for one in frame.people if one is not None and one.hull_m is not None]
        points = np.concatenate([np.zeros((0, 3), np.float32), *hulls])
        points = points[:: -(-len(points) // _MOST_POINTS) or 1]
        people = zip(self.bodies, frame.people, strict=True)
        likely = () if frame.body is None else frame.body.hypotheses[:_MOST_HYPOTHESES]
        return {
            "people": [None if body is None else _placed(sent, body) for sent, body in people],
            "hull": packed(points.astype(np.float32)),
            "hypotheses": other_poses(
                [(share, joints[LANDMARK_BONES]) for share, joints in likely]
            ),
        }

    def picture(self, frame: LiveFrame, name: str, outlines: bool) -> NDArray[np.uint8] | None:
        """A camera's small picture, (h, w, 3) uint8 BGR; None where the frame has none."""
        picture = frame.pictures.get(name)
        if picture is None:
            return None
        silhouette = frame.silhouettes.get(name) if outlines else None
        return small_picture(picture, silhouette, self._views[name])


def _placed(sent: SentBody, body: PosedBody) -> dict[str, Any]:
    turn = np.rint(quaternions(body.part_rotation) * _ONE).astype(np.int16)
    root = body.pose.root_m.astype(np.float32)
    return {"version": sent.use(body.model), "root": packed(root), "turn": packed(turn)}


def small_picture(
    picture: NDArray[np.uint8], silhouette: NDArray[np.bool_] | None, view: UndistortedView
) -> NDArray[np.uint8]:
    """Small picture (h, w, 3) uint8 BGR, as the view shows it, of one as captured, (H, W, 3) uint8
    BGR, with the outline of its silhouette, (h, w) bool, perhaps scaled down, if there is one.
    """
    size = view.pinhole.size
    # Bilinear: means over all pixels of a large picture would cost ten times as much.
    small = cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR)
    if silhouette is not None and silhouette.any():
        mask = cv2.resize(silhouette.view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        outlines, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
        cv2.drawContours(small, outlines, -1, SILHOUETTE[::-1], 2, cv2.LINE_AA)
    if view.maps is not None:
        small = cv2.remap(small, *view.maps, cv2.INTER_LINEAR)
    return np.asarray(small, np.uint8)
