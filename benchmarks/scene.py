"""A made-up person among made-up cameras: capsules, whose silhouettes are drawn exactly. Needs no
data.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig

# Two ends and a radius each, m: trunk, head, arms, legs. About 75 litres.
CAPSULES = (
    ((0, 0, 0.98), (0, 0, 1.38), 0.145),
    ((0, 0, 1.64), (0, 0, 1.70), 0.095),
    ((0.20, 0, 1.42), (0.42, 0.05, 1.20), 0.05),
    ((0.42, 0.05, 1.20), (0.62, -0.10, 1.25), 0.04),
    ((-0.20, 0, 1.42), (-0.30, 0.02, 1.12), 0.05),
    ((-0.30, 0.02, 1.12), (-0.32, -0.12, 0.90), 0.04),
    ((0.10, 0, 0.90), (0.14, -0.05, 0.48), 0.08),
    ((0.14, -0.05, 0.48), (0.16, 0.05, 0.08), 0.055),
    ((-0.10, 0, 0.90), (-0.12, 0.05, 0.48), 0.08),
    ((-0.12, 0.05, 0.48), (-0.16, 0.18, 0.08), 0.055),
)


def ring(count: int, size: tuple[int, int] = (640, 480)) -> Rig:
    """Makes cameras on a circle of 3.2 m at different heights, looking at the person's middle."""
    cameras = []
    for i in range(count):
        angle = 2 * np.pi * (i + 0.3) / count
        centre = np.array([3.2 * np.cos(angle), 3.2 * np.sin(angle), 1.0 + 0.25 * (i % 4)])
        forward = np.array([0, 0, 0.9]) - centre
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        focal = 0.95 * size[0]
        matrix = np.array(
            [[focal, 0, 0.5 * (size[0] - 1)], [0, focal, 0.5 * (size[1] - 1)], [0, 0, 1]]
        )
        cameras.append(Camera(f"cam_{i}", size, matrix, np.zeros(0), rotation, -rotation @ centre))
    return Rig(tuple(cameras))


def silhouettes(rig: Rig) -> list[NDArray[np.bool_]]:
    """Draws the person as every camera sees it, (h, w) bool."""
    masks = []
    for camera in rig:
        image = np.zeros((camera.size[1], camera.size[0]), np.uint8)
        for first, second, radius in CAPSULES:
            spheres = np.linspace(first, second, 24)
            pixels, depth_m = camera.project(spheres)
            for pixel, depth in zip(pixels, depth_m, strict=True):
                cv2.circle(
                    image,
                    np.rint(pixel).astype(int).tolist(),
                    round(radius * camera.matrix[0, 0] / depth),
                    1,
                    -1,
                )
        masks.append(image.astype(bool))
    return masks
