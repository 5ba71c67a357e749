"""Colours, text and antialiased lines for all pictures."""

from collections.abc import Iterable

import cv2
import numpy as np
from numpy.typing import NDArray

from voxelpose.people_marks import COLOURS, rgb

Image = NDArray[np.uint8]
Colour = tuple[int, int, int]


def bgr(code: str) -> Colour:
    """Blue, green and red of a colour as pages write it, such as #ffc842."""
    red, green, blue = rgb(code)
    return blue, green, red


# Left and right stay apart for every kind of colour vision: blue against orange, whose bones are
# dashed.
LEFT, RIGHT, MIDDLE = bgr("#3a9eff"), bgr("#ff8226"), bgr("#6ed6c4")
PEOPLE: tuple[Colour, ...] = tuple((blue, green, red) for red, green, blue in COLOURS)
"""Of several people, one after the other."""
PAPER, INK, FAINT = bgr("#16191e"), bgr("#e8ecf0"), bgr("#949ba5")
WARNING = bgr("#f55050")

_SHIFT = 4  # OpenCV draws with 1/16 pixel


def colour_of(part: str) -> Colour:
    """Colour of a body part's side."""
    return LEFT if part.startswith("left_") else RIGHT if part.startswith("right_") else MIDDLE


def has_sides(parts: Iterable[str]) -> bool:
    """Whether a body has parts on its left or right side, by their names."""
    return any(colour_of(part) != MIDDLE for part in parts)


def write_text(
    image: Image,
    text: str,
    x: int,
    y: int,
    size: int = 16,
    colour: Colour = INK,
    bold: bool = False,
) -> None:
    """Writes one line into an image (h, w, 3) uint8 BGR, in place, `size` px high, from the left
    end (x, y) px of its base line on.
    """
    if hasattr(cv2, "FontFace"):
        cv2.putText(image, text, (x, y), colour, cv2.FontFace("sans"), size, 600 if bold else 400)
    else:  # OpenCV 4 has only its own stroke font, without letters beyond ASCII
        plain = text.replace("·", "-").replace("–", "-").encode("ascii", "replace").decode()
        font, thickness = cv2.FONT_HERSHEY_SIMPLEX, 2 if bold else 1
        cv2.putText(image, plain, (x, y), font, size / 32, colour, thickness, cv2.LINE_AA)


def text_width(text: str, size: int, bold: bool = False) -> int:
    """Width of a line that `write_text` writes, in pixels."""
    if hasattr(cv2, "FontFace"):
        return cv2.getTextSize(
            (4096, 4096), text, (0, 0), cv2.FontFace("sans"), size, 600 if bold else 400
        )[2]
    return cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, size / 32, 1)[0][0]


def stroke(
    image: Image, points: NDArray[np.float64], colour: Colour, width: int = 1, closed: bool = False
) -> None:
    """Draws a line through (N, 2) pixels in place, without points that are not finite."""
    fixed = _fixed_point(points)
    if len(fixed) > 1:
        cv2.polylines(image, [fixed], closed, colour, width, cv2.LINE_AA, _SHIFT)


def segments(image: Image, ends: NDArray[np.float64], colour: Colour, width: int = 1) -> None:
    """Draws lines between pairs of pixels (S, 2, 2) in place, without those not finite."""
    lines = _fixed_point(ends.reshape(-1, 4)).reshape(-1, 2, 2)
    cv2.polylines(image, list(lines), False, colour, width, cv2.LINE_AA, _SHIFT)


def dashed(ends: NDArray[np.float64]) -> NDArray[np.float64]:
    """Three dashes (3 S, 2, 2) of each line between pairs of pixels (S, 2, 2)."""
    start, stop = ends[:, :1], ends[:, 1:]
    return (start + np.linspace(0, 1, 6)[:, None] * (stop - start)).reshape(-1, 2, 2)


def dots(image: Image, points: NDArray[np.float64], radius: float, colour: Colour) -> None:
    """Draws filled circles around pixels (N, 2) in place, without those not finite."""
    size = int(radius * 2**_SHIFT)
    for x, y in _fixed_point(points)[:, 0].tolist():
        cv2.circle(image, (x, y), size, colour, cv2.FILLED, cv2.LINE_AA, _SHIFT)


def tint(
    image: Image, outlines: list[NDArray[np.float64]], colour: Colour, strength: float
) -> Image:
    """Mixes the inside of closed outlines (N, 2), px, with holes by the even-odd rule, with a
    fraction `strength` of a colour, in place; returns the image (h, w, 3) uint8 BGR.
    """
    fixed = [_fixed_point(outline) for outline in outlines]
    fixed = [outline for outline in fixed if len(outline) > 2]
    if not fixed:
        return image
    corners = np.concatenate(fixed)[:, 0] >> _SHIFT
    left, top = np.maximum(corners.min(0) - 1, 0)
    right, bottom = corners.max(0) + 2
    inside = image[top:bottom, left:right]
    if inside.size == 0:
        return image
    layer = inside.copy()
    corner = np.array([left, top], np.int32) << _SHIFT
    cv2.fillPoly(layer, [outline - corner for outline in fixed], colour, cv2.LINE_AA, _SHIFT)
    image[top:bottom, left:right] = cv2.addWeighted(layer, strength, inside, 1 - strength, 0)
    return image


def hatched(image: Image, unknown: NDArray[np.bool_]) -> Image:
    """Image (h, w, 3) uint8 with stripes where nothing is known, (H, W) bool of that view."""
    height, width = image.shape[:2]
    size = width, height
    inside = cv2.resize(unknown.view(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    period = max(12, height // 40)
    stripes = (np.arange(width) + np.arange(height)[:, None]) % period < period // 3
    result = np.where(inside[..., None], image // 2 + np.uint8(48), image)
    return np.where((inside & stripes)[..., None], np.array(FAINT, np.uint8), result)


def reduced(image: NDArray[np.uint8], scale: float) -> Image:
    """Copy of an image (h, w, 3), scaled where `scale` is below 1."""
    scale = min(1.0, scale)
    size = round(image.shape[1] * scale), round(image.shape[0] * scale)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def png(image: Image) -> bytes:
    """PNG encoding of an image; see `encoded`."""
    return encoded(image, ".png")


def encoded(image: Image, suffix: str, quality: int = 85) -> bytes:
    """An image (h, w), (h, w, 3) or (h, w, 4) uint8, BGR, as the content of a file: .png, .jpg or
    .webp, these with a quality of 1 to 100. OSError where it cannot be encoded: sides of a JPEG
    have at most 65 500 px.
    """
    flags = {".jpg": cv2.IMWRITE_JPEG_QUALITY, ".webp": cv2.IMWRITE_WEBP_QUALITY}
    good, data = cv2.imencode(suffix, image, [flags[suffix], quality] if suffix in flags else [])
    if not good:
        raise OSError(f"an image {image.shape} cannot be encoded as {suffix}")
    return data.tobytes()


def _fixed_point(points: NDArray[np.float64]) -> NDArray[np.int32]:
    """Finite rows of points (N, D) in OpenCV's fixed point, (M, 1, D) int32."""
    good = points[(np.abs(points) < 1e5).all(axis=1)]
    return np.round(good * 2**_SHIFT).astype(np.int32)[:, None]
