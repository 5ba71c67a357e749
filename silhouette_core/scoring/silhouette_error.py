"""How well a pose explains the silhouettes: its own, rendered, against those observed."""

from collections.abc import Sequence

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kinematics import place, skin
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.ranking import rounded
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.scoring.backend import Backend


def posed_mesh(model: BodyModel, pose: Pose) -> np.ndarray:
    """Returns the posed vertices (V, 3), world."""
    return posed_meshes(model, [pose])[0]


def posed_meshes(model: BodyModel, poses: Sequence[Pose]) -> np.ndarray:
    """Returns the posed vertices (K, V, 3) of K poses, world."""
    rotation, origin = place(model, *PoseArrays.from_poses(poses).arrays)
    return np.stack([skin(model, *placed) for placed in zip(rotation, origin, strict=True)])


def body_masks(
    model: BodyModel, pose: Pose, views: PinholeViews, backend: Backend
) -> list[np.ndarray]:
    """Where a body is seen in each of C views, (h, w) bool."""
    vertices, masks = posed_meshes(model, [pose]), []
    for camera in views.rig:
        seen = vertices @ camera.rotation.T + camera.translation
        (image,) = backend.part_images(
            seen, model.faces, model.face_part, camera.matrix, camera.size
        )
        masks.append(image > 0)
    return masks


def silhouette_error(
    model: BodyModel, pose: Pose, observation: Observation, backend: Backend
) -> float:
    """Unexplained fraction of the silhouettes, the mean over the cameras of |XOR| / |OR| between
    the pose's and the observed ones: 0 perfect, 1 apart. What is unknown does not count. See
    `Backend.silhouette_errors`.
    """
    return float(mask_errors(model, [pose], observation.views, observation.masks, backend)[0])


def mask_errors(
    model: BodyModel,
    poses: Sequence[Pose],
    views: PinholeViews,
    masks: Sequence[np.ndarray],
    backend: Backend,
) -> np.ndarray:
    """As `silhouette_error` (K,) float64 of K poses, of the silhouettes (h, w) bool of C views;
    `rounded`, since poses are ranked by it.
    """
    in_cameras = posed_meshes(model, poses)[:, None] @ views.rotation.transpose(0, 2, 1)
    in_cameras += views.translation_m[:, None]
    matrices = np.stack([camera.matrix for camera in views.rig])
    errors = backend.silhouette_errors(masks, matrices, in_cameras, model.faces, views.unknown)
    return rounded(errors)
