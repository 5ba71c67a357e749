"""Pictures of the page: moments, the empty view, silhouettes and painted places as overlays."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.estimator import Frame
from silhouette_core.image.silhouettes import Silhouettes
from voxelpose.recording.folder import Recording
from voxelpose.setup_page.drawn_places import DrawnRecording
from voxelpose.view.images.canvas import png

Method = Literal["refined", "paper"]
_KEPT_BYTES = 400_000_000


class MomentFrames:
    """Frames of moments of a recording, the last few of which are kept."""

    def __init__(self, recording: Recording) -> None:
        """Reads nothing yet."""
        self._recording = recording
        self._kept: OrderedDict[int, Mapping[str, Frame]] = OrderedDict()
        self._empty: dict[str, Frame] | None = None
        self._lock = threading.Lock()

    def frames(self, moment: int) -> Mapping[str, Frame]:
        """Frames (H, W, 3) uint8, BGR, by camera name.

        Args:
            moment: time step, from 0.

        Raises:
            InputError: there is no such moment, or it cannot be read.
        """
        count = self._recording.frame_count
        if not 0 <= moment < count:
            raise InputError(f"there is no moment {moment}: choose one from 0 to {count - 1}")
        with self._lock:
            if moment not in self._kept:
                self._kept[moment] = next(iter(self._recording.at([moment])))
                while len(self._kept) > 1 and self._bytes() > _KEPT_BYTES:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(moment)
            return self._kept[moment]

    def empty(self) -> Mapping[str, Frame]:
        """The empty view (H, W, 3) uint8, BGR, by camera name, where there is one.

        Raises:
            InputError: a file cannot be read.
        """
        with self._lock:
            if self._empty is None:
                readers = self._recording.backgrounds()
                self._empty = {name: next(iter(reader)) for name, reader in readers.items()}
            return self._empty

    def _bytes(self) -> int:
        return sum(frame.nbytes for frames in self._kept.values() for frame in frames.values())


class SilhouettePreview:
    """Silhouettes of a recording, whose background models are made in a thread of their own."""

    def __init__(self, recording: Recording) -> None:
        """Makes nothing yet."""
        self._recording = recording
        self._models: dict[Method, Silhouettes | str] = {}
        self._threads: dict[Method, threading.Thread] = {}
        self._lock = threading.Lock()

    def masks(
        self, method: Method, frames: Mapping[str, Frame], source: DrawnRecording
    ) -> dict[str, NDArray[np.bool_]] | None:
        """Silhouettes (H, W) bool by camera name; None while the backgrounds are learned.

        Args:
            method: see `BackgroundSettings`.
            frames: by camera name.
            source: the recording with its regions and unknown places.

        Raises:
            InputError: the backgrounds cannot be read.
        """
        with self._lock:
            model = self._models.get(method)
            if model is None and method not in self._threads:
                self._threads[method] = threading.Thread(
                    target=self._learn, args=(method,), name=f"backgrounds {method}", daemon=True
                )
                self._threads[method].start()
        if model is None:
            return None
        if isinstance(model, str):
            raise InputError(model)
        return model.with_places(source).of(frames)

    def guessed(self, method: Method) -> tuple[str, ...]:
        """Cameras without an empty view, as far as the backgrounds are learned."""
        model = self._models.get(method)
        return model.without_background if isinstance(model, Silhouettes) else ()

    def _learn(self, method: Method) -> None:
        model: Silhouettes | str = "the backgrounds could not be learned: see the terminal"
        try:
            model = Silhouettes(DrawnRecording(**vars(self._recording)), method)
        except InputError as error:
            model = str(error)
        finally:
            with self._lock:
                self._models[method] = model


def overlay_png(mask: NDArray[np.bool_], colour: tuple[int, int, int], alpha: int) -> bytes:
    """A mask as a picture to be laid over another: PNG, transparent where it is False.

    Args:
        mask: (H, W) bool, whose edge is drawn opaque.
        colour: red, green, blue.
        alpha: opacity of the inside, 0 to 255.
    """
    image = np.zeros((*mask.shape, 4), np.uint8)
    image[mask] = (*colour[::-1], alpha)
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    thickness = max(1, round(max(mask.shape) / 640))
    cv2.drawContours(image, contours, -1, (*colour[::-1], 255), thickness)
    return png(image)
