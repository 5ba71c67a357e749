"""Where a picture shows a person, by a segmentation network that the user brings.

A network is a file, ONNX or TFLite, that OpenCV runs. A segmenter may also be a class without
constructor arguments, registered under the entry point group `silhouette_core.segmenters`.
"""

from __future__ import annotations

import math
import re
from pathlib import Path
from threading import Lock
from typing import Annotated, Protocol, runtime_checkable

import cv2
import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from calib.checks import check_array
from calib.documents import load_text, parse_toml
from calib.errors import InputError
from silhouette_core.entry_points import load_registered
from silhouette_core.tuning import CUT

GROUP = "silhouette_core.segmenters"
_READERS = {".onnx": "readNetFromONNX", ".tflite": "readNetFromTFLite"}
_PERSON = {1: 0, 2: 1, 21: 15}  # channel of the person, by the number of channels
_SIDE_PX = 256  # of the network's pictures, where nothing else is stated
_LARGEST_BYTES = 100_000

_Side = Annotated[int, Meta(ge=16, le=4096)]
_Deviation = Annotated[float, Meta(gt=0)]


@runtime_checkable
class Segmenter(Protocol):
    """Tells where pictures show a person; called from several threads."""

    def probabilities(self, frame: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Probability of a person (H, W) float32 in each pixel of a frame (H, W, 3) uint8, BGR."""
        ...


class _Stated(msgspec.Struct, forbid_unknown_fields=True):
    """What the file beside a network states: size (width, height) in px of the pictures that it
    takes; mean and standard deviation that their colours (RGB, 0 to 1) are normalised by; the
    person's channel.
    """

    size: tuple[_Side, _Side] | None = None
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[_Deviation, _Deviation, _Deviation] = (1.0, 1.0, 1.0)
    person: Annotated[int, Meta(ge=0)] | None = None


class NetworkSegmenter:
    """A segmentation network, run by `cv2.dnn`."""

    def __init__(self, path: Path) -> None:
        """Reads a network, and tries it.

        Args:
            path: FILE.onnx or FILE.tflite; FILE.toml beside it may state what `_Stated` has.

        Raises:
            InputError: a file cannot be read or used, or the output is not understood.
        """
        self._path, self._lock = path, Lock()
        self._net = _read(path)
        self._output = self._net.getUnconnectedOutLayersNames()[0]
        beside = path.with_suffix(".toml")
        self._stated = _read_stated(beside)
        self._channels_last, size = _stated_input(self._net)
        self._size = self._stated.size or size
        self._mean, self._std = np.array([self._stated.mean, self._stated.std], np.float32)
        try:
            self.probabilities(np.full((*self._size[::-1], 3), 127, np.uint8))
        except cv2.error as error:
            raise InputError(
                f"{path} does not run on pictures of {self._size[0]} x {self._size[1]} px: state"
                f" size = [width, height] in {beside.name}, or give another network"
                f" ({_words(error)})"
            ) from None

    def probabilities(self, frame: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See `Segmenter.probabilities`."""
        picture = cv2.resize(frame, self._size, interpolation=cv2.INTER_AREA)[..., ::-1]
        normalised = (picture / np.float32(255) - self._mean) / self._std
        blob = normalised[None] if self._channels_last else normalised.transpose(2, 0, 1)[None]
        with self._lock:
            self._net.setInput(np.ascontiguousarray(blob, np.float32))
            output = np.array(self._net.forward(self._output))
        found = self._person_of(output)
        size = frame.shape[1::-1]
        return np.asarray(cv2.resize(found, size, interpolation=cv2.INTER_LINEAR), np.float32)

    def _person_of(self, output: NDArray) -> NDArray[np.float32]:
        """The person's probability (h, w) in an output of the network."""
        layers = output[0] if output.ndim == 4 else output
        if layers.ndim == 3 and layers.shape[0] not in _PERSON and layers.shape[2] in _PERSON:
            layers = np.moveaxis(layers, 2, 0)
        person = _PERSON.get(len(layers)) if self._stated.person is None else self._stated.person
        if (
            layers.ndim != 3
            or (output.ndim == 4 and len(output) > 1)
            or output.dtype.kind != "f"
            or person is None
            or person >= len(layers)
        ):
            raise InputError(
                f"{self._path} gives {output.dtype} {output.shape}: understood are float (1, 1, h,"
                " w) or (1, h, w, 1), a person's probabilities or logits, 2 channels (background,"
                " person), and the 21 of Pascal VOC; of others state person = CHANNEL in"
                f" {self._path.with_suffix('.toml').name}"
            )
        if layers.min() < -1e-3 or layers.max() > 1 + 1e-3:  # logits
            if len(layers) == 1:
                layers = np.concatenate([np.zeros_like(layers), layers])
                person = 1
            layers = np.exp(layers - layers.max(axis=0))
        total = layers.sum(axis=0) if len(layers) > 1 else 1
        return np.ascontiguousarray(layers[person] / total, np.float32).clip(0, 1)


def load_segmenter(name: str) -> Segmenter:
    """A network of a file, or a registered segmenter.

    Args:
        name: path of a file .onnx or .tflite, or a name as registered.

    Raises:
        InputError: the file cannot be used, or none is registered under this name.
        TypeError: what is registered is no segmenter.
    """
    if Path(name).suffix.lower() in _READERS:
        return NetworkSegmenter(Path(name))
    try:
        return load_registered(GROUP, "segmenter", Segmenter, name)
    except InputError as error:
        raise InputError(f"{error}; or give a network's file, .onnx or .tflite") from None


def resolved_segmenter(name: str) -> str:
    """The same text with a path made absolute, as settings keep it."""
    return str(Path(name).resolve()) if Path(name).suffix.lower() in _READERS else name


def person_odds(
    segmenter: Segmenter, frame: NDArray[np.uint8], size: tuple[int, int]
) -> NDArray[np.float32]:
    """Log odds of a person (h, w), nats, clipped: evidence, not the last word.

    They are 0 in a frame where the segmenter is hardly sure of anybody, who is then overlooked.

    Args:
        segmenter: tells where people are.
        frame: (H, W, 3) uint8, BGR.
        size: width and height of the odds.
    """
    found = segmenter.probabilities(frame)
    check_array("probabilities", found, frame.shape[:2], np.float32)
    found = cv2.resize(np.nan_to_num(found, nan=0.5), size, interpolation=cv2.INTER_AREA)
    least = 1 / (1 + math.exp(CUT.beside))
    found = np.asarray(found).clip(least, 1 - least)
    if (found >= 1 - least).mean() < CUT.segmented:
        return np.zeros_like(found)
    return np.log(found) - np.log1p(-found)


def _read(path: Path) -> cv2.dnn.Net:
    try:
        data = np.frombuffer(path.read_bytes(), np.uint8)
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    try:
        return getattr(cv2.dnn, _READERS[path.suffix.lower()])(data)
    except cv2.error as error:
        raise InputError(
            f"{path} is no network that OpenCV {cv2.__version__} can read: give another"
            f" ({_words(error)})"
        ) from None


def _read_stated(path: Path) -> _Stated:
    try:
        content = parse_toml(load_text(path, _LARGEST_BYTES), path) if path.exists() else {}
        return msgspec.convert(content, _Stated)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {error}; correct it") from None


def _stated_input(net: cv2.dnn.Net) -> tuple[bool, tuple[int, int]]:
    """Whether a network takes channels last, and pictures of which size (width, height), px; the
    usual, where it does not say so, or OpenCV is older than 5.
    """
    try:
        found = re.search(r"<Input> \w+ \[([^\]]*)\]", net.dump())
    except cv2.error:
        found = None
    sides = found[1].split(" x ") if found else []
    if len(sides) != 4:
        return False, (_SIDE_PX, _SIDE_PX)
    channels_last = sides[3] == "3" != sides[1]
    height, width = sides[1:3] if channels_last else sides[2:]
    return channels_last, (_side(width), _side(height))


def _side(text: str) -> int:
    return int(text) if text.isdigit() else _SIDE_PX


def _words(error: cv2.error) -> str:
    """The last words of an error of OpenCV, on one line."""
    return " ".join(str(error.err or error).split())[:200]
