"""A small source of frames for tests: grey pictures of any rig, no files."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from calib.camera import Camera, Rig


def ring(count: int = 3, size: tuple[int, int] = (160, 120), distortion: tuple[float, ...] = ()) -> Rig:
    """Cameras on a half circle of 4 m around a person, at 1.4 m height, looking at 1 m height."""
    cameras = []
    for number in range(count):
        angle = np.pi * number / count
        center = np.array([4 * np.sin(angle), -4 * np.cos(angle), 1.4])
        forward = np.array([0, 0, 1.0]) - center
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        focal = 1.1 * size[1]
        matrix = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1.0]])
        cameras.append(Camera(f"cam_{number + 1}", size, matrix, np.array(distortion), rotation, -rotation @ center))
    return Rig(tuple(cameras))


@dataclass
class GreySource:
    """Frames without anything on them."""

    rig: Rig
    frame_count: int
    fps: float = 25.0
    silhouettes_given: bool = False
    grey: int = 90

    def backgrounds(self) -> dict:
        return {}

    def regions(self) -> dict:
        return {}

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, np.ndarray]]]:
        for frame in range(self.frame_count):
            yield frame, frame / self.fps, {c.name: np.full((c.size[1], c.size[0], 3), self.grey, np.uint8) for c in self.rig}
