"""Silhouettes in memory as an estimator's source: for tests and benchmarks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from calib.camera import Camera, Rig


@dataclass
class SilhouetteSource:
    """Silhouettes as a recording of one camera."""

    camera: Camera
    masks: Sequence[np.ndarray]
    fps: float = 30.0
    repeats: int = 1
    silhouettes_given: bool = True

    def __post_init__(self) -> None:
        self.rig = Rig((self.camera,))

    @property
    def frame_count(self) -> int:
        return self.repeats * len(self.masks)

    def backgrounds(self) -> dict:
        return {}

    def regions(self) -> dict:
        return {}

    def unknown(self) -> dict:
        return {}

    def at(self, steps: Sequence[int]) -> Iterator[dict[str, np.ndarray]]:
        for step in steps:
            mask = self.masks[step % len(self.masks)]
            yield {self.camera.name: np.repeat(mask[..., None].astype(np.uint8) * 255, 3, axis=2)}

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, np.ndarray]]]:
        for frame, frames in enumerate(self.at(range(self.frame_count))):
            yield frame, frame / self.fps, frames
