"""Who comes back: somebody who was away too long to be known by the place, told by the colours."""

from itertools import combinations

import numpy as np

from calib.checks import BoolArray, FloatArray
from calib.moments import even_moments
from silhouette_core.image.head_colours import coarse_histogram, quantise, unlikeness
from silhouette_core.ranking import rounded
from voxelpose.multiview.people.own_silhouettes import hull_pieces
from voxelpose.multiview.silhouettes.prepared_silhouettes import PreparedSilhouettes
from voxelpose.multiview.tracking.recording_track import REFIT_FRAMES


def never_at_once(axes_m: FloatArray) -> BoolArray:
    """(N, N) bool: which of N tracks (N, T, 2), NaN: not there, have no frame in common."""
    present = np.isfinite(axes_m[:, :, 0])
    return np.asarray(~(present[:, None] & present[None]).any(axis=2), np.bool_)


def looks_of(prepared: PreparedSilhouettes, axes_m: FloatArray) -> FloatArray:
    """Colours of N tracks: (N, n) float64, histograms of the pixels that only one of them explains.

    Args:
        prepared: silhouettes of everybody.
        axes_m: (N, T, 2) float64, where the people stand in all frames; NaN: not there.
    """
    store, footage = prepared.store, prepared.footage
    present = [np.flatnonzero(np.isfinite(track[:, 0])) for track in axes_m]
    steps = sorted(
        {int(t) for track in present for t in track[even_moments(len(track), REFIT_FRAMES)]}
    )
    cameras = [*zip(footage.source.rig.names, footage.lenses, footage.late, strict=True)]
    looks: list[list[FloatArray]] = [[] for _ in axes_m]
    for t, frames in zip(steps, footage.source.at(steps), strict=True):
        for c, (name, lens, late) in enumerate(cameras):
            in_step = t - late  # as silhouettes are, not pictures
            if not 0 <= in_step < len(store):
                continue
            masks = store[in_step]
            pieces = hull_pieces(masks, axes_m[:, in_step], prepared.observer)
            covered = np.sum([piece[c] for piece in pieces if piece is not None], axis=0)
            colours = quantise(lens.undistort_part(frames[name], (0, 0), lens.pinhole.size))
            for track, piece in zip(looks, pieces, strict=True):
                if piece is not None:
                    track.append(coarse_histogram(colours[masks[c] & piece[c] & (covered == 1)]))
    means = [np.mean(track, axis=0) for track in looks]
    return np.stack([mean / max(mean.sum(), np.finfo(float).tiny) for mean in means])


def rejoined(axes_m: FloatArray, looks: FloatArray | None, people: int | None) -> list[list[int]]:
    """Which of N tracks are the same person's, who went and came back.

    Two are who look less than half as different as any two who are there at once.

    Args:
        axes_m: (N, T, 2) float64; NaN: not there.
        looks: (N, n) float64, as of `looks_of`; None: they are not known.
        people: how many there are: while more are left, the most alike are the same; None: that is
            not known.
    """
    apart = never_at_once(axes_m)
    unlike = np.ones(apart.shape)
    if looks is not None:
        unlike = unlikeness(looks[:, None], looks[None])
    most = unlike[~apart & ~np.eye(len(apart), dtype=np.bool_)].min(initial=1) / 2
    groups = [[k] for k in range(len(axes_m))]

    def cost(pair: tuple[list[int], list[int]]) -> float:
        """How different two look."""
        return float(rounded(unlike[np.ix_(*pair)].mean()))

    while True:
        pairs = [pair for pair in combinations(groups, 2) if apart[np.ix_(*pair)].all()]
        best = min(pairs, key=cost, default=None)
        too_many = people is not None and len(groups) > people
        if best is None or (cost(best) >= most and not too_many):
            return groups
        first, second = best
        groups.remove(second)
        first += second
