"""A person filmed for the filter's tests: silhouettes of a posed body, in memory or as frames."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from benchmarks.board_scene import looking_at
from calib.camera import Camera
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.image.raster import render_parts
from silhouette_core.monocular.tracking.pose_modes import FrameModes
from silhouette_core.monocular.window import Window
from silhouette_core.motion.keyposes.notation import movements
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.motion.kinematics import landmarks, place, rotation_matrices
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.scoring.silhouette_error import posed_mesh

STATURE_M = 1.75
MOVEMENTS = ("walk", "wave", "arm swing both", "reach aside", "squat", "kick")


def joints_at(model: BodyModel, pose: Pose) -> np.ndarray:
    """Joints (15, 3) of a pose in the world."""
    return landmarks(model, *place(model, *PoseArrays.from_poses([pose]).arrays))[0]


def camera_at(
    center_m: Sequence[float],
    target_m: Sequence[float] = (0, 0, 0.95),
    size: tuple[int, int] = (480, 360),
) -> Camera:
    """Returns a level camera that looks at a point."""
    focal, (x, y) = 1.1 * size[1], (np.array(size) - 1) / 2
    matrix = np.array([[focal, 0, x], [0, focal, y], [0, 0, 1.0]])
    places = np.asarray(center_m, float), np.asarray(target_m, float)
    return looking_at("cam_1", *places, matrix, size)


def body(shape: Sequence[float] = ()) -> BodyModel:
    model = _usual_body()
    if len(shape):
        model = model.reshaped(np.array([*shape, *np.zeros(len(model.shape) - len(shape))]))
    return model


@cache
def _usual_body() -> BodyModel:
    return BodyModel.from_sizes(BodySizes(STATURE_M))


@cache
def performed(name: str, model: BodyModel | None = None) -> Motion:
    return perform(movements()[name], model or body())


def poses_of(motion: Motion) -> list[Pose]:
    rotation = rotation_matrices(motion.root_quaternion)
    return [Pose(motion.root_m[t], rotation[t], motion.angles_rad[t]) for t in range(len(motion))]


def silhouette(model: BodyModel, pose: Pose, camera: Camera) -> np.ndarray:
    seen = posed_mesh(model, pose) @ camera.rotation.T + camera.translation
    return render_parts(seen, model.faces, model.face_part, camera.matrix, camera.size)[0] > 0


def films(motion: Motion, camera: Camera, rows: Sequence[int]) -> list[np.ndarray]:
    poses = poses_of(motion)
    return [silhouette(motion.model, poses[row], camera) for row in rows]


def prior_at(joints_m: np.ndarray, sigma_m: float) -> LandmarkPrior:
    """Joints (15, 3) as a mode of a proposal."""
    precision = np.tile(np.eye(3) / sigma_m**2, (15, 1, 1))
    return LandmarkPrior(joints_m - joints_m[0], precision, joints_m[0], precision[0])


def proposed(
    poses: Sequence[Pose],
    probability: Sequence[float],
    distance_m: float = 4.0,
    sigma_m: float = 0.1,
) -> FrameModes:
    """A proposal of some poses."""
    priors = [prior_at(joints_at(body(), pose), sigma_m) for pose in poses]
    return FrameModes(np.array(probability), priors, distance_m)


def window_pixels(window: Window, points_m: np.ndarray) -> np.ndarray:
    """Pixels (N, 2) of world points (N, 3), m, in a window."""
    in_camera = (np.atleast_2d(points_m) - window.center_m) @ window.world_from_virtual
    return window.axis_px + window.focal_px * in_camera[:, :2] / in_camera[:, 2:]
