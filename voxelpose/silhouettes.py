"""Silhouettes of a recording's frames."""

from collections.abc import Mapping
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.background import BackgroundModel
from voxelpose.footage import Frame
from voxelpose.recording import Recording

_BACKGROUND_FRAMES = 120
_MEDIAN_FRAMES = 40


class Silhouettes:
    """What differs from the background, camera by camera.

    Attributes:
        without_background: Cameras whose background is the temporal median of the recording, for want of an empty view.
    """

    def __init__(self, recording: Recording) -> None:
        """Learns the backgrounds of a recording.

        Raises:
            InputError: A background cannot be read, or differs in size from its camera's image.
        """
        self._given = recording.silhouettes_given
        self._regions = recording.regions()
        self._models: dict[str, BackgroundModel] = {}
        self.without_background: tuple[str, ...] = ()
        if self._given:
            return
        backgrounds = recording.backgrounds()
        self.without_background = tuple(name for name in recording.rig.names if name not in backgrounds)
        for name in recording.rig.names:
            if name in backgrounds:
                self._models[name] = BackgroundModel.from_frames(islice(backgrounds[name], _BACKGROUND_FRAMES))
            else:
                footage = recording.footage[name]
                step = max(1, footage.frame_count // _MEDIAN_FRAMES)
                self._models[name] = BackgroundModel.from_median(islice(footage, 0, None, step))

    def of(self, frames: Mapping[str, Frame]) -> dict[str, NDArray[np.bool_]]:
        """Returns the silhouette (H, W) bool of every camera's frame (H, W, 3) uint8, BGR."""
        return {name: self._one(name, frame) for name, frame in frames.items()}

    def _one(self, name: str, frame: Frame) -> NDArray[np.bool_]:
        region = self._regions.get(name)
        if not self._given:
            return self._models[name].silhouette(frame, region)
        mask = frame.max(axis=2) > 127
        return mask if region is None else mask & region
