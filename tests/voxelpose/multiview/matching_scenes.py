"""Bodies in front of cameras for the matching tests. What is photographed is never the body that is
fitted.
"""

from functools import cache

import cv2
import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import IS_CLOTHING, SHAPE_SIGMA, BodySizes
from silhouette_core.image.raster import render_parts
from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.scoring.silhouette_error import posed_mesh
from tests.voxelpose.multiview.carving.carving_scenes import look_at
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.joint_search import best_together
from voxelpose.multiview.matching.matcher import MatchSettings, _interfering, _Search

STATURE_M = 1.72


@cache
def fitting_model() -> BodyModel:
    """The man's template at the right stature."""
    return BodyModel.from_sizes(BodySizes(STATURE_M, sex="male"))


@cache
def other_body(seed: int = 3, template: str = "female") -> BodyModel:
    """Somebody else of that stature: the woman's template (another mesh) with the deviations of a
    real person, drawn at random.
    """
    body = BodyModel.from_sizes(BodySizes(STATURE_M, sex=template))
    drawn = np.clip(np.random.default_rng(seed).normal(size=len(SHAPE_SIGMA)), -1.5, 1.5)
    return body.reshaped(drawn * SHAPE_SIGMA * ~IS_CLOTHING)


def views(count: int = 6, size: tuple[int, int] = (320, 320)) -> PinholeViews:
    """Cameras all around at 3.5 m, alternately low and high."""
    angles = 2 * np.pi * (np.arange(count) + 0.3) / count
    places = [(3.5 * np.cos(a), 3.5 * np.sin(a), (1.0, 2.2)[k % 2]) for k, a in enumerate(angles)]
    return PinholeViews.from_rig(
        Rig(
            tuple(
                look_at(f"cam_{k + 1}", place, (0, 0, 0.9), size, 0.9 * size[0])
                for k, place in enumerate(places)
            )
        )
    )


def stance(
    model: BodyModel,
    turns_deg: dict[str, float] | None = None,
    place_m: tuple[float, float] = (0.0, 0.0),
) -> Pose:
    """The relaxed stance with some angles changed, the pelvis above `place_m`."""
    angles = RELAXED_RAD.copy()
    for name, degrees in (turns_deg or {}).items():
        angles[model.tree.dof_names.index(name)] = np.radians(degrees)
    return Pose(model.joints_m[0] + (*place_m, 0.0), np.eye(3), angles)


def turned(pose: Pose, yaw_deg: float, pitch_deg: float = 0.0) -> Pose:
    """A pose whose root is turned about z, or about x."""
    step = np.zeros(6 + len(pose.angles_rad))
    step[5], step[3] = np.radians(yaw_deg), np.radians(pitch_deg)
    return pose.moved(step)


def photograph(seen_by: PinholeViews, model: BodyModel, pose: Pose) -> list[np.ndarray]:
    """Returns the silhouette (h, w) bool in every view."""
    vertices = posed_mesh(model, pose)
    masks = []
    for camera in seen_by.rig:
        in_camera = vertices @ camera.rotation.T + camera.translation
        masks.append(
            render_parts(in_camera, model.faces, model.face_part, camera.matrix, camera.size)[0] > 0
        )
    return masks


def board_on_floor(seen_by: PinholeViews, corner_m: tuple[float, float]) -> list[np.ndarray]:
    """Pixels (h, w) bool of a board of 1.1 m by 0.9 m that lies on the floor, in every view."""
    x, y = corner_m
    corners = np.array([[x, y, 0], [x + 1.1, y, 0], [x + 1.1, y + 0.9, 0], [x, y + 0.9, 0]])
    masks = []
    for camera in seen_by.rig:
        mask = np.zeros(camera.size[::-1], np.uint8)
        cv2.fillConvexPoly(mask, np.rint(camera.project(corners)[0]).astype(np.int32), 1)
        masks.append(mask > 0)
    return masks


def observe(seen_by: PinholeViews, model: BodyModel, pose: Pose) -> Observation:
    """Returns what refinement is given of a frame."""
    return Observation.from_masks(seen_by, photograph(seen_by, model, pose), 3.5)


def hull(
    seen_by: PinholeViews, model: BodyModel, pose: Pose, voxel_size_m: float = 0.03
) -> tuple[VoxelGrid, np.ndarray]:
    """Returns the visual hull of a posed body."""
    vertices = posed_mesh(model, pose)
    grid = VoxelGrid.from_bounds(vertices.min(0) - 0.1, vertices.max(0) + 0.1, voxel_size_m)
    return grid, carve(seen_by.rig, photograph(seen_by, model, pose), grid)


def joints(model: BodyModel, pose: Pose) -> np.ndarray:
    """Returns the 15 joints (15, 3), world."""
    return landmarks(model, *place(model, *PoseArrays.from_poses([pose]).arrays))[0]


def joint_errors_m(model: BodyModel, pose: Pose, truth_model: BodyModel, truth: Pose) -> np.ndarray:
    """Returns the distances (15,) of the joints of two posed bodies."""
    return np.linalg.norm(joints(model, pose) - joints(truth_model, truth), axis=1)


def groups_apart(
    body_volume: BodyVolume, start: Pose, grid: VoxelGrid, occupancy: np.ndarray
) -> int:
    """Returns the number of groups on the first level, which together score what all its limbs at
    once do.
    """
    search = _Search([(body_volume, start)], grid, occupancy, MatchSettings())
    search.decide_roots()
    limbs = search.selectable()
    groups = [limbs, *_interfering(limbs)]
    at_once, *apart = [
        best_together([limb.bits for limb in group], [limb.cost for limb in group]).score
        for group in groups
    ]
    assert sum(apart) == pytest.approx(at_once)
    return len(apart)
