"""How well a pose explains the silhouettes: its own, rendered, against those seen."""

from __future__ import annotations

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.image.raster import render_parts
from silhouette_core.motion.kinematics import forward, quaternions, skin
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.pose import Pose


def posed_mesh(model: BodyModel, pose: Pose) -> np.ndarray:
    """Returns the posed vertices (V, 3), world."""
    rotation, origin = forward(
        model, pose.root_m[None], quaternions(pose.root_rotation[None]), pose.angles_rad[None]
    )
    return skin(model, rotation[0], origin[0])


def silhouette_error(model: BodyModel, pose: Pose, observation: Observation) -> float:
    """Returns the mean over the cameras of |XOR| / |OR| between the pose's silhouettes and those
    seen: 0 perfect, 1 apart.

    Cameras that see nothing of the body and should not are left out; with none left the error is 1.
    """
    vertices = posed_mesh(model, pose)
    views = observation.views
    errors = []
    for c, mask in enumerate(observation.masks):
        in_camera = vertices @ views.rotation[c].T + views.translation_m[c]
        camera = views.rig.cameras[c]
        parts, _ = render_parts(
            in_camera, model.faces, model.face_part, camera.matrix, camera.size, cull_back=True
        )
        drawn = parts > 0
        either = np.count_nonzero(drawn | mask)
        if either:
            errors.append(np.count_nonzero(drawn ^ mask) / either)
    return float(np.mean(errors)) if errors else 1.0
