"""Defects of virtual silhouettes, as background subtraction leaves them.

Edges are a pixel too wide or too narrow; there are holes, up to whole limbs, where the person is
like the background, and foreground where the background has changed; clothes of the walls' colours
come apart; and shadows on the floor are taken for the person.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Bouts of frames: the chance of a beginning, and the longest one; they make 30 % of the frames.
_BOUT, _LONGEST_BOUT = 0.025, 30
# Holes at random places of the body, and larger ones, each with its chance in a bout; px.
_HOLES, _HOLE_PX = 3, (1.5, 4.0)
_LARGE_HOLES = ((0.5, (4.0, 9.0)), (0.25, (6.0, 14.0)))
_STRANGE, _STRANGE_PX, _STRANGE_AWAY_PX = 0.35, (3.0, 9.0), 6.0  # foreground beside the body
# Chance that one of the colours is like the background's in places, which are at the same places
# of the body in all frames, and how often they are seen; px.
_ALIKE, _PLACES, _PLACE_PX, _OFTEN = 0.15, (2, 9), (2.5, 8.0), (0.4, 1.0)
_SHADOWED = 0.15  # chance of a shadow on the floor
_ELEVATION, _SHADOW_OF = np.radians((35.0, 80.0)), (0.1, 1.1)  # of the light; statures of height


def passing_defects(
    places_px: NDArray[np.floating], rng: np.random.Generator, strange: bool = True
) -> tuple[NDArray[np.int8], NDArray[np.float32]]:
    """Defects that last for some frames, at the same places of the body.

    Args:
        places_px: (T, V, 2), where the body's vertices are seen.
        rng: random numbers.
        strange: whether there is foreground beside the body, too.

    Returns:
        Edges (T,) and discs (T, D, 3), px, for `kernels.spoil_silhouettes`.
    """
    count, slots = len(places_px), _HOLES + len(_LARGE_HOLES) + 1
    edges, discs = np.zeros(count, np.int8), np.zeros((count, slots, 3), np.float32)
    frame = 0
    while frame < count:
        if rng.random() >= _BOUT:
            frame += 1
            continue
        bout = slice(frame, frame + int(rng.integers(1, _LONGEST_BOUT + 1)))
        edges[bout] = rng.integers(-1, 2)
        radii, away = np.zeros(slots), np.zeros((slots, 2))
        holes = int(rng.integers(_HOLES + 1))
        radii[:holes] = rng.uniform(*_HOLE_PX, holes)
        for k, (chance, sizes) in enumerate(_LARGE_HOLES, _HOLES):
            if rng.random() < chance:
                radii[k] = rng.uniform(*sizes)
        if strange and rng.random() < _STRANGE:
            radii[-1], away[-1] = -rng.uniform(*_STRANGE_PX), rng.normal(0, _STRANGE_AWAY_PX, 2)
        chosen = rng.integers(places_px.shape[1], size=slots)
        discs[bout, :, :2] = places_px[bout][:, chosen] + away
        discs[bout, :, 2] = radii
        frame = bout.stop
    return edges, discs


def wall_coloured_places(
    places_px: NDArray[np.floating], colour: NDArray[np.integer], rng: np.random.Generator
) -> NDArray[np.float32]:
    """Places of one colour that are missing in most frames of some takes.

    Args:
        places_px: (T, V, 2), where the body's vertices are seen.
        colour: (V,), number of each vertex's colour.
        rng: random numbers.

    Returns:
        Discs (T, D, 3), px, for `kernels.spoil_silhouettes`.
    """
    alike = np.flatnonzero(colour == rng.choice(np.unique(colour)))
    number = int(rng.integers(*_PLACES)) * (rng.random() < _ALIKE)
    seen = rng.random((len(places_px), number)) < rng.uniform(*_OFTEN)
    radii = seen * rng.uniform(*_PLACE_PX, number)
    places = places_px[:, rng.choice(alike, number)]
    return np.concatenate([places, radii[..., None]], axis=2).astype(np.float32)


def cast_shadow(
    surface: NDArray[np.float32], rng: np.random.Generator
) -> NDArray[np.float32] | None:
    """Surface (T, V, 3) of a shadow on the floor at 0, of the lower part of a body or of all of it.

    Args:
        surface: (T, V, 3) of the body, statures.
        rng: random numbers.

    Returns:
        The surface; None in most takes.
    """
    if rng.random() >= _SHADOWED:
        return None
    azimuth, length = rng.uniform(0, 2 * np.pi), 1 / np.tan(rng.uniform(*_ELEVATION))
    along = np.array([np.cos(azimuth), np.sin(azimuth)], np.float32) * np.float32(length)
    height = np.clip(surface[..., 2:], 0, rng.uniform(*_SHADOW_OF))
    shadow = np.zeros(surface.shape, np.float32)
    shadow[..., :2] = surface[..., :2] + along * height
    return shadow
