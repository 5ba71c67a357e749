"""Person in a foreground image, and the distance at which a person of that size stands."""

from dataclasses import dataclass

import cv2
import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray, FloatArray
from calib.components import label_components
from silhouette_core.image.head_colours import ColourCrop
from silhouette_core.image.seen_joints import SeenJoints
from silhouette_core.monocular.tuning import PERSON

_BORDER_PX = 2
LEAST_PX = 150  #: Of a person's smallest silhouette.


@dataclass(frozen=True, eq=False)
class Person:
    """Silhouette of one person."""

    mask: BoolArray  #: (h, w) bool, the silhouette.
    cut: bool  #: whether the border of the image cuts the person.
    colours: ColourCrop | None = None
    """Of the picture about the person; None: they are not known, or not to be used."""
    joints: SeenJoints | None = None  #: as a pose network sees them; None: it does not.


def find_person(
    mask: BoolArray, near_px: FloatArray | None = None, usual_px: float | None = None
) -> Person | None:
    """Largest connected component of a foreground image, with those near it.

    What is wider than a person mostly is counts for less; and what is larger than the person and
    wider than high, or farther away than it is large, is no piece of it.

    Args:
        mask: (h, w) bool, all foreground.
        near_px: (2,), last position of the person, px; nearer components are preferred.

    Returns:
        The person, or None if there is none.
    """
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return None
    first = np.array([columns[0], rows[0]])
    part = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    components = label_components(part)
    area = components.sizes[1:].astype(float)
    (y, x), (bottom, right) = components.bounds.transpose(1, 2, 0).astype(float)
    w, h = right - x, bottom - y
    weight = area * slenderness(w, h)
    if near_px is not None:
        # The root of the area is half a person's height: more than anybody moves within a frame.
        distance = np.linalg.norm(components.centroids[:, ::-1] + first - near_px, axis=1)
        weight /= 1 + (distance / np.sqrt(usual_px or area.max())) ** 2
    main = int(weight.argmax())
    if area[main] < max(LEAST_PX, PERSON.least_of_usual * (usual_px or 0.0)):
        return None
    piece = (area >= PERSON.least_piece * area[main]) & ((area <= area[main]) | (h >= w))
    # A small thing far away is none of the person's: a reflection, a screen, a curtain.
    largest_gap = np.minimum(PERSON.largest_gap * max(w[main], h[main]), np.sqrt(area))
    of_person = np.arange(len(components.sizes)) == main + 1
    grown = np.count_nonzero(piece) > 1
    while grown:  # pieces may hang on pieces
        apart = (~of_person.take(components.labels)).view(np.uint8)
        distance_px = cv2.distanceTransform(apart, cv2.DIST_L2, cv2.DIST_MASK_3)
        grown = False
        for k in np.flatnonzero(piece & ~of_person[1:]):
            box = tuple(slice(*ends) for ends in components.bounds[k].T)
            pixels = components.labels[box] == k + 1
            if distance_px[box][pixels].min() <= largest_gap[k] + 1:
                of_person[k + 1] = grown = True
    person = np.zeros_like(mask)
    person[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] = of_person.take(components.labels)
    return Person(person, _is_cut(person))


def slenderness(width: FloatArray, height: FloatArray) -> FloatArray:
    """Height over width of boxes, relative to that of most silhouettes; 1 at most."""
    return np.minimum(height / (PERSON.slender * width), 1)


def _is_cut(mask: BoolArray) -> bool:
    edge = _BORDER_PX
    touching = max(
        np.count_nonzero(mask[:edge].any(0)),
        np.count_nonzero(mask[-edge:].any(0)),
        np.count_nonzero(mask[:, :edge].any(1)),
        np.count_nonzero(mask[:, -edge:].any(1)),
    )
    return touching > max(PERSON.border * np.sqrt(np.count_nonzero(mask)) * 4, 3)


def area_distance(camera: Camera, mask: BoolArray, area_m2: float) -> float:
    """Distance of a body whose silhouette has the observed area.

    Args:
        camera: pinhole camera without distortion.
        mask: (h, w) bool, the silhouette, not empty.
        area_m2: area of the silhouette that the body usually has.

    Returns:
        Distance along the optical axis, m.
    """
    focal2 = camera.matrix[0, 0] * camera.matrix[1, 1]
    return float(np.sqrt(area_m2 * focal2 / np.count_nonzero(mask)))


def upright_distance(camera: Camera, mask: BoolArray, stature_m: float) -> float:
    """Distance of an upright person whose silhouette has the observed height.

    Args:
        camera: pinhole camera without distortion.
        mask: (h, w) bool, the silhouette, not empty.

    Returns:
        Distance along the viewing ray of the silhouette's middle, m.
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
    ):  # seen from above: the longer side of the silhouette instead of the height
        side = max(np.ptp(rows), np.ptp(columns)) + 1
        return float(stature_m * camera.matrix[0, 0] / side)
    slope = directions[:, 2] / level
    height = max(slope[0] - slope[1], 1e-3)
    return float(stature_m / height / level[2])
