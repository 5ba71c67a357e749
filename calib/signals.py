"""Clock offsets between cameras, from anything that all of them measure over time.

The signals (speeds of an outline or of a board, loudness) need no calibration. Every two cameras'
signals are correlated at all offsets; the offsets of all cameras are those at which the pairs
together correlate best, refined by least squares over the peaks of the pairs.

Source: normalised cross-correlation where some values are missing: Padfield, Masked object
registration in the Fourier domain; standard errors by the delete-a-block jackknife.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import correlate

from calib.checks import FloatArray
from calib.errors import InputError
from calib.tangency import interpolate, offset_grid
from calib.tuning import SIGNALS

OffsetCosts = tuple[FloatArray, FloatArray]
"""Offsets (K,), s, increasing, of a pair's second camera relative to the first, and costs (K,)."""
NEAR_STEPS = 8
"""Steps within which the peak of a pair is looked for."""
_ROUNDS = 4
_BLOCKS = 6


@dataclass(frozen=True, eq=False)
class Signal:
    """What one camera measured over time."""

    camera: str
    time_s: FloatArray  #: (T,) float64, increasing: times by its own clock.
    values: FloatArray  #: (T, K) float64, NaN where unknown; the same K things for all cameras.

    @property
    def period_s(self) -> float:
        """Time between values, s."""
        return float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 1.0


@dataclass(frozen=True)
class SignalSettings:
    """How signals are compared."""

    max_offset_s: float  #: Largest offset between two cameras, s.
    step_s: float = SIGNALS.sigma_s / 6  #: Step at which signals are sampled, s.
    sigma_s: float = SIGNALS.sigma_s
    """Standard deviation of the Gaussian by which they are smoothed, s."""
    lasting: bool = True
    """Whether they say something all the time, so that parts of them can be left out to estimate
    errors; a single clap cannot."""


@dataclass(frozen=True, eq=False)
class Correlogram:
    """Correlation of two cameras' signals by offset of the second relative to the first."""

    offsets_s: FloatArray  #: (K,) float64, evenly increasing, s.
    values: FloatArray  #: (K,) float64, -1 to 1; NaN where the signals hardly overlap.

    def at(self, offset_s: float) -> float:
        """Correlation at an offset, s; 0 where unknown."""
        return float(np.interp(offset_s, self.offsets_s, np.nan_to_num(self.values)))

    def peak(self, near_s: float) -> tuple[float, float]:
        r"""Offset, s, of the peak near an offset, and its weight in least squares.

        The peak is that of the parabola through three values. With the correlation and its
        curvature, the weight is

        .. math:: w = -\frac{\rho'' \rho}{1 - \rho^2}
        """
        step = float(self.offsets_s[1] - self.offsets_s[0])
        values = np.nan_to_num(self.values)
        middle = int(np.clip(np.rint((near_s - self.offsets_s[0]) / step), 0, len(values) - 1))
        low = max(middle - NEAR_STEPS, 0)
        peak = low + int(values[low : middle + NEAR_STEPS + 1].argmax())
        if not 0 < peak < len(values) - 1:
            return near_s, 0.0
        before, here, after = values[peak - 1 : peak + 2]
        curvature = before - 2 * here + after
        if here <= max(before, after, 0) or curvature >= 0:
            return near_s, 0.0
        shift = 0.5 * (before - after) / curvature
        weight = -curvature / step**2 * here / max(1 - here**2, 1e-6)
        return float(self.offsets_s[peak] + step * shift), float(weight)


@dataclass(frozen=True)
class Offset:
    """Clock offset of one camera."""

    camera: str
    offset_s: float
    """By how much its clock is ahead of the reference's: its frame of time t was taken at t -
    offset."""
    error_s: float  #: Standard error of the offset; NaN if unknown.
    frames: float  #: The offset in its frames.


@dataclass(frozen=True)
class SignalOffsets:
    """Clock offsets from signals."""

    reference: str  #: The camera whose clock is the reference.
    offsets: tuple[Offset, ...]  #: One row per camera.
    correlation: float  #: Mean correlation of the pairs at these offsets.
    disagreement_s: float
    """By how much the pairs' own offsets differ from these, root mean square; NaN with two
    cameras."""
    unlike: tuple[str, ...]  #: Names of cameras whose signal is like none of the others'.
    ambiguous: tuple[str, ...]  #: Names of cameras for which another offset is nearly as likely.

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
    """Estimates the offsets between cameras' clocks. InputError where there are fewer than two
    cameras, or the reference is unknown.

    Args:
        signals: One of each of at least two cameras.
        reference: The camera whose clock is the reference; None for the first.
    """
    names = [signal.camera for signal in signals]
    reference = checked_reference(names, reference)
    ordered = sorted(signals, key=lambda signal: signal.camera != reference)
    even = [sampled(signal, settings) for signal in ordered]
    curves = _curves(even, settings)
    costs = {
        pair: (curve.offsets_s, 1 - np.nan_to_num(curve.values)) for pair, curve in curves.items()
    }
    start = consistent_offsets(costs, len(names), settings.max_offset_s)
    offsets, variance, residuals = _adjusted(curves, start)
    if settings.lasting:
        variance = np.maximum(variance, _jackknife(even, start, settings))
    peaks = {(a, b): curve.at(offsets[b] - offsets[a]) for (a, b), curve in curves.items()}
    order = [signal.camera for signal in ordered]
    periods = [signal.period_s for signal in ordered]
    cameras = range(len(names))
    best = [max(value for pair, value in peaks.items() if camera in pair) for camera in cameras]
    rivalled = [_is_rivalled(curves, offsets, camera, settings) for camera in cameras]
    return SignalOffsets(
        reference,
        offset_table(order, names, offsets, np.sqrt(variance), periods),
        float(np.mean(list(peaks.values()))),
        float(np.sqrt(np.mean(residuals**2))) if len(names) > 2 else np.nan,
        tuple(name for name, value in zip(order, best, strict=True) if value < SIGNALS.alike),
        tuple(
            name
            for name, value, other in zip(order, best, rivalled, strict=True)
            if value >= SIGNALS.alike and other
        ),
    )


def offset_table(
    order: Sequence[str],
    names: Sequence[str],
    offsets: FloatArray,
    errors: FloatArray,
    periods: Sequence[float],
) -> tuple[Offset, ...]:
    """Rows in the order of `names`, of offsets, standard errors and periods, s, in another one."""
    columns = zip(order, offsets.tolist(), errors.tolist(), periods, strict=True)
    rows = {name: Offset(name, late, error, late / period) for name, late, error, period in columns}
    return tuple(rows[name] for name in names)


def _is_rivalled(
    curves: Mapping[tuple[int, int], Correlogram],
    offsets: FloatArray,
    camera: int,
    settings: SignalSettings,
) -> bool:
    """Whether a camera correlates with the others nearly as well at another offset."""
    grid = offset_grid(settings.max_offset_s, settings.step_s)
    total, chosen = np.zeros(len(grid)), 0.0
    for (a, b), curve in curves.items():
        if camera in (a, b):
            sign, other = (1, a) if camera == b else (-1, b)
            values = np.nan_to_num(curve.values)
            relative = sign * (offsets[camera] + grid - offsets[other])
            total += np.interp(relative, curve.offsets_s, values, left=0.0, right=0.0)
            chosen += curve.at(sign * (offsets[camera] - offsets[other]))
    apart = np.abs(grid) > SIGNALS.apart_s
    if not apart.any():
        return False
    chosen, rival = chosen / (len(offsets) - 1), float(total[apart].max()) / (len(offsets) - 1)
    return rival > SIGNALS.rival * chosen and 1 - rival**2 < SIGNALS.telling * (1 - chosen**2)


def checked_reference(names: Sequence[str], reference: str | None) -> str:
    """The camera whose clock is the reference: a given one, or the first. InputError where there
    are fewer than two cameras, or the reference is unknown.
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
        float(tried[1] - tried[0]) if len(tried) > 1 else max_offset_s
        for tried, _ in costs.values()
    )
    grid = offset_grid(max_offset_s, step)
    offsets = np.zeros(count)

    def best_offset(camera: int, others: Sequence[int]) -> tuple[float, float]:
        cost = np.zeros(len(grid))
        for other in others:
            tried, values = costs[min(camera, other), max(camera, other)]
            relative = (grid - offsets[other]) * (1 if camera > other else -1)
            cost += np.interp(relative, tried, values, left=values.max(), right=values.max())
        best = int(cost.argmin())
        return float(cost[best] - np.median(cost)) / max(1, len(others)), float(grid[best])

    known, waiting = [0], list(range(1, count))
    while waiting:
        # The camera with the most distinct minimum comes first.
        best = {camera: best_offset(camera, known) for camera in waiting}
        camera = min(waiting, key=lambda camera: best[camera][0])
        offsets[camera] = best[camera][1]
        known.append(camera)
        waiting.remove(camera)
    for _ in range(_ROUNDS):
        for camera in range(1, count):
            others = [other for other in range(count) if other != camera]
            offsets[camera] = best_offset(camera, others)[1]
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
    return jackknife(replicates)


def jackknife(replicates: Sequence[FloatArray]) -> FloatArray:
    """Variances of estimates, from those without one block of the data each."""
    return (len(replicates) - 1) * np.var(replicates, axis=0)


def sampled(signal: Signal, settings: SignalSettings) -> Signal:
    """A signal at multiples of the step, smoothed, its means zero."""
    first = np.ceil(signal.time_s[0] / settings.step_s - 1e-6)
    last = np.maximum(first, np.floor(signal.time_s[-1] / settings.step_s + 1e-6))
    time_s = np.arange(first, last + 1, dtype=np.float64) * settings.step_s
    values = interpolate(signal.time_s, signal.values, time_s)
    known = np.isfinite(values)
    sigma = settings.sigma_s / settings.step_s
    weights = gaussian_filter1d(known.astype(np.float64), sigma, axis=0)
    smooth = gaussian_filter1d(np.where(known, values, 0.0), sigma, axis=0)
    smooth /= np.maximum(weights, 1e-12)
    smooth[~known] = np.nan
    mean = np.where(known.any(axis=0), np.nansum(smooth, axis=0) / np.maximum(known.sum(0), 1), 0)
    return Signal(signal.camera, time_s, smooth - mean)


def correlogram(first: Signal, second: Signal, settings: SignalSettings) -> Correlogram:
    """Correlation of two signals that `sampled` returned with the same settings."""
    step = settings.step_s
    begin = round((second.time_s[0] - first.time_s[0]) / step)
    # Row k of the full correlation belongs to an offset of `lags[k]` steps.
    lags = np.arange(-(len(first.time_s) - 1), len(second.time_s)) + begin
    most = max(round(settings.max_offset_s / step), 1)
    within = np.abs(lags) <= most
    each = np.full((first.values.shape[1], 2 * most + 1), np.nan)
    for row, (a, b) in enumerate(zip(first.values.T, second.values.T, strict=True)):
        each[row, lags[within] + most] = masked_correlation(a, b)[within]
    return Correlogram(np.arange(-most, most + 1, dtype=np.float64) * step, joint_correlation(each))


def joint_correlation(each: FloatArray) -> FloatArray:
    r"""Correlation (K,) of signals that measure several things, from that of each (C, K).

    What correlates well counts most, as in the mutual information of Gaussian variables:

    .. math:: \rho = \sqrt{1 - \prod_c (1 - \max(\rho_c, 0)^2)^{1/C}}

    NaN where none is known; a thing that is not known counts as uncorrelated.
    """
    known = np.clip(np.nan_to_num(each), 0.0, 1.0 - 1e-9)
    left = np.exp(np.log1p(-(known**2)).mean(axis=0))
    return np.where(np.isfinite(each).any(axis=0), np.sqrt(1 - left), np.nan)


def masked_correlation(first: FloatArray, second: FloatArray) -> FloatArray:
    r"""Normalised correlation (T + U - 1,) at all shifts of the second signal.

    .. math:: \rho_k = \frac{\sum_t (a_t - \bar a_k) (b_{t+k} - \bar b_k)}
        {\sqrt{\sum_t (a_t - \bar a_k)^2 \sum_t (b_{t+k} - \bar b_k)^2}}

    over the t at which both are known.

    Args:
        first: (T,) float64, a, NaN where unknown.
        second: (U,) float64, b, NaN where unknown.

    Returns:
        The correlation at shifts k = -(T - 1) to U - 1; NaN where less than a quarter of the
        shorter signal overlaps.
    """
    (a, known_a), (b, known_b) = (
        (np.nan_to_num(values), np.isfinite(values).astype(np.float64))
        for values in (first, second)
    )

    def slide(left: FloatArray, right: FloatArray) -> FloatArray:
        return np.asarray(correlate(right, left, "full", "fft"))

    count = np.rint(slide(known_a, known_b))
    enough = count >= max(SIGNALS.overlap * min(known_a.sum(), known_b.sum()), 3)
    count = np.maximum(count, 1)
    sum_a, sum_b = slide(a, known_b), slide(known_a, b)
    product = slide(a, b) - sum_a * sum_b / count
    spread_a = slide(a**2, known_b) - sum_a**2 / count
    spread_b = slide(known_a, b**2) - sum_b**2 / count
    floor = 1e-9 * max(float((a**2).sum()), float((b**2).sum()), 1e-30)
    enough &= (spread_a > floor) & (spread_b > floor)
    scale = np.sqrt(np.where(enough, spread_a * spread_b, 1.0))
    return np.where(enough, np.clip(product / scale, -1, 1), np.nan)
