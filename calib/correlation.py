"""Correlation of what two cameras measured over time, at all offsets between their clocks.

Source: normalised cross-correlation where some values are missing: Padfield, Masked object
registration in the Fourier domain.
"""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import correlate

from calib.checks import FloatArray
from calib.tangency import interpolate
from calib.tuning import SIGNALS

NEAR_STEPS = 8
"""Steps within which the peak of a pair is looked for."""


@dataclass(frozen=True, eq=False)
class Signal:
    """What one camera measured over time.

    Attributes:
        time_s: (T,) float64, increasing: times by its own clock.
        values: (T, K) float64, NaN where unknown; the same K things for all cameras.
    """

    camera: str
    time_s: FloatArray
    values: FloatArray

    @property
    def period_s(self) -> float:
        """Time between values, s."""
        return float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 1.0


@dataclass(frozen=True)
class SignalSettings:
    """How signals are compared.

    Attributes:
        max_offset_s: Largest offset between two cameras, s.
        step_s: Step at which signals are sampled, s.
        sigma_s: Standard deviation of the Gaussian by which they are smoothed, s.
        lasting: Whether they say something all the time, so that parts of them can be left out to
            estimate errors; a single clap cannot.
    """

    max_offset_s: float
    step_s: float = SIGNALS.step_s
    sigma_s: float = SIGNALS.sigma_s
    lasting: bool = True


@dataclass(frozen=True, eq=False)
class OffsetCosts:
    """Cost of each offset of a pair's second camera relative to the first.

    Attributes:
        offsets_s: (K,) float64, increasing, s.
        values: (K,) float64.
    """

    offsets_s: FloatArray
    values: FloatArray

    def at(self, offset_s: FloatArray) -> FloatArray:
        """Costs (M,) of offsets (M,), s; the largest beyond the ends."""
        largest = self.values.max()
        return np.interp(offset_s, self.offsets_s, self.values, left=largest, right=largest)


@dataclass(frozen=True, eq=False)
class Correlogram:
    """Correlation of two cameras' signals by offset of the second relative to the first.

    Attributes:
        offsets_s: (K,) float64, evenly increasing, s.
        values: (K,) float64, -1 to 1; NaN where the signals hardly overlap.
    """

    offsets_s: FloatArray
    values: FloatArray

    def costs(self) -> OffsetCosts:
        """Lack of correlation."""
        return OffsetCosts(self.offsets_s, 1 - np.nan_to_num(self.values))

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
        at = low + int(values[low : middle + NEAR_STEPS + 1].argmax())
        if not 0 < at < len(values) - 1:
            return near_s, 0.0
        before, here, after = values[at - 1 : at + 2]
        curvature = before - 2 * here + after
        if here <= max(before, after, 0) or curvature >= 0:
            return near_s, 0.0
        shift = 0.5 * (before - after) / curvature
        weight = -curvature / step**2 * here / max(1 - here**2, 1e-6)
        return float(self.offsets_s[at] + step * shift), float(weight)


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
    kept = np.abs(lags) <= most
    each = np.full((first.values.shape[1], 2 * most + 1), np.nan)
    for row, (a, b) in enumerate(zip(first.values.T, second.values.T, strict=True)):
        each[row, lags[kept] + most] = masked_correlation(a, b)[kept]
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
