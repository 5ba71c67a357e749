"""How well a pose explains the silhouettes: its own, rendered, against those observed."""

from __future__ import annotations

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kinematics import forward, quaternions, skin
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CPU


def posed_mesh(model: BodyModel, pose: Pose) -> np.ndarray:
    """Returns the posed vertices (V, 3), world."""
    rotation, origin = forward(
        model, pose.root_m[None], quaternions(pose.root_rotation[None]), pose.angles_rad[None]
    )
    return skin(model, rotation[0], origin[0])


def silhouette_error(
    model: BodyModel, pose: Pose, observation: Observation, backend: Backend = CPU
) -> float:
    """Unexplained fraction of the silhouettes, the mean over the cameras of |XOR| / |OR| between
    the pose's and the observed ones: 0 perfect, 1 apart. See `Backend.silhouette_errors`.
    """
    views = observation.views
    in_cameras = posed_mesh(model, pose) @ views.rotation.transpose(0, 2, 1)
    in_cameras += views.translation_m[:, None]
    matrices = np.stack([camera.matrix for camera in views.rig])
    return float(
        backend.silhouette_errors(observation.masks, matrices, in_cameras[None], model.faces)[0]
    )
