"""Which part of a silhouette image is the person, and how far away a person that large stands."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera

_CRUMB = 0.02  # of the person's own area; a hand that a gap cuts off is larger
_REACH = 0.25  # of the person's height: pieces farther from the main one are something else
_LEAST_PX = 150
_SHARE_OF_USUAL = 0.2
_BORDER_PX = 2
# of the person's contour box along the border, below which a toe at the edge does not count as cut
_BORDER_SHARE = 0.02
# statures between the highest and the lowest contour pixel of somebody standing: the nearer foot
# shows larger
_UPRIGHT = 1.02


@dataclass(frozen=True, eq=False)
class Person:
    """The silhouette of one person.

    Attributes:
        mask: (h, w) bool.
        cut: whether the border of the picture cuts it.
    """

    mask: NDArray[np.bool_]
    cut: bool


def find_person(
    mask: NDArray[np.bool_],
    near_px: NDArray[np.float64] | None = None,
    usual_px: float | None = None,
) -> Person | None:
    """Takes the largest piece of a silhouette image, with the smaller ones beside it.

    Args:
        mask: (h, w) bool, all foreground.
        near_px: (2,) where the person was last: a nearer piece may then be smaller.
        usual_px: area in which the person was seen lately.

    Returns:
        The person, or None where there is none.
    """
    count, labels, stats, centers = map(
        np.asarray, cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    )
    if int(count) < 2:
        return None
    area = stats[1:, cv2.CC_STAT_AREA].astype(float)
    worth = area.copy()
    if near_px is not None:
        worth *= np.exp(
            -((np.linalg.norm(centers[1:] - near_px, axis=1) / (0.5 * mask.shape[0])) ** 2)
        )
    main = int(worth.argmax())
    if area[main] < max(_LEAST_PX, _SHARE_OF_USUAL * (usual_px or 0.0)):
        return None
    left, top, width, height = (float(stats[main + 1, k]) for k in range(4))
    reach = _REACH * max(width, height)
    x, y, w, h = (stats[1:, k].astype(float) for k in range(4))
    gap = np.maximum.reduce(
        [left - (x + w), x - (left + width), top - (y + h), y - (top + height), np.zeros(len(x))]
    )
    kept = np.concatenate([[False], (gap <= reach) & (area >= _CRUMB * area[main])])
    person = kept[labels]
    return Person(person, _is_cut(person))


def _is_cut(mask: NDArray[np.bool_]) -> bool:
    edge = _BORDER_PX
    touching = max(
        np.count_nonzero(mask[:edge].any(0)),
        np.count_nonzero(mask[-edge:].any(0)),
        np.count_nonzero(mask[:, :edge].any(1)),
        np.count_nonzero(mask[:, -edge:].any(1)),
    )
    return touching > max(_BORDER_SHARE * np.sqrt(np.count_nonzero(mask)) * 4, 3)


def upright_distance(camera: Camera, mask: NDArray[np.bool_], stature_m: float) -> float:
    """Returns how far away (m, along the viewing ray of its middle) somebody upright would be who
    fills the silhouette from top to bottom.

    Args:
        camera: without distortion.
        mask: (h, w) bool, not empty.
        stature_m: of the person.
    """
    rows, columns = np.nonzero(mask)
    top, bottom = rows.argmin(), rows.argmax()
    pixels = np.array(
        [[columns[top], rows[top]], [columns[bottom], rows[bottom]], [columns.mean(), rows.mean()]],
        float,
    )
    _, directions = camera.rays(pixels)
    level = np.linalg.norm(directions[:, :2], axis=1)
    if (
        level.min() < 0.2
    ):  # from above, height says nothing: take the longer side of the silhouette instead
        side = max(np.ptp(rows), np.ptp(columns)) + 1
        return float(stature_m * camera.matrix[0, 0] / side)
    slope = directions[:, 2] / level
    height = max(slope[0] - slope[1], 1e-3)
    return float(_UPRIGHT * stature_m / height / level[2])
