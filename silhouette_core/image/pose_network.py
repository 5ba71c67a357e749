"""The pose network that a user installed: what it sees of one person in a square of a picture.

MediaPipe's pose landmark network (BlazePose), run by LiteRT or OpenCV; from where: `network_files`.

Source: Bazarevsky et al., BlazePose: On-device real-time body pose tracking (2020).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import BoolArray, ByteArray, Float32Array, FloatArray, RealArray
from silhouette_core.estimator import Frame
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.tuning import PRESENCE

FILE = Path(__file__).with_suffix(".toml")
"""What was fitted to its outputs: log odds of pixels over what the mask says; of the joints weights
of the points, deviations across viewing rays, and what is added for those that are not seen."""
POINTS = 33  #: Points of the body that the network gives, MediaPipe's numbers 0 to 32.
_SIDE_PX = 256  # of the square that the network takes
_STEPS, _MOST = 8, 127  # of a nat, in which logits are kept, and the most of them
_HEADS = "Identity", "Identity_1", "Identity_2"
Outputs = Callable[[Float32Array], list[Float32Array]]
"""Points, presence and mask by a picture (256, 256, 3) float32, RGB, from 0 to 1."""


@dataclass(frozen=True)
class Crop:
    """A square of a picture, turned, which may reach beyond it."""

    x_px: float  #: column of its centre.
    y_px: float  #: row of its centre.
    side_px: float  #: length of a side.
    turn_rad: float = 0.0  #: by which its upward axis is turned to the right from the picture's.

    @classmethod
    def about(cls, x_px: float, y_px: float, longer_px: float, turn_rad: float = 0.0) -> Crop:
        """The square about a person's middle, by the longer side of the person."""
        (margin,) = fitted_weights(FILE)["margin"]
        return cls(x_px, y_px, max(margin * longer_px, 16.0), turn_rad)

    @classmethod
    def around(cls, box_px: FloatArray) -> Crop:
        """The square about a person in a box (2, 2) of corners."""
        x, y = box_px.mean(axis=0).tolist()
        return cls.about(x, y, float((box_px[1] - box_px[0]).max()))

    @property
    def from_network(self) -> FloatArray:
        """(2, 3): pixels of the picture from those of the network's square."""
        scale, half = self.side_px / _SIDE_PX, 0.5 * (_SIDE_PX - 1)
        cos, sin = scale * np.cos(self.turn_rad), scale * np.sin(self.turn_rad)
        x, y = self.x_px - half * (cos - sin), self.y_px - half * (sin + cos)
        return np.array([[cos, -sin, x], [sin, cos, y]])


@dataclass(frozen=True, eq=False)
class PersonSeen:
    """What the network sees of one person."""

    crop: Crop  #: where it looked.
    presence: float  #: probability that somebody is there.
    logits: NDArray[np.int8]  #: (256, 256) int8, eighths of a nat: odds of the person.
    points_px: FloatArray  #: (33, 2), in the picture.
    visibility: FloatArray  #: (33,), probability that a point is seen.
    circle_px: FloatArray
    """(2, 2) centre of the person and a point above it, on the circle that holds the whole body."""

    @property
    def is_there(self) -> bool:
        """Whether somebody is more likely there than not."""
        return self.presence > 0.5 and bool((self.logits > 0).any())

    @property
    def is_sure(self) -> bool:
        """Whether somebody is there for sure."""
        return self.presence >= PRESENCE.sure and self.is_there

    @cached_property
    def outline_px(self) -> FloatArray | None:
        """(N, 2) outline in the picture of the largest piece of the mask; None without a mask."""
        mask = (self.logits > 0).view(np.uint8)
        pieces, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        if not pieces:
            return None
        largest = max(pieces, key=cv2.contourArea)[:, 0].astype(float)
        back = self.crop.from_network
        return largest @ back[:, :2].T + back[:, 2]

    @property
    def box_px(self) -> FloatArray | None:
        """(2, 2) corners of the box about the outline; None without a mask."""
        outline = self.outline_px
        return None if outline is None else np.array([outline.min(0), outline.max(0)])

    def odds(self, size: tuple[int, int], scale: float) -> Float32Array:
        """Odds of the person (h, w) float32, nats, in an image of the picture; outside of the
        square the lowest.

        Args:
            size: width and height of the image.
            scale: of the image, relative to the picture.
        """
        matrix = self.crop.from_network * scale
        matrix[:, 2] += 0.5 * (scale - 1)
        return self._warped(matrix, size)

    def odds_in(self, crop: Crop) -> Float32Array:
        """The same (256, 256) in the pixels of another square."""
        back = cv2.invertAffineTransform(crop.from_network)
        matrix = back[:, :2] @ self.crop.from_network
        matrix[:, 2] += back[:, 2]
        return self._warped(matrix, (_SIDE_PX, _SIDE_PX))

    def _warped(self, matrix: RealArray, size: tuple[int, int]) -> Float32Array:
        """Odds (h, w) in an image to which an affine (2, 3) leads from the square."""
        logits, outside = self.logits.astype(np.float32) / _STEPS, -_MOST / _STEPS
        if not self.is_sure:  # what it misses then says nothing
            logits = np.maximum(logits, 0)
        return cv2.warpAffine(logits, matrix, size, flags=cv2.INTER_LINEAR, borderValue=outside)  # type: ignore[return-value]


class PoseNetwork:
    """The network, for one thread."""

    def __init__(self, path: Path) -> None:
        self._outputs = _litert(path) or _opencv(path)
        self._path = path

    def __reduce__(self) -> tuple[type[PoseNetwork], tuple[Path]]:
        """Another process reads the file itself."""
        return PoseNetwork, (self._path,)

    def look(self, picture: Frame, crop: Crop, others: BoolArray | None = None) -> PersonSeen:
        """What is seen of a person in a square of a picture (H, W, 3) uint8, BGR; where others are,
        (256, 256), there is the mean colour instead.
        """
        square = cropped(picture, crop)[..., ::-1].astype(np.float32)
        square /= 255
        if others is not None and others.any() and not others.all():
            square[others] = square[~others].mean(axis=0)
        points, presence, mask = self._outputs(square)
        points, back = points.reshape(-1, 5), crop.from_network
        places_px = points[:, :2] @ back[:, :2].T + back[:, 2]
        logits = np.rint(_STEPS * mask).clip(-_MOST, _MOST).astype(np.int8)
        return PersonSeen(
            crop,
            float(presence.ravel()[0]),
            logits.reshape(_SIDE_PX, _SIDE_PX),
            places_px[:POINTS],
            1 / (1 + np.exp(-points[:POINTS, 3].clip(-30, 30).astype(float))),
            places_px[POINTS : POINTS + 2],
        )


def _litert(path: Path) -> Outputs | None:
    """The network run by LiteRT, where that is installed: nearly three times as fast."""
    try:
        from ai_edge_litert.interpreter import Interpreter
    except ImportError:
        return None
    with _silent_errors():  # it tells of XNNPACK
        interpreter = Interpreter(str(path), num_threads=1)
        interpreter.allocate_tensors()
    (taken,) = interpreter.get_input_details()
    index = {head["name"]: head["index"] for head in interpreter.get_output_details()}

    def outputs(square: Float32Array) -> list[Float32Array]:
        interpreter.set_tensor(taken["index"], square[None])
        interpreter.invoke()
        return [interpreter.get_tensor(index[head]) for head in _HEADS]

    return outputs


def _opencv(path: Path) -> Outputs:
    """The network run by OpenCV."""
    # OpenCV 5's new engine gives outputs of wrong shapes.
    engine = getattr(cv2.dnn, "ENGINE_CLASSIC", None)
    network = cv2.dnn.readNetFromTFLite(str(path), *(() if engine is None else (engine,)))

    def outputs(square: Float32Array) -> list[Float32Array]:
        network.setInput(np.ascontiguousarray(square.transpose(2, 0, 1)[None]))
        return [np.asarray(head, np.float32) for head in network.forward(_HEADS)]

    return outputs


@contextmanager
def _silent_errors() -> Iterator[None]:
    """Nothing that native code writes to standard error meanwhile is seen."""
    saved, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null, 2)
        yield
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(null)


def cropped(picture: Frame, crop: Crop) -> ByteArray:
    """A square of a picture in the network's size, black where the picture ends."""
    finer = max(round(crop.side_px / _SIDE_PX), 1)  # pixels of the picture are averaged
    matrix, size = crop.from_network, (finer * _SIDE_PX,) * 2
    matrix[:, 2] -= matrix[:, :2].sum(axis=1) * 0.5 * (1 - 1 / finer)
    matrix[:, :2] /= finer
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    square = cv2.warpAffine(picture, matrix, size, flags=flags)
    return cv2.resize(square, (_SIDE_PX,) * 2, interpolation=cv2.INTER_AREA)  # type: ignore[return-value]
