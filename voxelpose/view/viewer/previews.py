"""Pictures of pages: moments, the empty view, masks as overlays, and stages of a silhouette, which
are told in words for one pixel, too.
"""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import lru_cache
from typing import Any, Literal, cast

import cv2
import msgspec
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.estimator import Frame
from silhouette_core.image.foreground import SilhouetteStages
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.tuning import COLOURS
from voxelpose.recording.folder import Recording
from voxelpose.view.images.canvas import encoded, hatched, png
from voxelpose.view.serving.page_answers import Corner, Moment, Name, check_camera_names

_KEPT = 4  # moments
SILHOUETTE = (64, 200, 255)  # RGB
_FIRST = (255, 210, 63)
_BACKGROUND = (176, 84, 40)


class MomentFrames:
    """Frames of moments of a recording, the last few of which are kept."""

    def __init__(self, recording: Recording) -> None:
        self._recording, self._lock = recording, threading.Lock()
        self._read = lru_cache(_KEPT)(lambda moment: next(iter(recording.at([moment]))))
        self._empty: dict[str, Frame] | None = None

    def frames(self, moment: int) -> Mapping[str, Frame]:
        """Frames (H, W, 3) uint8, BGR, of a time step, from 0, by camera name. InputError where
        there is no such moment, or it cannot be read.
        """
        count = self._recording.frame_count
        if not 0 <= moment < count:
            raise InputError(f"there is no moment {moment}: choose one from 0 to {count - 1}")
        with self._lock:
            return self._read(moment)

    def empty(self) -> Mapping[str, Frame]:
        """The empty view (H, W, 3) uint8, BGR, by camera name, where there is one. InputError where
        a file cannot be read.
        """
        with self._lock:
            if self._empty is None:
                readers = self._recording.backgrounds()
                self._empty = {name: next(iter(reader)) for name, reader in readers.items()}
            return self._empty


class BackgroundModels:
    """Background models of a recording, each learned in a thread of its own when asked for."""

    def __init__(self, learn: Callable[[Any], Silhouettes]) -> None:
        self._learned, self._lock = learn, threading.Lock()
        self._models: dict[Any, Future[Silhouettes]] = {}

    def get(self, kind: object) -> Silhouettes | None:
        """Silhouettes of a kind; None while it is learned. InputError where the backgrounds cannot
        be read.
        """
        with self._lock:
            if kind not in self._models:
                self._models[kind] = Future()
                threading.Thread(target=self._learn, args=(kind,), daemon=True).start()
            model = self._models[kind]
        return model.result() if model.done() else None

    def _learn(self, kind: object) -> None:
        try:
            self._models[kind].set_result(self._learned(kind))
        except BaseException as error:  # for who asks
            self._models[kind].set_exception(error)


def overlay_png(mask: NDArray[np.bool_], colour: tuple[int, int, int], alpha: int) -> bytes:
    """A mask (H, W) bool as a picture to be laid over another: PNG, with red, green and blue of a
    colour and the opacity `alpha`, 0 to 255; its edge is opaque, and what is outside transparent.
    """
    image = np.zeros((*mask.shape, 4), np.uint8)
    image[mask] = (*colour[::-1], alpha)
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    thickness = max(1, round(max(mask.shape) / 640))
    cv2.drawContours(image, contours, -1, (*colour[::-1], 255), thickness)
    return png(image)


class StageAsked(Struct, forbid_unknown_fields=True):
    """A stage of a camera's silhouette, or what one of its pixels is taken for."""

    moment: Moment  # from 0
    camera: Name
    # What is to be drawn; None: nothing is.
    stage: Literal["background", "odds", "first", "silhouette", "body"] | None = None
    pixel: Corner | None = None  # px of the camera's picture; None: none is asked about


class StageExplorer:
    """Tells a page how the silhouettes of a recording came about, for one thread at a time."""

    def __init__(
        self,
        rig: Rig,
        frames: Callable[[int], Mapping[str, Frame]],
        model: Callable[[Any], Silhouettes | None],
    ) -> None:
        """Of the frames of moments, by camera name, and of silhouettes as they are asked for; None
        while their backgrounds are learned.
        """
        self._rig, self._frames, self._model = rig, frames, model
        self._key, self._stages = b"", cast(SilhouetteStages, None)  # what was asked last

    def answer(self, asked: StageAsked) -> dict[str, Any]:
        """A stage of a camera's silhouette: `ready` with a picture, and a pixel explained; or not
        yet. InputError where there is no such moment, camera or stage, or files cannot be read.
        """
        check_camera_names([asked.camera], self._rig.names)
        key = msgspec.json.encode(msgspec.structs.replace(asked, stage=None, pixel=None))
        if self._key != key:
            model = self._model(asked)
            if model is None:
                return {"ready": False}
            frame = self._frames(asked.moment)[asked.camera]
            self._key, self._stages = key, model.stages(asked.camera, frame, asked.moment)
        answer: dict[str, Any] = {"ready": True}
        if asked.stage is not None:
            answer["png"] = _draw_stage(self._stages, asked.stage)
        if asked.pixel is not None:
            pixel = pixel_at(asked.pixel, self._rig[asked.camera].size, self._stages.first.shape)
            answer["explained"] = _explain(self._stages, pixel)
        return answer


def pixel_at(pixel: Corner, size: tuple[int, int], shape: tuple[int, ...]) -> tuple[int, int]:
    """Row and column, in an image of a shape (h, w), of a pixel of a picture of a size (W, H)."""
    column, row = (
        min(max(int((position + 0.5) * short / long), 0), short - 1)
        for position, long, short in zip(pixel, size, shape[::-1], strict=True)
    )
    return row, column


def _draw_stage(stages: SilhouetteStages, stage: str) -> bytes:
    """A stage as a picture; silhouettes as PNG to be laid over the frame."""
    if stage == "first":
        return overlay_png(stages.first, _FIRST, 120)
    if stage == "silhouette":
        return overlay_png(stages.silhouette, SILHOUETTE, 120)
    if stage == "body":
        raise InputError("nothing is fitted yet: `voxelpose view` shows what a body changed")
    if stage == "background":
        image = np.rint(stages.background.clip(0, 255)).astype(np.uint8)
        return encoded(image if stages.known.all() else hatched(image, ~stages.known), ".png")
    if stages.odds is None:
        raise InputError(f"the method paper has no {stage}: choose auto")
    # Odds: the person's colour for it, that of earth against it, black for neither.
    strength = (stages.odds / COLOURS.most_odds).clip(-1, 1)[..., None]
    colours = np.where(strength > 0, SILHOUETTE[::-1], _BACKGROUND[::-1])
    return encoded(np.rint(np.abs(strength) * colours).astype(np.uint8), ".png")


def _explain(stages: SilhouetteStages, pixel: tuple[int, int]) -> dict[str, Any]:
    """What a pixel of the stages is taken for, and why: colours (RGB), measures and a word."""
    measures, background = [], np.rint(stages.background[pixel][::-1].clip(0, 255)).astype(int)
    if stages.brightness is not None and background.any():
        measures.append(f"brightness {100 * stages.brightness[pixel]:.0f} %")
    if stages.odds is not None:
        measures.append(f"odds {stages.odds[pixel]:+.1f} nats".replace("-", "−"))
    return {
        "here": stages.frame[pixel][::-1].tolist(),
        "background": background.tolist(),
        "known": bool(stages.known[pixel]),
        "measures": measures,
        "person": bool(stages.silhouette[pixel]),
        "why": _why(stages, pixel),
    }


def _why(stages: SilhouetteStages, pixel: tuple[int, int]) -> str:
    first, person = bool(stages.first[pixel]), bool(stages.silhouette[pixel])
    if first != person:
        return "filled in: edge or a hole" if person else "taken out: edge, region or a speck"
    if stages.odds is None:
        return "differs from the empty view" if person else "like the empty view"
    if (stages.odds[pixel] > 0) != person:
        return "its neighbours decide"
    shadow = stages.shadow is not None and stages.shadow[pixel]
    return "only a shadow" if shadow and not person else "its colours say so"
