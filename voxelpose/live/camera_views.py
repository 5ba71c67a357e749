"""The cameras in the page: where they stand, and small pictures of what they see."""

from collections.abc import Sequence

import cv2
import numpy as np
import viser
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.image.silhouettes import UndistortedView
from voxelpose.live.live_frame import LiveFrame
from voxelpose.view.viewer.legend import SILHOUETTE
from voxelpose.view.viewer.scene_renderer import add_camera

_LONG_SIDE_PX = 320


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
        look = {"scale": 0.4, "thickness": 0.008, "color": (60, 66, 74), "receive_shadow": False}
        drawn = (
            add_camera(scene, camera, format="jpeg", jpeg_quality=70, **look) for camera in rig
        )
        self._handles, self._labels = zip(*drawn, strict=True)
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
    """Small picture, (h, w, 3) uint8 RGB, undistorted, with the silhouette's outline.

    Args:
        picture: (H, W, 3) uint8 BGR, as captured.
        silhouette: (h, w) bool, of the picture or of it scaled down; None: no outline.
        view: of the size to be returned.
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
