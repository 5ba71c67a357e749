"""Rigs and masks for the carving tests."""

from dataclasses import replace
from functools import cache

import numpy as np

from benchmarks.board_scene import looking_at
from calib.camera import Camera, Rig
from tests.oracles import carving as reference
from voxelpose.multiview.carving.carver import CarveRule, Masks, mask_list, pack_rig
from voxelpose.multiview.carving.grid import VoxelGrid


def look_at(
    name, centre, target, size=(160, 120), focal=150.0, distortion=(), fisheye=False
) -> Camera:
    """Makes a camera at `centre` that looks at `target`, upright."""
    matrix = np.array(
        [[focal, 0, size[0] / 2 - 0.5], [0, focal * 1.01, size[1] / 2 - 0.3], [0, 0, 1]]
    )
    places = np.asarray(centre, float), np.asarray(target, float)
    return replace(looking_at(name, *places, matrix, size, distortion), fisheye=fisheye)


def any_lens(rng: np.random.Generator) -> dict:
    """Draws the distortion of a camera, of any of the models, or none."""
    if rng.random() < 0.3:
        return {"distortion": rng.uniform(-0.15, 0.15, 4), "fisheye": True}
    sigma = np.array([0.4, 0.2, 0.01, 0.01, 0.1, 0.4, 0.2, 0.05, *[0.01] * 4, 0.05, 0.05])
    return {"distortion": (sigma * rng.uniform(-1, 1, 14))[: rng.choice([0, 4, 5, 8, 12, 14])]}


def any_camera(rng: np.random.Generator, name: str, centre, target) -> Camera:
    """Draws a camera with a skew and any lens at a place."""
    size, focal = tuple(rng.integers(30, 90, 2).tolist()), rng.uniform(25, 120)
    camera = look_at(name, centre, target, size, focal, **any_lens(rng))
    skew = np.outer([1, 0, 0], [0, rng.uniform(-9, 9), 0])
    return replace(camera, matrix=camera.matrix + skew)


def ring(count=4, radius=3.0, height=1.4, **camera) -> Rig:
    """Makes cameras on half a circle, looking at a person's middle."""
    angles = np.linspace(0.1, np.pi + 0.1, count, endpoint=False)
    return Rig(
        tuple(
            look_at(
                f"cam_{i}",
                (radius * np.cos(a), radius * np.sin(a), height + 0.1 * i),
                (0, 0, 0.9),
                **camera,
            )
            for i, a in enumerate(angles)
        )
    )


@cache
def figure_points(spacing=0.02) -> np.ndarray:
    """Samples a body, a head and a raised arm, (N, 3) m."""
    axis = np.arange(-1.2, 2.4, spacing)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    body = (x / 0.2) ** 2 + (y / 0.15) ** 2 + ((z - 0.8) / 0.75) ** 2 < 1
    head = x**2 + y**2 + (z - 1.65) ** 2 < 0.12**2
    arm = (np.abs(x - 0.45) < 0.3) & (np.abs(y) < 0.05) & (np.abs(z - 1.2 - 0.3 * x) < 0.05)
    return np.column_stack([axis_[body | head | arm] for axis_ in (x, y, z)])


def silhouettes(rig: Rig, points: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """Splats points into every camera, 3 x 3 px each."""
    points = figure_points() if points is None else points
    masks = {}
    for camera in rig:
        pixels, _ = camera.project(points)
        pixels = np.rint(pixels[np.isfinite(pixels).all(axis=1)]).astype(int)
        width, height = camera.size
        mask = np.zeros((height, width), bool)
        for dx in (-1, 0, 1):
            for dy in (-1, 0, 1):
                x, y = pixels[:, 0] + dx, pixels[:, 1] + dy
                inside = (x >= 0) & (y >= 0) & (x < width) & (y < height)
                mask[y[inside], x[inside]] = True
        masks[camera.name] = mask
    return masks


def carve_by_reference(
    rig: Rig, masks: Masks, grid: VoxelGrid, rule: CarveRule | None = None
) -> np.ndarray:
    """Carves voxel by voxel, as `voxelpose.multiview.carving.carver.carve` should."""
    rows, kinds, _ = pack_rig(rig)
    given = rule_numbers(rule or CarveRule(), len(rig))
    return reference.carve_voxels(rows, kinds, mask_list(rig, masks), given, grid.axes())


def rule_numbers(rule: CarveRule, cameras: int) -> tuple[int, int]:
    """Most cameras that may object, and fewest that must agree: what `CarveRule` says, and not what
    it computes.
    """
    least = rule.least_agreeing
    if least is None:
        least = max(int(np.floor(0.75 * cameras)) - rule.tolerance, 1)
    return rule.tolerance, least


def voxels_at(grid: VoxelGrid, points_m: np.ndarray) -> np.ndarray:
    """Voxels (N, 3) int64 that hold world points (N, 3), m; they may lie outside the grid."""
    return np.floor(points_m / grid.voxel_size_m).astype(np.int64) - grid.lattice
