"""Silhouettes of a recording's frames."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.estimator import Frame, FrameSource
from silhouette_core.image.background import BackgroundModel, BackgroundSettings

_BACKGROUND_FRAMES = 120
_MEDIAN_FRAMES = 40


class Silhouettes:
    """What differs from the background, camera by camera.

    Attributes: without_background: Cameras whose background is the temporal median of the
        recording, for want of an empty view.
    """

    def __init__(
        self,
        source: FrameSource,
        method: Literal["paper", "refined"] = "refined",
        long_side_px: int | None = None,
    ) -> None:
        """Learns the backgrounds of a recording.

        Args: source: The recording. method: See `BackgroundSettings`. long_side_px: Larger pictures
            are scaled down to this before anything else, and their silhouettes are of that size.

        Raises:
            InputError: A background cannot be read, or differs in size from its camera's image.
        """
        self._sizes = {camera.name: scaled_size(camera, long_side_px) for camera in source.rig}
        self._given = source.silhouettes_given
        self._regions = {
            name: self._scaled(name, region.astype(np.uint8)) > 0
            for name, region in source.regions().items()
        }
        self._models: dict[str, BackgroundModel] = {}
        self.without_background: tuple[str, ...] = ()
        if self._given:
            return
        backgrounds = source.backgrounds()
        settings = BackgroundSettings(method=method)
        self.without_background = tuple(
            name for name in source.rig.names if name not in backgrounds
        )
        for name, frames in backgrounds.items():
            self._models[name] = BackgroundModel.from_frames(
                self._all_scaled(name, islice(frames, _BACKGROUND_FRAMES)), settings
            )
        if self.without_background:
            for name, frames in self._samples(source).items():
                self._models[name] = BackgroundModel.from_median(frames, settings)

    def of(self, frames: Mapping[str, Frame]) -> dict[str, NDArray[np.bool_]]:
        """Returns the silhouette (H, W) bool of every camera's frame (H, W, 3) uint8, BGR."""
        return {name: self._one(name, frame) for name, frame in frames.items()}

    def _one(self, name: str, frame: Frame) -> NDArray[np.bool_]:
        region = self._regions.get(name)
        frame = self._scaled(name, frame)
        if not self._given:
            return self._models[name].silhouette(frame, region)
        mask = frame.max(axis=2) > 127
        return mask if region is None else mask & region

    def _scaled(self, name: str, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        if picture.shape[1::-1] == self._sizes[name]:
            return picture
        return cv2.resize(picture, self._sizes[name], interpolation=cv2.INTER_AREA)  # type: ignore[return-value]

    def _all_scaled(self, name: str, pictures: Iterable[Frame]) -> Iterator[Frame]:
        return (self._scaled(name, picture) for picture in pictures)

    def _samples(self, source: FrameSource) -> dict[str, list[Frame]]:
        """Takes frames evenly from the whole recording, few enough for memory."""
        step = max(1, source.frame_count // _MEDIAN_FRAMES)
        found: dict[str, list[Frame]] = {name: [] for name in self.without_background}
        for k, (_, _, frames) in enumerate(source):
            if k % step == 0:
                for name in found:
                    found[name].append(self._scaled(name, frames[name]))
        return found


def scaled_size(camera: Camera, long_side_px: int | None) -> tuple[int, int]:
    """Returns the (width, height) in px of a camera's pictures once they are at most `long_side_px`
    long.
    """
    return camera.pinhole(working_scale(camera, long_side_px)).size


def working_scale(camera: Camera, long_side_px: int | None) -> float:
    """Returns the factor, at most 1, by which a camera's pictures are scaled."""
    return 1.0 if long_side_px is None else min(1.0, long_side_px / max(camera.size))


@dataclass(frozen=True, eq=False)
class UndistortedView:
    """From a camera's silhouette to that of the ideal camera that is fitted.

    Attributes: pinhole: camera without distortion, of the size that `Silhouettes` gives. maps: for
        cv2.remap, from the silhouette at that size; None where that is the pinhole's already.
    """

    pinhole: Camera
    maps: tuple[np.ndarray, np.ndarray] | None

    @classmethod
    def of(cls, camera: Camera, long_side_px: int | None) -> UndistortedView:
        """Prepares a camera whose silhouettes are at most `long_side_px` long."""
        scale = working_scale(camera, long_side_px)
        if camera.is_pinhole:
            return cls(camera.pinhole(scale), None)
        map_x, map_y = (
            (m + np.float32(0.5)) * np.float32(scale) - np.float32(0.5)
            for m in camera.pinhole_maps(scale)
        )
        return cls(camera.pinhole(scale), (map_x, map_y))

    def undistort(self, mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Returns the silhouette (h, w) bool as the pinhole sees it."""
        if self.maps is None:
            return mask
        return cv2.remap(mask.astype(np.uint8) * 255, *self.maps, cv2.INTER_LINEAR) > 127
