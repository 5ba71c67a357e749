"""Clock offsets between cameras, from anything that all of them measure over time.

The signals (speeds of an outline or of a board, loudness) need no calibration. Every two cameras'
signals are correlated at all offsets; the offsets of all cameras are those at which the pairs
together correlate best, refined by least squares over the peaks of the pairs.

Source: standard errors by the delete-a-block jackknife.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np

from calib.checks import FloatArray
from calib.correlation import (
    NEAR_STEPS,
    Correlogram,
    OffsetCosts,
    Signal,
    SignalSettings,
    correlogram,
    sampled,
)
from calib.errors import InputError
from calib.tangency import offset_grid
from calib.tuning import SIGNALS

_ROUNDS = 4
_BLOCKS = 6


@dataclass(frozen=True)
class Offset:
    """Clock offset of one camera.

    Attributes:
        offset_s: By how much its clock is ahead of the reference's: its frame of time t was taken
            at t - offset.
        error_s: Standard error of the offset; NaN if unknown.
        frames: The offset in its frames.
    """

    camera: str
    offset_s: float
    error_s: float
    frames: float


@dataclass(frozen=True)
class SignalOffsets:
    """Clock offsets from signals.

    Attributes:
        reference: The camera whose clock is the reference.
        offsets: One row per camera.
        correlation: Mean correlation of the pairs at these offsets.
        disagreement_s: By how much the pairs' own offsets differ from these, root mean square; NaN
            with two cameras.
        unlike: Names of cameras whose signal is like none of the others'.
        ambiguous: Names of cameras for which another offset is nearly as likely.
    """

    reference: str
    offsets: tuple[Offset, ...]
    correlation: float
    disagreement_s: float
    unlike: tuple[str, ...]
    ambiguous: tuple[str, ...]

    @property
    def agreed(self) -> bool:
        """Whether there is one likely offset for every camera."""
        return not (self.unlike or self.ambiguous)

    @property
    def offset_s(self) -> dict[str, float]:
        """Offset by camera name, s."""
        return {line.camera: line.offset_s for line in self.offsets}


def offsets_from_signals(
    signals: Sequence[Signal], settings: SignalSettings, reference: str | None = None
) -> SignalOffsets:
    """Estimates the offsets between cameras' clocks.

    Args:
        signals: One of each of at least two cameras.
        reference: The camera whose clock is the reference; None for the first.

    Raises:
        InputError: Fewer than two cameras, or an unknown reference.
    """
    names = [signal.camera for signal in signals]
    reference = checked_reference(names, reference)
    ordered = sorted(signals, key=lambda signal: signal.camera != reference)
    even = [sampled(signal, settings) for signal in ordered]
    curves = _curves(even, settings)
    start = consistent_offsets(
        {pair: curve.costs() for pair, curve in curves.items()}, len(names), settings.max_offset_s
    )
    offsets, variance, residuals = _adjusted(curves, start)
    if settings.lasting:
        variance = np.maximum(variance, _jackknife(even, start, settings))
    at = {pair: curve.at(offsets[pair[1]] - offsets[pair[0]]) for pair, curve in curves.items()}
    lines = [
        Offset(
            signal.camera,
            float(offsets[index]),
            float(np.sqrt(variance[index])),
            float(offsets[index] / signal.period_s),
        )
        for index, signal in enumerate(ordered)
    ]
    order = [signal.camera for signal in ordered]
    best = [
        max(value for pair, value in at.items() if index in pair) for index in range(len(names))
    ]
    rivalled = [_is_rivalled(curves, offsets, index, settings) for index in range(len(names))]
    return SignalOffsets(
        reference,
        tuple(sorted(lines, key=lambda line: names.index(line.camera))),
        float(np.mean(list(at.values()))),
        float(np.sqrt(np.mean(residuals**2))) if len(names) > 2 else np.nan,
        tuple(name for name, value in zip(order, best, strict=True) if value < SIGNALS.alike),
        tuple(
            name
            for name, value, other in zip(order, best, rivalled, strict=True)
            if value >= SIGNALS.alike and other
        ),
    )


def _is_rivalled(
    curves: Mapping[tuple[int, int], Correlogram],
    offsets: FloatArray,
    camera: int,
    settings: SignalSettings,
) -> bool:
    """Whether a camera correlates with the others nearly as well at another offset."""
    grid = offset_grid(settings.max_offset_s, settings.step_s)
    total, own = np.zeros(len(grid)), 0.0
    for (a, b), curve in curves.items():
        if camera in (a, b):
            sign = 1 if camera == b else -1
            other = a if camera == b else b
            values = np.nan_to_num(curve.values)
            at = sign * (offsets[camera] + grid - offsets[other])
            total += np.interp(at, curve.offsets_s, values, left=0.0, right=0.0)
            own += curve.at(sign * (offsets[camera] - offsets[other]))
    apart = np.abs(grid) > max(SIGNALS.apart_sigmas * settings.sigma_s, SIGNALS.apart_s)
    if not apart.any():
        return False
    own, rival = own / (len(offsets) - 1), float(total[apart].max()) / (len(offsets) - 1)
    return rival > SIGNALS.rival * own and 1 - rival**2 < SIGNALS.telling * (1 - own**2)


def checked_reference(names: Sequence[str], reference: str | None) -> str:
    """The camera whose clock is the reference: a given one, or the first.

    Raises:
        InputError: Fewer than two cameras, or an unknown reference.
    """
    if len(names) < 2:
        raise InputError("one camera alone has nothing to be in step with")
    if reference is not None and reference not in names:
        raise InputError(f"there is no camera {reference}: there are {', '.join(names)}")
    return reference or names[0]


def consistent_offsets(
    costs: Mapping[tuple[int, int], OffsetCosts], count: int, max_offset_s: float
) -> FloatArray:
    """Offsets (cameras,), s, of least cost over all pairs; 0 for the first camera.

    Cameras are added one by one at the offset of least cost, then each offset is optimised in turn.
    """
    step = min(
        float(pair.offsets_s[1] - pair.offsets_s[0]) if len(pair.offsets_s) > 1 else max_offset_s
        for pair in costs.values()
    )
    grid = offset_grid(max_offset_s, step)
    offsets = np.zeros(count)

    def best_offset(camera: int, others: Sequence[int]) -> tuple[float, float]:
        cost = np.zeros(len(grid))
        for other in others:
            pair = costs[min(camera, other), max(camera, other)]
            cost += pair.at((grid - offsets[other]) * (1 if camera > other else -1))
        best = int(cost.argmin())
        return float(cost[best] - np.median(cost)) / max(1, len(others)), float(grid[best])

    known, waiting = [0], list(range(1, count))
    while waiting:
        # The camera with the most distinct minimum comes first.
        _, camera, offset = min(
            (*best_offset(camera, known)[:1], camera, best_offset(camera, known)[1])
            for camera in waiting
        )
        offsets[camera] = offset
        known.append(camera)
        waiting.remove(camera)
    for _ in range(_ROUNDS):
        for camera in range(1, count):
            offsets[camera] = best_offset(
                camera, [other for other in range(count) if other != camera]
            )[1]
    return offsets


def _curves(
    signals: Sequence[Signal], settings: SignalSettings
) -> dict[tuple[int, int], Correlogram]:
    return {
        (a, b): correlogram(signals[a], signals[b], settings)
        for a, b in combinations(range(len(signals)), 2)
    }


def _adjusted(
    curves: Mapping[tuple[int, int], Correlogram], start: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Offsets (cameras,), s, that fit the pairs' peaks best, their variances (cameras,), s^2, and
    what is left of each pair (pairs,), s.
    """
    peaks = [curve.peak(start[b] - start[a]) for (a, b), curve in curves.items()]
    offset_s, weight = np.array(peaks).T
    design = np.zeros((len(curves), len(start)))
    for row, (a, b) in enumerate(curves):
        design[row, [a, b]] = -1, 1
    weight = weight / max(float(weight.max()), 1e-300)
    normal = design[:, 1:].T @ (weight[:, None] * design[:, 1:])
    inverse = np.linalg.pinv(normal, hermitian=True)
    offsets = np.concatenate([[0.0], inverse @ design[:, 1:].T @ (weight * offset_s)])
    unknown = np.concatenate([[False], np.diag(normal) < 1e-9])
    offsets = np.where(unknown, start, offsets)
    residuals = offset_s - design @ offsets
    redundancy = len(curves) - len(start) + 1
    unit = float((weight * residuals**2).sum()) / redundancy if redundancy else 0.0
    variance = np.concatenate([[0.0], unit * np.diag(inverse)])
    return offsets, np.where(unknown, np.nan, variance), residuals


def _jackknife(
    signals: Sequence[Signal], start: FloatArray, settings: SignalSettings
) -> FloatArray:
    """Variances (cameras,), s^2, of the offsets, from leaving out one part of the time each."""
    begin = min(float(signal.time_s[0]) for signal in signals)
    end = max(float(signal.time_s[-1]) for signal in signals)
    edges = np.linspace(begin, end + settings.step_s, _BLOCKS + 1)
    near = replace(settings, max_offset_s=float(np.ptp(start)) + 2 * NEAR_STEPS * settings.step_s)
    replicates = []
    for low, high in pairwise(edges.tolist()):
        parts = []
        for signal, late in zip(signals, start, strict=True):
            inside = (signal.time_s - late >= low) & (signal.time_s - late < high)
            parts.append(replace(signal, values=np.where(inside[:, None], np.nan, signal.values)))
        replicates.append(_adjusted(_curves(parts, near), start)[0])
    deviations = np.array(replicates) - np.mean(replicates, axis=0)
    return (_BLOCKS - 1) / _BLOCKS * (deviations**2).sum(axis=0)
