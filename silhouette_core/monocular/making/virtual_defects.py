"""Defects of virtual silhouettes, as background subtraction leaves them, and of seen joints.

Edges are a pixel too wide or too narrow; there are holes, up to whole limbs, where the person is
like the background, and foreground where the background has changed; clothes of the walls' colours
come apart; and shadows on the floor are taken for the person.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from calib.checks import ByteArray, Float32Array, FloatArray, IndexArray, RealArray
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.image.pose_network import FILE
from silhouette_core.image.seen_joints import deviations_m
from silhouette_core.monocular.proposal.silhouette_features import seen_codes
from silhouette_core.monocular.tuning import VIRTUAL_DEFECTS as DEFECTS

_LONGEST_BOUT = 30  # frames
_STATURE_MM = 1750  # of the people by whom the errors of seen joints are measured
_HOLES = 3  # at random places of the body, at most


def passing_defects(
    places_px: RealArray, rng: np.random.Generator, strange: bool = True
) -> tuple[NDArray[np.int8], Float32Array]:
    """Defects that last for some frames, at the same places of the body.

    Args:
        places_px: (T, V, 2), where the body's vertices are seen.
        strange: whether there is foreground beside the body, too.

    Returns:
        Edges (T,) and discs (T, D, 3), px, for `spoil_silhouettes`.
    """
    count, slots = len(places_px), _HOLES + len(DEFECTS.large_holes) + 1
    edges, discs = np.zeros(count, np.int8), np.zeros((count, slots, 3), np.float32)
    larger = list(zip(DEFECTS.large_holes, DEFECTS.large_holes_px, strict=True))
    frame = 0
    while frame < count:
        if rng.random() >= DEFECTS.bout:
            frame += 1
            continue
        bout = slice(frame, frame + int(rng.integers(1, _LONGEST_BOUT + 1)))
        edges[bout] = rng.integers(-1, 2)
        radii, offsets = np.zeros(slots), np.zeros((slots, 2))
        holes = int(rng.integers(_HOLES + 1))
        radii[:holes] = rng.uniform(*DEFECTS.hole_px, holes)
        for k, (chance, sizes) in enumerate(larger, _HOLES):
            if rng.random() < chance:
                radii[k] = rng.uniform(*sizes)
        if strange and rng.random() < DEFECTS.strange:
            radii[-1] = -rng.uniform(*DEFECTS.strange_px)
            offsets[-1] = rng.normal(0, DEFECTS.strange_away_px, 2)
        chosen = rng.integers(places_px.shape[1], size=slots)
        discs[bout, :, :2] = places_px[bout][:, chosen] + offsets
        discs[bout, :, 2] = radii
        frame = bout.stop
    return edges, discs


def spoil_silhouettes(masks: ByteArray, edges: NDArray[np.int8], discs: Float32Array) -> None:
    """Changes silhouettes masks (N, H, W), 0 or 1, in place.

    Where edges (N,) is 1, the silhouette grows by a pixel to the right and down, where it is -1 it
    shrinks from the left and from above; the image's first row and column stay. Discs (N, D, 3) of
    x, y and radius, px, are then erased in turn, or made foreground where the radius is negative.
    """
    y, x = np.ogrid[: masks.shape[1], : masks.shape[2]]
    for mask, edge, of_frame in zip(masks, edges, discs, strict=True):
        if edge:
            spreading = mask == (edge > 0)
            mask[1:, 1:][spreading[:-1, 1:] | spreading[1:, :-1]] = edge > 0
        for u, v, radius in of_frame[of_frame[:, 2] != 0]:
            rows, columns = (
                slice(max(int(centre - abs(radius)), 0), max(int(centre + abs(radius)) + 2, 0))
                for centre in (v, u)
            )
            near = (x[:, columns] - u) ** 2 + (y[rows] - v) ** 2 <= radius**2
            mask[rows, columns][near] = radius < 0


def wall_coloured_places(
    places_px: RealArray, colour: IndexArray, rng: np.random.Generator
) -> Float32Array:
    """Places of one colour that are missing in most frames of some takes.

    Args:
        places_px: (T, V, 2), where the body's vertices are seen.
        colour: (V,), number of each vertex's colour.

    Returns:
        Discs (T, D, 3), px, for `spoil_silhouettes`.
    """
    alike = np.flatnonzero(colour == rng.choice(np.unique(colour)))
    number = int(rng.integers(*DEFECTS.place_count)) * (rng.random() < DEFECTS.alike)
    seen = rng.random((len(places_px), number)) < rng.uniform(*DEFECTS.often)
    radii = seen * rng.uniform(*DEFECTS.place_px, number)
    centres = places_px[:, rng.choice(alike, number)]
    return np.concatenate([centres, radii[..., None]], axis=2).astype(np.float32)


def cast_shadow(surface: Float32Array, rng: np.random.Generator) -> Float32Array | None:
    """Surface (T, V, 3) of a shadow on the floor at 0, of the lower part of a body or of all of it.

    Args:
        surface: (T, V, 3) of the body, statures.

    Returns:
        The surface; None in most takes.
    """
    if rng.random() >= DEFECTS.shadowed:
        return None
    azimuth, length = (
        rng.uniform(0, 2 * np.pi),
        1 / np.tan(rng.uniform(*np.radians(DEFECTS.light_deg))),
    )
    along = np.array([np.cos(azimuth), np.sin(azimuth)], np.float32) * np.float32(length)
    height = np.clip(surface[..., 2:], 0, rng.uniform(*DEFECTS.shadow_of))
    shadow = np.zeros(surface.shape, np.float32)
    shadow[..., :2] = surface[..., :2] + along * height
    return shadow


def virtual_seen_joints(joints_px: RealArray, rng: np.random.Generator) -> Float32Array:
    """Codes (T, 45) float32, see `seen_codes`, of joints at places (T, 15, 2) in the window as a
    pose network sees them: off by what it errs, unsure where they are hidden, at times not at all.

    How far they are off is measured (`image.seen_joints`): a share of it stays for a whole take,
    since people and clothes do, another wanders, and the rest is new in every frame.
    """
    count, joints = joints_px.shape[:2]
    *shares, steady, uneven, together_mm, hidden, spread, lost, often_lost = seen_errors()
    steadily, slow, new = np.sqrt(shares)

    def wandering(columns: int) -> FloatArray:
        """(T, columns) of deviation 1: each a share of the last frame's, and something new."""
        drawn = rng.normal(0, 1, (count, columns))
        drawn[1:] *= np.sqrt(1 - steady**2)
        return np.asarray(lfilter([1.0], [1.0, -steady], drawn, axis=0), np.float64)

    def errors(joints: int) -> FloatArray:
        """Errors (T, joints, 2) of deviation 1."""
        shape = count, joints, 2
        constant = steadily * rng.normal(0, 1, (joints, 2)) + new * rng.normal(0, 1, shape)
        return np.asarray(constant + slow * wandering(2 * joints).reshape(shape), np.float64)

    visibility = 1 / (1 + np.exp(hidden + spread * (wandering(joints) + rng.normal(0, 1, joints))))
    sigma_mm = 1000 * deviations_m(visibility)[..., None]
    sigma_mm = sigma_mm * np.exp(rng.normal(0, uneven, (joints, 1)))
    errors_mm = sigma_mm * errors(joints) + together_mm * errors(1)
    codes = seen_codes(joints_px + errors_mm / _STATURE_MM, visibility)
    if rng.random() < often_lost:
        codes[wandering(1)[:, 0] > lost] = 0
    return codes


def seen_errors() -> list[float]:
    """How joints that a pose network sees err, measured: shares of the variance that stay for a
    take, wander and are new; share of what wanders that remains in the next frame; deviation of the
    logarithm of a joint's deviation; that of all joints together, mm; mean and deviation of the log
    odds to be hidden; deviations above which nobody is seen, and the share of takes with that.
    """
    return fitted_weights(FILE)["virtual"].tolist()
