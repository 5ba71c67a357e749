"""Pictures of the page: moments, the empty view, silhouettes and painted places as overlays, and
stages of a silhouette, also in words for one pixel.
"""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from functools import lru_cache
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.estimator import BackgroundKind, Frame
from silhouette_core.image.foreground import SilhouetteStages
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.tuning import COLOURS
from voxelpose.multiview.silhouettes.prepared_silhouettes import LONG_SIDE_PX
from voxelpose.recording.folder import Recording
from voxelpose.setup_page.drawn_places import DrawnRecording
from voxelpose.view.images.canvas import encoded, hatched, png

SettingValues = Mapping[str, tuple[Any, str]]
"""Settings of `fit` by name: value, and the file that it is from."""
_KEPT = 4  # moments
SILHOUETTE = (64, 200, 255)  # RGB
_FIRST = (255, 210, 63)
_BACKGROUND = (176, 84, 40)


class MomentFrames:
    """Frames of moments of a recording, the last few of which are kept."""

    def __init__(self, recording: Recording) -> None:
        """Reads nothing yet."""
        self._recording, self._lock = recording, threading.Lock()
        self._read = lru_cache(_KEPT)(lambda moment: next(iter(recording.at([moment]))))
        self._empty: dict[str, Frame] | None = None

    def frames(self, moment: int) -> Mapping[str, Frame]:
        """Frames (H, W, 3) uint8, BGR, of a time step, from 0, by camera name.

        Raises:
            InputError: there is no such moment, or it cannot be read.
        """
        count = self._recording.frame_count
        if not 0 <= moment < count:
            raise InputError(f"there is no moment {moment}: choose one from 0 to {count - 1}")
        with self._lock:
            return self._read(moment)

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


class BackgroundModels:
    """Background models of a recording, each learned in a thread of its own when asked for."""

    def __init__(self, recording: Recording, settings: Callable[[], SettingValues]) -> None:
        """Learns nothing yet; reads the settings of `fit` when it does."""
        self._recording, self._settings, self._lock = recording, settings, threading.Lock()
        self._models: dict[BackgroundKind, Future[Silhouettes]] = {}

    def get(self, kind: BackgroundKind) -> Silhouettes | None:
        """Silhouettes of a kind of background; None while it is learned.

        Raises:
            InputError: the backgrounds cannot be read.
        """
        with self._lock:
            if kind not in self._models:
                self._models[kind] = Future()
                threading.Thread(target=self._learn, args=(kind,), daemon=True).start()
            model = self._models[kind]
        return model.result() if model.done() else None

    def _learn(self, kind: BackgroundKind) -> None:
        try:
            segmenter, _ = self._settings().get("segmenter", (None, ""))
            source = DrawnRecording(**vars(self._recording))
            model = Silhouettes(source, kind, LONG_SIDE_PX, segmenter=segmenter)
        except BaseException as error:  # for who asks
            self._models[kind].set_exception(error)
        else:
            self._models[kind].set_result(model)


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


StageName = Literal["background", "difference", "odds", "first"]


def draw_stage(stages: SilhouetteStages, stage: StageName) -> bytes:
    """A stage as a picture; the first silhouette as PNG to be laid over the frame.

    Raises:
        InputError: the method does not compute it.
    """
    if stage == "first":
        return overlay_png(stages.first, _FIRST, 120)
    if stage == "background":
        image = np.rint(stages.background.clip(0, 255)).astype(np.uint8)
        return encoded(image if stages.known.all() else hatched(image, ~stages.known), ".png")
    if stages.difference is None or stages.odds is None:
        raise InputError(f"the method paper has no {stage}: choose auto")
    if stage == "difference":
        # Twice the limit is white: at the limit the colours change from violet to orange.
        grey = np.rint(127.5 * stages.difference.clip(0, 2)).astype(np.uint8)
        return encoded(np.asarray(cv2.applyColorMap(grey, cv2.COLORMAP_INFERNO), np.uint8), ".png")
    # Odds: the person's colour for it, that of earth against it, black for neither.
    strength = (stages.odds / COLOURS.most_odds).clip(-1, 1)[..., None]
    colours = np.where(strength > 0, SILHOUETTE[::-1], _BACKGROUND[::-1])
    return encoded(np.rint(np.abs(strength) * colours).astype(np.uint8), ".png")


def explain_pixel(stages: SilhouetteStages, row: int, column: int) -> dict[str, Any]:
    """What a pixel of the stages is taken for, and why: colours (RGB), measures and a word."""
    at = row, column
    measures, background = [], np.rint(stages.background[at][::-1].clip(0, 255)).astype(int)
    if stages.difference is not None:
        measures.append(f"difference {stages.difference[at]:.1f}×")
    if stages.brightness is not None and background.any():
        measures.append(f"brightness {100 * stages.brightness[at]:.0f} %")
    if stages.odds is not None:
        measures.append(f"odds {stages.odds[at]:+.1f} nats".replace("-", "−"))
    return {
        "here": stages.frame[at][::-1].tolist(),
        "background": background.tolist(),
        "known": bool(stages.known[at]),
        "measures": measures,
        "person": bool(stages.silhouette[at]),
        "why": _why(stages, at),
    }


def _why(stages: SilhouetteStages, at: tuple[int, int]) -> str:
    """Why a pixel is the person or is not, in a few words."""
    first, person = bool(stages.first[at]), bool(stages.silhouette[at])
    if first != person:
        return (
            "filled in: edge, colours or a hole" if person else "taken out: edge, region or a speck"
        )
    if stages.odds is None:
        return "differs from the empty view" if person else "like the empty view"
    if (stages.odds[at] > 0) != person:
        return "its neighbours decide"
    shadow = stages.shadow is not None and stages.shadow[at]
    return "only a shadow" if shadow and not person else "its colours say so"
