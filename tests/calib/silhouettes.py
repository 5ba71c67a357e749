"""A walking figure of spheres, and what cameras see of it."""

from itertools import pairwise

import numpy as np
from boards import looking_at

from calib.camera import Camera, Rig

CHAINS = (
    ((0, 0, 1.65, 0.13), (0, 0, 1.35, 0.17), (0, 0, 0.9, 0.16)),
    ((0.15, 0, 1.42, 0.08), (0.25, 0.1, 1.2, 0.06), (0.3, 0.4, 1.2, 0.05)),
    ((-0.15, 0, 1.42, 0.08), (-0.35, -0.05, 1.2, 0.06), (-0.42, -0.05, 0.9, 0.05)),
    (
        (0.1, 0, 0.9, 0.11),
        (0.12, 0.15, 0.48, 0.08),
        (0.12, 0.1, 0.08, 0.06),
        (0.12, 0.25, 0.05, 0.05),
    ),
    (
        (-0.1, 0, 0.9, 0.11),
        (-0.12, -0.1, 0.48, 0.08),
        (-0.12, -0.35, 0.12, 0.06),
        (-0.12, -0.25, 0.05, 0.05),
    ),
)
LIMBS = np.array(
    [
        (1 - t) * np.array(a) + t * np.array(b)
        for chain_poses in CHAINS
        for a, b in pairwise(chain_poses)
        for t in np.linspace(0, 1, 6)
    ]
)


def figure(step: float) -> np.ndarray:
    """Returns spheres (N, 4), centre and radius in m, of a figure that walks and turns."""
    angle = 0.12 * step
    swing = np.where(LIMBS[:, 2] < 0.8, 0.3, 0.2) * np.sin(0.5 * step) * np.sign(LIMBS[:, 0])
    x, y = LIMBS[:, 0], LIMBS[:, 1] + swing * (np.abs(LIMBS[:, 0]) > 0.05)
    turned = np.column_stack(
        [
            np.cos(angle) * x - np.sin(angle) * y,
            np.sin(angle) * x + np.cos(angle) * y,
            LIMBS[:, 2],
            LIMBS[:, 3],
        ]
    )
    return turned + np.array([0.5 * np.cos(0.1 * step), 0.06 * step - 0.4, 0, 0])


def mask(camera: Camera, rays: np.ndarray, spheres: np.ndarray) -> np.ndarray:
    """Returns the silhouette (H, W) bool of spheres: pixels whose rays (H, W, 3) pass within a
    radius.
    """
    width, height = camera.size
    hit = np.zeros((height, width), dtype=bool)
    pixels, depths = camera.project(spheres[:, :3])
    for (*centre, radius), (x, y), depth in zip(spheres, pixels, depths, strict=True):
        reach = 1.5 * camera.matrix[0, 0] * radius / depth + 3
        window = np.s_[
            max(0, int(y - reach)) : max(0, int(y + reach)),
            max(0, int(x - reach)) : max(0, int(x + reach)),
        ]
        toward = np.array(centre) - camera.center_m
        hit[window] |= toward @ toward - (rays[window] @ toward) ** 2 < radius**2
    return hit


def stage(count: int = 4) -> Rig:
    """Returns cameras about the figure, of different heights, with a bent lens."""
    matrix = np.array([[300.0, 0, 159.5], [0, 300, 119.5], [0, 0, 1]])
    cameras = []
    for index in range(count):
        angle = 0.3 + 0.75 * index
        place = np.array([4 * np.cos(angle), 4 * np.sin(angle), 1.0 + 0.5 * (index % 3)])
        cameras.append(
            looking_at(
                f"cam_{index}", place, np.array([0, 0, 0.9]), matrix, (320, 240), (-0.1, 0.02, 0, 0)
            )
        )
    return Rig(tuple(cameras))


def filmed(
    rig: Rig,
    count: int,
    begin: dict[str, float] | None = None,
    pace: dict[str, float] | None = None,
) -> dict[str, list[np.ndarray]]:
    """Returns silhouettes of every frame by camera, which may begin later than at step 0 and take
    more than a step per frame.
    """
    film = {}
    for camera in rig:
        width, height = camera.size
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        rays = camera.rays(np.column_stack([x.ravel(), y.ravel()]))[1].reshape(height, width, 3)
        first, step = (begin or {}).get(camera.name, 0.0), (pace or {}).get(camera.name, 1.0)
        film[camera.name] = [
            mask(camera, rays, figure(first + step * frame)) for frame in range(int(count / step))
        ]
    return film
