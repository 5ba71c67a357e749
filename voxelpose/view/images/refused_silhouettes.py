"""A picture of silhouettes that are refused, beside the result that is not there."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.atomic import write_whole
from calib.errors import InputError
from calib.moments import even_moments
from silhouette_core.estimator import Frame
from silhouette_core.image.plausibility import ImplausibleSilhouettesError, telling_frames
from silhouette_core.image.silhouettes import UndistortedView
from voxelpose.recording.folder import Recording
from voxelpose.view.images.canvas import FAINT, INK, MIDDLE, PAPER, Image, png, write_text

_GAP, _MARGIN, _HEAD, _NAME = 6, 28, 64, 58
_WIDEST, _HIGHEST = 1900, 420  # px, of the sheet, and of a camera's row
_SHOWN = 3  # moments, each with the frame after it


@contextmanager
def refusal_drawn(recording: Recording, out: Path | str) -> Iterator[None]:
    """For a `with` block that estimates a recording: silhouettes that are refused are drawn into
    `OUT.silhouettes.png`, and where they are not, an earlier such picture is removed.

    Args:
        out: the result folder, whose parent exists.

    Raises:
        InputError: they are refused; it names the picture.
    """
    target = Path(out).resolve()
    path = target.with_name(f"{target.name}.silhouettes.png")
    try:
        yield
    except ImplausibleSilhouettesError as error:
        sheet = draw_refused(recording, error)
        try:
            write_whole(path, png(sheet))
        except InputError:  # nothing can be written there: that they are refused says more
            raise error from None
        raise error.shown_in(path) from error
    path.unlink(missing_ok=True)


def draw_refused(recording: Recording, error: ImplausibleSilhouettesError) -> Image:
    """A sheet (h, w, 3) uint8 BGR: cameras from top to bottom, three moments from left to right,
    each with the frame after it, and the silhouettes over their pictures.
    """
    steps = telling_frames(recording.frame_count)
    pairs = even_moments(len(steps) // 2, _SHOWN).tolist()
    shown = {steps[k]: k for pair in pairs for k in (2 * pair, 2 * pair + 1)}  # each frame once
    frames = dict(zip(shown, recording.at(list(shown)), strict=True))
    room = (_WIDEST - 2 * _MARGIN + _GAP) // (2 * _SHOWN) - _GAP
    rows = []
    for name, masks in error.masks.items():
        height, width = masks[0].shape
        scale = min(room / width, _HIGHEST / height)
        size = round(width * scale), round(height * scale)
        lens = error.lenses.get(name)
        tiles = [_tile(frames[step][name], masks[k], lens, size) for step, k in shown.items()]
        rows.append((f"{name}: {error.faults[name]}", size, tiles))
    sheet = np.full(
        (_HEAD + sum(_NAME + size[1] for _, size, _ in rows) + _MARGIN, _WIDEST, 3), PAPER, np.uint8
    )
    title = f"{recording.folder.resolve().name} · silhouettes that cannot be those of a person"
    write_text(sheet, title, _MARGIN, 44, 24, INK, bold=True)
    top = _HEAD
    for words, (width, height), tiles in rows:
        write_text(sheet, words, _MARGIN, top + 26, 17, INK, bold=True)
        left, top = _MARGIN, top + _NAME
        for step, tile in zip(shown, tiles, strict=True):
            write_text(sheet, f"frame {recording.numbers[step]}", left, top - 8, 14, FAINT)
            sheet[top : top + height, left : left + width] = tile
            left += width + _GAP
        top += height
    return sheet


def _tile(
    frame: Frame, mask: NDArray[np.bool_], lens: UndistortedView | None, size: tuple[int, int]
) -> Image:
    """A frame in a size (width, height), grey outside of its silhouette, which is outlined."""
    if lens is not None:
        frame = lens.undistort_part(frame, (0, 0), lens.pinhole.size)
    image = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    share = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)[..., None]
    grey = image.mean(axis=2, keepdims=True)  # rooms have all colours
    inner, outer = 0.6 * image + 0.4 * np.array(MIDDLE), 0.5 * grey
    image = np.asarray(share * inner + (1 - share) * outer, np.uint8)
    inside = (share[..., 0] > 0.5).astype(np.uint8)
    outlines, _ = cv2.findContours(inside, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(image, outlines, -1, MIDDLE, 1, cv2.LINE_AA), np.uint8)
