"""Clock offsets between cameras, from silhouettes.

A motion changes the outlines of all cameras at the same time. First, the vertical velocities of the
outlines are correlated between cameras (`calib.signals`), which needs no calibration. Then the
tangent planes of every two cameras (`calib.tangency`) are compared: their error has a sharp minimum
at the right offset, which least squares over all pairs determines to a small fraction of a frame.

Source: Sinha and Pollefeys, Synchronization and calibration of camera networks from silhouettes,
for offsets from frontier points; standard errors by the delete-a-block jackknife.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calib.agreement import OUTLINES_PX, image_scale, trimmed_mean
from calib.checks import FloatArray
from calib.errors import InputError
from calib.signals import (
    Offset,
    OffsetCosts,
    Signal,
    SignalSettings,
    checked_reference,
    consistent_offsets,
    jackknife,
    offset_table,
    offsets_from_signals,
)
from calib.tangency import OutlineTrack, offset_grid, tangency
from calib.tuning import AGREEMENT, SIGNALS

_MAX_MOMENTS = 240
_MIN_PLANES = 8
_BLOCKS = 6


@dataclass(frozen=True)
class Synchronisation:
    """Clock offsets of all cameras."""

    reference: str  #: The camera whose clock is the reference.
    offsets: tuple[Offset, ...]  #: One row per camera.
    before_px: float
    """Error of all cameras' tangent planes without offsets; NaN if none is comparable."""
    after_px: float  #: The same error with the offsets.
    agreed: bool
    """Whether the cameras agree at these offsets. If not, the offsets come from the velocities of
    the outlines alone."""

    @property
    def offset_s(self) -> dict[str, float]:
        """Offset by camera name, s."""
        return {line.camera: line.offset_s for line in self.offsets}


def synchronise(
    tracks: Sequence[OutlineTrack], max_offset_s: float, reference: str | None = None
) -> Synchronisation:
    """Estimates the offsets between cameras' clocks. InputError where there are fewer than two
    cameras, the reference is unknown, or nobody moves.

    Args:
        tracks: Outlines of at least two cameras, frame by frame, each with times of its own clock.
        max_offset_s: Largest offset considered, s.
        reference: The camera whose clock is the reference; None for the first.
    """
    names = [track.camera.name for track in tracks]
    reference = checked_reference(names, reference)
    for track in tracks:
        require_motion(track)
    ordered = sorted(tracks, key=lambda track: track.camera.name != reference)
    pairs = {
        (a, b): _costs(ordered[a], ordered[b], max_offset_s)
        for a, b in combinations(range(len(ordered)), 2)
    }
    costs = {pair: cost for pair, (cost, _) in pairs.items()}
    start = consistent_offsets(costs, len(ordered), max_offset_s)
    weights = np.array([weight for _, weight in pairs.values()])
    offsets, errors = _refined_offsets(ordered, start, weights)
    before, after = _error(ordered, np.zeros(len(ordered))), _error(ordered, offsets)
    agreed = bool(np.isfinite(after) and after <= AGREEMENT.disagree_px * image_scale(tracks))
    if not agreed:
        settings = SignalSettings(max_offset_s)
        by_signal = offsets_from_signals([outline_signal(track) for track in ordered], settings)
        offsets = np.array([line.offset_s for line in by_signal.offsets])
        errors = np.full(len(ordered), np.nan)
    order = [track.camera.name for track in ordered]
    table = offset_table(order, names, offsets, errors, [track.period_s for track in ordered])
    return Synchronisation(reference, table, before, _error(ordered, offsets), agreed)


def outline_signal(track: OutlineTrack) -> Signal:
    """Vertical velocities of a track's top, middle and bottom, in body heights per second.

    Up and down look alike from all sides, which is not so of speeds in the image: of those, the
    offsets' errors are ten times as large. The cameras must stand upright.
    """
    rows = np.full((len(track.outlines), 3), np.nan)
    for index, outline in enumerate(track.outlines):
        if outline is not None:
            high, low = outline.pixels[:, 1].min(), outline.pixels[:, 1].max()
            rows[index] = high, outline.middle[1], low
    heights = rows[:, 2] - rows[:, 0]
    size = max(float(np.nanmedian(heights)) if np.isfinite(heights).any() else 1.0, 1.0)
    rate = np.asarray(np.gradient(rows, track.time_s, axis=0)) / size
    return Signal(track.camera.name, track.time_s, rate)


def require_motion(track: OutlineTrack) -> None:
    """Refuses a camera without motion. InputError where nobody is seen, or nobody moves."""
    if track.seen.sum() < 3:
        raise InputError(
            f"{track.camera.name} sees nobody: offsets are found from somebody's motion"
        )
    corners = [outline.pixels for outline in track.outlines if outline is not None]
    box = np.array(
        [[*corners_px.min(axis=0), *corners_px.max(axis=0)] for corners_px in corners]
    ) / (max(track.camera.size) / 480)
    later = len(box) // 4
    moved = np.abs(box[later:] - box[: len(box) - later]).max(axis=1)
    if np.median(moved) < AGREEMENT.disagree_px:
        raise InputError(
            f"nobody moves in {track.camera.name}, so its offset cannot be found: take a part in"
            " which somebody walks or swings the arms"
        )


def _costs(
    first: OutlineTrack, second: OutlineTrack, max_offset_s: float
) -> tuple[OffsetCosts, float]:
    """Relative tangency errors of two cameras at all offsets of the second, the same everywhere
    where none is known; and the pair's weight: 1 if it agrees at some offset, less the larger its
    smallest error.
    """
    step = 2 * AGREEMENT.step_frames * min(first.period_s, second.period_s)
    offsets = offset_grid(max_offset_s, step)
    moments = first.time_s[:: max(1, len(first.time_s) // _MAX_MOMENTS)]
    signed_errors = [
        tangency(first, second, moments, (0.0, offset)) / image_scale([first, second])
        for offset in offsets
    ]
    known = np.array([np.isfinite(signed).sum() for signed in signed_errors])
    errors = np.array([trimmed_mean(signed) for signed in signed_errors])
    errors[known < max(_MIN_PLANES, SIGNALS.overlap * known.max())] = np.nan
    if not np.isfinite(errors).any():
        return (offsets, np.ones(len(offsets))), 0.0
    largest, usual = np.nanmax(errors), max(float(np.nanmedian(errors)), 1e-9)
    weight = OUTLINES_PX / max(OUTLINES_PX, float(np.nanmin(errors)))
    return (offsets, np.nan_to_num(errors, nan=largest) / usual), weight


def _moments(tracks: Sequence[OutlineTrack], offsets: FloatArray) -> FloatArray:
    """Times (M,), s, of the first camera's clock at which two cameras may have recorded."""
    times = [track.time_s - offset for track, offset in zip(tracks, offsets, strict=True)]
    begin, end = min(float(t[0]) for t in times), max(float(t[-1]) for t in times)
    step = max(max(track.period_s for track in tracks), (end - begin) / _MAX_MOMENTS)
    return np.arange(begin, end, step)


def _residuals(
    tracks: Sequence[OutlineTrack], offsets: FloatArray, moments: FloatArray
) -> FloatArray:
    """Signed errors (pairs, M, 2), px of an image of 480 x 360; NaN where unknown."""
    pairs = combinations(range(len(tracks)), 2)
    errors = [
        tangency(tracks[a], tracks[b], moments, (float(offsets[a]), float(offsets[b])))
        for a, b in pairs
    ]
    return np.array(errors) / image_scale(tracks)


def _error(tracks: Sequence[OutlineTrack], offsets: FloatArray) -> float:
    """Error of all cameras, px."""
    residuals = _residuals(tracks, offsets, _moments(tracks, offsets))
    return trimmed_mean(residuals) * image_scale(tracks)


def _refined_offsets(
    tracks: Sequence[OutlineTrack], start: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Offsets (cameras,), s, that minimise the weighted errors, and their standard errors.

    Args:
        start: (cameras,), s, initial offsets.
        weights: (pairs,), weight of each pair of cameras.
    """
    moments = _moments(tracks, start)
    unit = min(track.period_s for track in tracks)
    known = np.isfinite(_residuals(tracks, start, moments))
    if not known.any():
        return start, np.full(len(tracks), np.nan)

    def solve(use: NDArray[np.bool_], begin: FloatArray) -> FloatArray:
        def cost(x: FloatArray) -> FloatArray:
            residuals = weights[:, None, None] * _residuals(
                tracks, np.concatenate([[0.0], x * unit]), moments
            )
            return np.where(use & np.isfinite(residuals), residuals, 0.0)[use]

        def slopes(x: FloatArray) -> FloatArray:
            # Wide steps: angles are interpolated linearly, so the error has kinks at the frames.
            half = AGREEMENT.step_frames
            steps = half * np.eye(len(x))
            return np.array([(cost(x + step) - cost(x - step)) / (2 * half) for step in steps]).T

        result = least_squares(
            cost,
            begin[1:] / unit,
            jac=slopes,  # pyright: ignore[reportArgumentType]  # the stubs only have strings
            loss="soft_l1",
            f_scale=OUTLINES_PX,
            max_nfev=30,
        )
        return np.concatenate([[0.0], result.x * unit])

    offsets = solve(known, start)
    block = np.arange(len(moments)) * _BLOCKS // len(moments)
    replicates = [
        solve(known & (block != left_out)[None, :, None], offsets) for left_out in range(_BLOCKS)
    ]
    return offsets, np.sqrt(jackknife(replicates))
