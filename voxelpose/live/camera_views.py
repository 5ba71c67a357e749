"""The cameras in the page: where they stand, and small pictures of what they see."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
import viser
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.motion.kinematics import quaternions
from voxelpose.live.live_frame import LiveFrame
from voxelpose.view.viewer.legend import SILHOUETTE

_LONG_SIDE_PX = 320
_JPEG_QUALITY = 70


class CameraViews:
    """Draws the cameras. Of each frame one camera's picture is sent, in turn: pictures cost the
    most.
    """

    def __init__(self, scene: viser.SceneApi, rig: Sequence[Camera]) -> None:
        """Places the cameras.

        Args:
            scene: where they are drawn.
            rig: at least one camera.
        """
        self._cameras = tuple(rig)
        self._views = [UndistortedView.from_camera(camera, _LONG_SIDE_PX) for camera in rig]
        self._handles = [_add_frustum(scene, camera) for camera in rig]
        self._labels = [
            scene.add_label(f"/cameras/{camera.name}/name", camera.name) for camera in rig
        ]
        self._next = 0

    def show(self, visible: bool) -> None:
        """Shows or hides the cameras."""
        for handle in (*self._handles, *self._labels):
            handle.visible = visible

    def draw(self, frame: LiveFrame, outlines: bool) -> None:
        """Shows the next camera's picture.

        Args:
            frame: with pictures of any of the cameras.
            outlines: whether silhouettes are outlined in it.
        """
        for _ in self._cameras:
            k, self._next = self._next, (self._next + 1) % len(self._cameras)
            picture = frame.pictures.get(self._cameras[k].name)
            if picture is not None:
                silhouette = frame.silhouettes.get(self._cameras[k].name) if outlines else None
                self._handles[k].image = small_picture(picture, silhouette, self._views[k])
                return

    def clear(self) -> None:
        """Removes the pictures."""
        for handle in self._handles:
            handle.image = None


def small_picture(
    picture: NDArray[np.uint8], silhouette: NDArray[np.bool_] | None, view: UndistortedView
) -> NDArray[np.uint8]:
    """Small picture, undistorted, with the silhouette's outline.

    Args:
        picture: (H, W, 3) uint8 BGR, as captured.
        silhouette: (h, w) bool, of the picture or of it scaled down; None: no outline.
        view: of the size to be returned.

    Returns:
        (h, w, 3) uint8 RGB.
    """
    size = view.pinhole.size
    # Bilinear: means over all pixels of a large picture would cost ten times as much.
    small = cv2.resize(picture, size, interpolation=cv2.INTER_LINEAR)
    small = cv2.cvtColor(small, cv2.COLOR_BGR2RGB)
    if silhouette is not None and silhouette.any():
        mask = cv2.resize(silhouette.view(np.uint8), size, interpolation=cv2.INTER_NEAREST)
        outlines, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_SIMPLE)
        cv2.drawContours(small, outlines, -1, SILHOUETTE, 2, cv2.LINE_AA)
    if view.maps is not None:
        small = cv2.remap(small, *view.maps, cv2.INTER_LINEAR)
    return np.asarray(small, np.uint8)


def _add_frustum(scene: viser.SceneApi, camera: Camera) -> viser.CameraFrustumHandle:
    width, height = camera.size
    return scene.add_camera_frustum(
        f"/cameras/{camera.name}",
        fov=2 * float(np.arctan(height / (2 * camera.matrix[1, 1]))),
        aspect=width / height,
        scale=0.4,
        thickness=0.008,
        color=(60, 66, 74),
        format="jpeg",
        jpeg_quality=_JPEG_QUALITY,
        cast_shadow=False,
        receive_shadow=False,
        wxyz=quaternions(camera.rotation.T[None])[0],
        position=camera.center_m,
    )
