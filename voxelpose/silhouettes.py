"""Silhouettes of a recording's frames."""

from collections.abc import Mapping
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from silhouette_core.estimator import FrameSource
from silhouette_core.image.background import BackgroundModel, BackgroundSettings
from voxelpose.footage import Frame

_BACKGROUND_FRAMES = 120
_MEDIAN_FRAMES = 40


class Silhouettes:
    """What differs from the background, camera by camera.

    Attributes:
        without_background: Cameras whose background is the temporal median of the recording, for want of an empty view.
    """

    def __init__(self, source: FrameSource, method: Literal["paper", "refined"] = "refined") -> None:
        """Learns the backgrounds of a recording.

        Args:
            source: The recording.
            method: See `BackgroundSettings`.

        Raises:
            InputError: A background cannot be read, or differs in size from its camera's image.
        """
        self._given = source.silhouettes_given
        self._regions = source.regions()
        self._models: dict[str, BackgroundModel] = {}
        self.without_background: tuple[str, ...] = ()
        if self._given:
            return
        backgrounds = source.backgrounds()
        settings = BackgroundSettings(method=method)
        self.without_background = tuple(name for name in source.rig.names if name not in backgrounds)
        for name, frames in backgrounds.items():
            self._models[name] = BackgroundModel.from_frames(islice(frames, _BACKGROUND_FRAMES), settings)
        if self.without_background:
            for name, frames in _samples(source, self.without_background).items():
                self._models[name] = BackgroundModel.from_median(frames, settings)

    def of(self, frames: Mapping[str, Frame]) -> dict[str, NDArray[np.bool_]]:
        """Returns the silhouette (H, W) bool of every camera's frame (H, W, 3) uint8, BGR."""
        return {name: self._one(name, frame) for name, frame in frames.items()}

    def _one(self, name: str, frame: Frame) -> NDArray[np.bool_]:
        region = self._regions.get(name)
        if not self._given:
            return self._models[name].silhouette(frame, region)
        mask = frame.max(axis=2) > 127
        return mask if region is None else mask & region


def _samples(source: FrameSource, names: tuple[str, ...]) -> dict[str, list[Frame]]:
    """Takes frames evenly from the whole recording, few enough for memory."""
    step = max(1, source.frame_count // _MEDIAN_FRAMES)
    found: dict[str, list[Frame]] = {name: [] for name in names}
    for k, (_, _, frames) in enumerate(source):
        if k % step == 0:
            for name in names:
                found[name].append(frames[name])
    return found
