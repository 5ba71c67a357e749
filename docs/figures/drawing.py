"""Arrows, captions and files of the drawings."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from voxelpose.view.images.canvas import Colour, Image, stroke, text_width, write_text

IMAGES = Path(__file__).parents[1] / "images"
PAPER: Colour = (247, 244, 240)
INK: Colour = (52, 44, 40)
QUIET: Colour = (128, 118, 110)
POSITIVE: Colour = (30, 90, 214)


def blank(width: int, height: int) -> Image:
    """Empty sheet (height, width, 3) uint8, BGR."""
    return np.full((height, width, 3), PAPER, np.uint8)


def arrow(image: Image, points: NDArray[np.float64], colour: Colour, width: int = 3) -> None:
    """Draws a line through (N, 2) pixels in place, with a head at its end."""
    stroke(image, points, colour, width)
    along = points[-1] - points[-1 - max(1, len(points) // 8)]
    along = along / max(float(np.linalg.norm(along)), 1e-9)
    across = np.array([-along[1], along[0]])
    head = np.stack(
        [
            points[-1] + 5 * width * (a * along + b * across)
            for a, b in ((0.6, 0), (-1, 0.7), (-1, -0.7))
        ]
    )
    cv2.fillConvexPoly(image, np.rint(head * 16).astype(np.int32), colour, cv2.LINE_AA, 4)


def centred(
    image: Image,
    text: str,
    x: float,
    y: float,
    size: int = 16,
    colour: Colour = INK,
    bold: bool = False,
) -> None:
    """Writes a line whose middle is at x, in place."""
    write_text(
        image, text, round(x - text_width(text, size, bold) / 2), round(y), size, colour, bold
    )


def save(image: Image, name: str) -> None:
    """Writes a picture into docs/images.

    Raises:
        SystemExit: it cannot be written.
    """
    path = IMAGES / name
    options = [cv2.IMWRITE_PNG_COMPRESSION, 9, cv2.IMWRITE_JPEG_QUALITY, 82]
    if not cv2.imwrite(str(path), image, options[:2] if path.suffix == ".png" else options[2:]):
        raise SystemExit(f"{path} cannot be written")
