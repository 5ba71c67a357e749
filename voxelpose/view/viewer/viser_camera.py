"""A camera in viser's scene, of the live page."""

from typing import Any

import numpy as np
import viser

from calib.camera import Camera
from silhouette_core.motion.kinematics import quaternions


def add_camera(
    scene: viser.SceneApi, camera: Camera, **look: Any
) -> tuple[viser.CameraFrustumHandle, viser.LabelHandle]:
    """Draws a camera where it stands, with its name."""
    width, height = camera.size
    frustum = scene.add_camera_frustum(
        f"/cameras/{camera.name}",
        fov=2 * float(np.arctan(height / (2 * camera.matrix[1, 1]))),
        aspect=width / height,
        cast_shadow=False,
        wxyz=quaternions(camera.rotation.T[None])[0],
        position=camera.center_m,
        **look,
    )
    return frustum, scene.add_label(f"/cameras/{camera.name}/name", camera.name)
