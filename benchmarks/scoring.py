"""The compiled scoring backend against the one in NumPy, method by method."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.carving import scene
from benchmarks.cases import Case, Timed, case
from benchmarks.scene import ring, silhouettes
from examples.numpy_backend import NumpyBackend
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.image.spans import Spans
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.backend import Backend, Target
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.silhouette_error import posed_mesh
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid

_PLACEMENTS = 2000


def _case(score: Callable[[Backend], object], repeats: int) -> Case:
    return Case(
        Timed(lambda _: score(CpuBackend()), repeats=repeats),
        Timed(lambda _: score(NumpyBackend())),
        "NumPy",
        lambda a, b: "" if np.allclose(a, b) else "the results differ",
    )


def _hull() -> tuple[VoxelGrid, np.ndarray, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """A hull, and a part of 400 points in many placements."""
    rig, masks, grid = scene(128)
    rng = np.random.default_rng(0)
    points = rng.normal(size=(400, 3)) * (0.05, 0.05, 0.15)
    rotations = Rotation.random(_PLACEMENTS, random_state=0).as_matrix()
    positions = rng.normal(size=(_PLACEMENTS, 3)) * 0.2 + (0, 0, 1.2)
    return grid, carve(rig, masks, grid), (points, rotations, positions)


@case("voxel overlap, 2000 placements")
def voxel_overlap() -> Case:
    grid, occupancy, (points, *placed) = _hull()
    weights = np.full(len(points), 1e-5)
    return _case(lambda own: own.voxel_overlap(grid, occupancy, points, weights, *placed), 5)


@case("voxel cover, 2000 placements")
def voxel_cover() -> Case:
    grid, occupancy, placed = _hull()
    numbers = np.where(occupancy, np.cumsum(occupancy).reshape(grid.shape) - 1, -1)
    numbers, words = numbers.astype(np.int32), int(occupancy.sum()) // 64 + 1
    return _case(lambda own: own.voxel_cover(grid, numbers, words, *placed)[0], 5)


@case("pixel scores, 2000 placements")
def pixel_scores() -> Case:
    rig, masks, _ = scene(128)
    images = np.where(np.stack(masks), 2, -3).astype(np.int8)
    views, (_, _, placed) = PinholeViews.from_rig(rig), _hull()
    return _case(lambda own: own.pixel_scores(views, images, placed[0][::7], *placed[1:]), 5)


@case("silhouette distance, 2000 poses")
def span_distances() -> Case:
    mask = silhouettes(ring(1, (320, 240)))[0]
    shifts = np.random.default_rng(0).integers(-30, 30, (2000, 2))
    spans = Spans.from_masks([np.roll(mask, tuple(shift), (0, 1)) for shift in shifts])
    target = Target((mask,), (np.ones(mask.shape, np.float32),))
    return _case(lambda own: own.span_distances(target, spans, np.arange(len(spans))), 20)


@case("silhouette error, 4 cameras")
def silhouette_errors() -> Case:
    rig = ring(4)
    model, views = BodyModel.from_sizes(BodySizes(1.75)), PinholeViews.from_rig(rig)
    pose = Pose(np.array([0, 0, 0.95]), np.eye(3), np.zeros(model.dof_count))
    meshes = posed_mesh(model, pose) @ views.rotation.transpose(0, 2, 1)
    meshes += views.translation_m[:, None]
    matrices, masks = np.stack([camera.matrix for camera in rig]), silhouettes(rig)
    faces = model.faces
    return _case(lambda own: own.silhouette_errors(masks, matrices, meshes[None], faces), 10)


@case("drawn weights, 20 poses")
def drawn_weights() -> Case:
    (camera,) = ring(1, (160, 120))
    model, rng = BodyModel.from_sizes(BodySizes(1.75)), np.random.default_rng(0)
    poses = (
        Pose(np.array([0, 0, 0.95]), np.eye(3), rng.normal(0, 0.2, model.dof_count))
        for _ in range(20)
    )
    meshes = np.stack([posed_mesh(model, pose) @ camera.rotation.T for pose in poses])
    meshes += camera.translation
    weights = rng.normal(size=camera.size[::-1])
    return _case(lambda own: own.drawn_weights(weights, meshes, model.faces, camera.matrix), 5)
