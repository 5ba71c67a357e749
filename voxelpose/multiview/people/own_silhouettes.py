"""One person's silhouettes among several people's.

A pixel of the foreground has to be covered by somebody, and it does not matter by whom. So where
others are, nothing is known of a person; where they are not, the foreground is that person's, as
far as it is nearer to it than to them. Fitting one person after the other so lowers one cost: the
exclusive or of the silhouettes and all bodies together.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import cv2
import numpy as np
from scipy.optimize import linear_sum_assignment

from calib.checks import BoolArray, Float32Array, FloatArray
from silhouette_core.refinement.observation import PinholeViews
from voxelpose.multiview.carving.footprint import footprint
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.silhouettes.mask_store import MaskStore, mask_stores
from voxelpose.multiview.silhouettes.observation_store import OtherPeople
from voxelpose.multiview.tuning import CARVING

Masks = list[BoolArray]


def hull_pieces(masks: Masks, axes_m: FloatArray, observer: HullObserver) -> list[Masks | None]:
    """Where the hull near each of N people is seen, as far as limbs reach: (h, w) bool in every
    camera.

    Args:
        masks: silhouettes of everybody.
        axes_m: (N, 2) float64, where they stand; NaN: not there, which gives None.
    """
    pieces: list[Masks | None] = [None] * len(axes_m)
    present = np.flatnonzero(np.isfinite(axes_m).all(axis=1))
    if not len(present):
        return pieces
    hull, grid = observer.coarse_hull(masks), observer.coarse
    x, y, _ = grid.axes()
    distances = [np.hypot(x[:, None] - east, y - north) for east, north in axes_m[present]]
    nearest = np.argmin(distances, axis=0)
    for k, person in enumerate(present.tolist()):
        piece = hull & ((nearest == k) & (distances[k] <= CARVING.limb_m))[:, :, None]
        pieces[person] = [footprint(piece, grid, camera) for camera in observer.views.rig]
    return pieces


def seen_pieces(
    pieces: Sequence[Masks | None], seen: Sequence[Sequence[BoolArray]]
) -> list[Masks | None]:
    """Pieces, with what the pose network sees of somebody instead where it does; others have no
    share in that.

    Args:
        pieces: of N people, (h, w) bool in every camera, see `hull_pieces`.
        seen: by camera, the masks (h, w) bool of those whom it sees, who do not overlap.
    """
    people = {k: list(piece) for k, piece in enumerate(pieces) if piece is not None}
    for c, masks in enumerate(seen):
        overlap = [[_overlap(parts[c], mask) for mask in masks] for parts in people.values()]
        costs = -np.array(overlap).reshape(len(people), len(masks))
        taken = zip(*linear_sum_assignment(costs), strict=True)
        by_person = {[*people][row]: masks[k] for row, k in taken if costs[row, k] < 0}
        for person, parts in people.items():
            others = [mask for k, mask in by_person.items() if k != person]
            beside = np.logical_or.reduce([np.zeros_like(parts[c]), *others])
            parts[c] = by_person.get(person, parts[c] & ~beside)
    return [people.get(k) for k in range(len(pieces))]


def _overlap(one: BoolArray, other: BoolArray) -> float:
    """Intersection over union of two masks (h, w)."""
    return float(np.count_nonzero(one & other) / max(np.count_nonzero(one | other), 1))


def own_and_unknown(
    masks: Masks, pieces: Sequence[Masks | None], person: int, *, bodies: bool = True
) -> tuple[Masks, Masks]:
    """One person's silhouettes, and where nothing is known of them, in every camera.

    Args:
        masks: silhouettes of everybody.
        pieces: where each of N people is seen; None: not there.
        person: number of the person among them.
        bodies: whether pieces are bodies: where two are, one is enough to explain the pixel. Pieces
            of hull are larger than bodies, and where two are, the pixel may be either's.
    """
    silhouettes, unknown = [], []
    for c, mask in enumerate(masks):
        others = np.zeros_like(mask)
        for k, piece in enumerate(pieces):
            if k != person and piece is not None:
                others |= piece[c]
        footprints = pieces[person]
        near = mask & ~others
        if footprints is not None and others.any():
            near &= _distance_px(footprints[c]) <= _distance_px(others)
            if not bodies:
                near |= mask & footprints[c]
        silhouettes.append(near)
        unknown.append((mask | others) & ~near)
    return silhouettes, unknown


def _distance_px(mask: BoolArray) -> Float32Array:
    """Distance (h, w) of every pixel from a mask; infinite from an empty one."""
    if not mask.any():
        return np.full(mask.shape, np.inf, np.float32)
    distance = cv2.distanceTransform((~mask).view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3)
    return np.asarray(distance, np.float32)


@contextmanager
def silhouettes_of(
    store: MaskStore,
    pieces: Iterator[Sequence[Masks | None]],
    places_m: FloatArray,
    views: PinholeViews,
) -> Iterator[list[tuple[MaskStore, OtherPeople]]]:
    """Each person's silhouettes, and what others leave open of them, for a `with` block.

    Args:
        store: silhouettes of everybody.
        pieces: of every frame, see `own_and_unknown`.
        places_m: (N, T, 3) float64, about where each is; NaN: not there.
        views: the cameras.
    """
    sizes = [camera.size for camera in views.rig]
    with mask_stores(2 * len(places_m), sizes, len(store)) as stores:
        each = [
            (store_of, OtherPeople(unknown, at_m, np.ones(len(store))))
            for store_of, unknown, at_m in zip(stores[::2], stores[1::2], places_m, strict=True)
        ]
        for t, seen in enumerate(pieces):
            masks = store[t]
            for person, (store_of, others) in enumerate(each):
                separated = own_and_unknown(masks, seen, person)
                for one, silhouettes in zip((store_of, others.unknown), separated, strict=True):
                    one.put(t, silhouettes)
                if (footprints := seen[person]) is not None:
                    pairs = zip(footprints, separated[1], strict=True)
                    shares = [
                        (piece & unknown).sum() / max(piece.sum(), 1) for piece, unknown in pairs
                    ]
                    others.hidden[t] = np.mean(shares)
        yield each
