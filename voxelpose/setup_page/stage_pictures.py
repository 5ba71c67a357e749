"""Stages of a silhouette as pictures, and in words for one pixel."""

from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.image.foreground import SilhouetteStages
from silhouette_core.tuning import COLOURS
from voxelpose.setup_page.previews import overlay_png
from voxelpose.view.images.canvas import encoded, hatched

StageName = Literal["background", "difference", "odds", "first"]
SILHOUETTE = (64, 200, 255)  # RGB
_FIRST = (255, 210, 63)
_BACKGROUND = (176, 84, 40)


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
        raise InputError(f"the method paper has no {stage}: choose refined")
    if stage == "difference":
        # Twice the limit is white: at the limit the colours change from violet to orange.
        grey = np.rint(127.5 * stages.difference.clip(0, 2)).astype(np.uint8)
        return encoded(np.asarray(cv2.applyColorMap(grey, cv2.COLORMAP_INFERNO), np.uint8), ".png")
    # Odds: the person's colour for it, that of earth against it, black for neither.
    strength = (stages.odds / COLOURS.most_odds).clip(-1, 1)[..., None]
    colours = np.where(strength > 0, SILHOUETTE[::-1], _BACKGROUND[::-1])
    return encoded(np.rint(np.abs(strength) * colours).astype(np.uint8), ".png")


def explain_pixel(stages: SilhouetteStages, row: int, column: int) -> dict[str, Any]:
    """What a pixel is taken for, and why: colours (red, green, blue), measures and result in words.

    Args:
        row: of the stages' arrays.
        column: likewise.
    """
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
    return "only a shadow" if not person and _true(stages.shadow, at) else "its colours say so"


def _true(mask: NDArray[np.bool_] | None, at: tuple[int, int]) -> bool:
    return mask is not None and bool(mask[at])
