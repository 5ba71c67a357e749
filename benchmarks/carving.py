"""Carving against Open3D, a plain loop, and other resolutions and rules."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.cases import Case, Timed, case
from benchmarks.scene import ring, silhouettes
from calib.camera import Rig
from silhouette_core.jit import parallel_kernel, prange
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.view.open3d_import import import_open3d

VIEWS = 8


def scene(voxels: int) -> tuple[Rig, list[NDArray[np.bool_]], VoxelGrid]:
    """Rig, masks and a cube of two metres around the person."""
    rig = ring(VIEWS)
    grid = VoxelGrid(np.array([-1.0, -1.0, -0.1]), 2.0 / voxels, (voxels, voxels, voxels))
    return rig, silhouettes(rig), grid


def open3d_carve(rig: Rig, masks: list[NDArray[np.bool_]], grid: VoxelGrid) -> Timed:
    """Open3D's carving of the same volume; making its dense grid is not timed."""
    open3d = import_open3d()
    images = [open3d.geometry.Image(mask.astype(np.float32)) for mask in masks]
    cameras = []
    for camera in rig:
        parameters = open3d.camera.PinholeCameraParameters()
        parameters.intrinsic = open3d.camera.PinholeCameraIntrinsic(*camera.size, camera.matrix)
        parameters.extrinsic = np.block(
            [[camera.rotation, camera.translation[:, None]], [np.zeros((1, 3)), np.ones((1, 1))]]
        )
        cameras.append(parameters)

    def dense() -> Any:
        # Its grid holds voxel 0's lower corner at the origin, as ours does.
        return open3d.geometry.VoxelGrid.create_dense(
            grid.origin_m, np.zeros(3), grid.voxel_size_m, *grid.size_m
        )

    def carve_silhouettes(dense_grid: Any) -> Any:
        for image, parameters in zip(images, cameras, strict=True):
            dense_grid.carve_silhouette(image, parameters, True)
        return dense_grid

    return Timed(carve_silhouettes, dense)


@case("carve 128^3 x 8 views")
def against_open3d() -> Case:
    rig, masks, grid = scene(128)

    def check(ours: NDArray[np.bool_], theirs: Any) -> str:
        kept = np.array([voxel.grid_index for voxel in theirs.get_voxels()])
        occupied = np.zeros(np.add(grid.shape, 2), dtype=bool)
        occupied[tuple(kept.T)] = True
        # Open3D keeps a voxel if any corner is foreground: all of ours, and a layer around them.
        inside = occupied[: grid.shape[0], : grid.shape[1], : grid.shape[2]]
        missing = np.count_nonzero(ours & ~inside) / np.count_nonzero(ours)
        return f"{missing:.1%} of our voxels are not among Open3D's" if missing > 0.01 else ""

    ours = Timed(lambda _: carve(rig, masks, grid), repeats=150)
    return Case(
        ours,
        open3d_carve(rig, masks, grid),
        "open3d carve_silhouette",
        check,
        rounds=5,
        goal="at least 300, better 900",
    )


@case("carve 256^3 x 8 views (to 128^3)")
def against_half_the_resolution() -> Case:
    rig, masks, fine = scene(256)
    _, _, coarse = scene(128)
    ours, reference = (
        Timed(lambda _, grid=grid: carve(rig, masks, grid), repeats=50) for grid in (fine, coarse)
    )
    return Case(ours, reference, "ours at 128^3", rounds=10, goal="at most 5", longer=True)


@parallel_kernel
def carve_every_voxel(projections, masks, xs, ys, zs, occupancy):
    """Carves voxel by voxel, without blocks."""
    height, width = masks.shape[1:]
    for i in prange(len(xs)):
        for j in range(len(ys)):
            for k in range(len(zs)):
                visible, kept = False, True
                for c in range(len(projections)):
                    p = projections[c]
                    w = ((p[2, 0] * xs[i] + p[2, 1] * ys[j]) + p[2, 3]) + p[2, 2] * zs[k]
                    if not w > 0.0:
                        continue
                    inverse = 1.0 / w
                    u = (
                        ((p[0, 0] * xs[i] + p[0, 1] * ys[j]) + p[0, 3]) + p[0, 2] * zs[k]
                    ) * inverse + 0.5
                    v = (
                        ((p[1, 0] * xs[i] + p[1, 1] * ys[j]) + p[1, 3]) + p[1, 2] * zs[k]
                    ) * inverse + 0.5
                    if u >= 0.0 and v >= 0.0 and u < width and v < height:
                        visible = True
                        if not masks[c, int(v), int(u)]:
                            kept = False
                            break
                occupancy[i, j, k] = visible and kept


@case("carve 128^3 x 8 views, every voxel")
def against_every_voxel() -> Case:
    rig, masks, grid = scene(128)
    projections, stack = np.stack([camera.projection for camera in rig]), np.stack(masks)

    def dense(occupancy: NDArray[np.bool_]) -> NDArray[np.bool_]:
        carve_every_voxel(projections, stack, *grid.axes(), occupancy)
        return occupancy

    def check(ours: NDArray[np.bool_], theirs: NDArray[np.bool_]) -> str:
        differing = np.count_nonzero(ours ^ theirs)
        return f"{differing} voxels differ" if differing else ""

    ours = Timed(lambda _: carve(rig, masks, grid), repeats=20)
    return Case(
        ours,
        Timed(dense, lambda: np.empty(grid.shape, np.bool_), repeats=3),
        "the same rule in a numba loop",
        check,
    )


@case("carve a window, 100^3 x 4 views")
def one_bad_camera() -> Case:
    rig = ring(4)
    masks = silhouettes(rig)
    grid = VoxelGrid(np.array([-1.0, -1.0, -0.1]), 0.02, (100, 100, 100))
    plain, tolerant = (
        Timed(lambda _, rule=rule: carve(rig, masks, grid, rule), repeats=50)
        for rule in (CarveRule(), CarveRule(1))
    )
    return Case(plain, tolerant, "the same with a tolerance of one camera")
