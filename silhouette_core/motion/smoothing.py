"""Zero-phase low-pass filters over the poses of a finished motion."""

import math
from dataclasses import dataclass

import numpy as np

from calib.errors import InputError
from silhouette_core.setting_types import ORDERS
from silhouette_core.tuning import DYNAMICS

FILTERS = "butterworth", "savgol", "gaussian", "none"

_CUTOFFS_HZ = 1 / 10, 1000
_ORDERS = {"butterworth": 2, "savgol": 3}
_SHORTEST = 16  # frames
_HALF = 1 / 2  # of the amplitude is left at the cut-off
_SIGMA_HZ = math.sqrt(math.log(2) / 2) / math.pi  # of the Gaussian with that response at 1 Hz


@dataclass(frozen=True)
class LowPass:
    """A low-pass filter without lag."""

    kind: str = "butterworth"
    """Of `FILTERS`; `butterworth` acts forward and backward, `savgol` is Savitzky and Golay's."""
    cutoff_hz: float = DYNAMICS.cutoff_hz  #: Frequency at which half of the amplitude is left.
    order: int | None = None
    """Of the Butterworth filter, which is applied twice, or of Savitzky and Golay's polynomial;
    None: 2 and 3. A Gaussian has none."""

    def __post_init__(self) -> None:
        """Checks the values. Raises InputError where a value is none that can be used."""
        low, high = _CUTOFFS_HZ
        if self.kind not in FILTERS:
            raise InputError(f"no filter {self.kind!r}: choose from {', '.join(FILTERS)}")
        if not low <= self.cutoff_hz <= high:
            raise InputError(
                f"a cut-off of {self.cutoff_hz:g} Hz cannot be used: give {low:g} to {high:g}, for"
                f" example {DYNAMICS.cutoff_hz:g}"
            )
        if self.order is None:
            return
        if self.kind not in _ORDERS:
            raise InputError(f"the filter {self.kind!r} has no order: leave the order out")
        low, high = ORDERS
        if not low <= self.order <= high:
            raise InputError(f"order {self.order} is not from {low} to {high}: give 2 or 3")

    @property
    def usual_order(self) -> int | None:
        """The order as given or as usual; None of a filter that has none."""
        return _ORDERS.get(self.kind) if self.order is None else self.order

    def window(self, fps: float) -> int:
        """Frames of Savitzky and Golay's window that leaves about half at the cut-off."""
        from scipy.signal import savgol_coeffs

        order = self.usual_order or 0
        shortest = order + 1 + order % 2  # odd, and longer than the order

        def left(half: int) -> float:
            weights = savgol_coeffs(2 * half + 1, order)
            turns = self.cutoff_hz / fps * np.arange(-half, half + 1)
            return float(np.cos(2 * np.pi * turns) @ weights)

        low, high = shortest // 2, max(shortest // 2, 1)
        while left(high) > _HALF:
            low, high = high, 2 * high
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if left(middle) > _HALF else (low, middle)
        # The shortest windows can leave everything as it is.
        nearer = left(low) - _HALF < min(_HALF - left(high), _HALF / 2)
        return 2 * (low if nearer else high) + 1

    def sigma(self, fps: float) -> float:
        """Standard deviation of the Gaussian, frames."""
        return _SIGMA_HZ * fps / self.cutoff_hz

    def shortest(self, fps: float) -> int:
        """Length of the shortest signal that is filtered, frames."""
        lengths = {
            "butterworth": lambda: 3 * (self.usual_order or 0) + 4,
            "savgol": lambda: self.window(fps),
            "gaussian": lambda: math.ceil(4 * self.sigma(fps)),
            "none": lambda: 0,
        }
        return max(_SHORTEST, lengths[self.kind]())

    def too_slow(self, fps: float) -> bool:
        """Whether a frame rate is too low for the cut-off."""
        return DYNAMICS.cutoff_share * fps < self.cutoff_hz

    def acts(self, count: int, fps: float) -> bool:
        """Whether signals of `count` frames are filtered."""
        return self.kind != "none" and not self.too_slow(fps) and count >= self.shortest(fps)


def smooth(values: np.ndarray, fps: float, low_pass: LowPass | None = None) -> np.ndarray:
    """Smooths evenly sampled signals (T, n) float64 without lag.

    Args:
        values: (T, n) float64.
        low_pass: the filter; None: the usual one. Signals on which it does not act, short ones or
            of low frame rates, are returned unchanged.
    """
    low_pass = low_pass or LowPass()
    if not low_pass.acts(len(values), fps):
        return values
    # Imported here, since that takes a second, and only finished motions are smoothed.
    from scipy.ndimage import gaussian_filter1d
    from scipy.signal import butter, savgol_filter, sosfiltfilt

    if low_pass.kind == "butterworth":
        sections = butter(low_pass.usual_order, low_pass.cutoff_hz, fs=fps, output="sos")
        return sosfiltfilt(sections, values, axis=0)
    if low_pass.kind == "savgol":
        order = low_pass.usual_order or 0
        return np.asarray(savgol_filter(values, low_pass.window(fps), order, axis=0))
    sigma = low_pass.sigma(fps)
    margin = math.ceil(4 * sigma)
    # Continued beyond its ends point-symmetrically, as the Butterworth filter's input is.
    padded = np.pad(values, ((margin, margin), (0, 0)), mode="reflect", reflect_type="odd")
    return gaussian_filter1d(padded, sigma, axis=0)[margin:-margin]


def continuous_quaternions(quaternions: np.ndarray) -> np.ndarray:
    """Quaternions (T, ..., 4) with the signs that make each nearest to its predecessor."""
    signs = np.cumprod(
        np.where((quaternions[1:] * quaternions[:-1]).sum(-1) < 0, -1.0, 1.0), axis=0
    )
    return np.concatenate([quaternions[:1], quaternions[1:] * signs[..., None]])


def smooth_quaternions(
    quaternions: np.ndarray, fps: float, low_pass: LowPass | None = None
) -> np.ndarray:
    """Smooths rotations (T, 4), unit quaternions w, x, y, z, like `smooth`."""
    smoothed = smooth(continuous_quaternions(quaternions), fps, low_pass)
    return smoothed / np.linalg.norm(smoothed, axis=1, keepdims=True)


def runs_of(frames: np.ndarray) -> list[np.ndarray]:
    """Rows (n,) int64 of every run of consecutive frame numbers (T,), in order."""
    return np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames) > 1) + 1)


def smooth_runs(
    root_m: np.ndarray,
    root_quaternion: np.ndarray,
    angles_rad: np.ndarray,
    frames: np.ndarray,
    fps: float,
    low_pass: LowPass | None = None,
) -> None:
    """Smooths poses in place, each run of consecutive frames on its own.

    Args:
        root_m: (T, 3) float64.
        root_quaternion: (T, 4) float64.
        angles_rad: (T, D) float64, components of the joints' rotation vectors.
        frames: (T,) int64, increasing frame numbers; a run ends where one is missing.
        low_pass: the filter; None: the usual one.
    """
    low_pass = low_pass or LowPass()
    for run in runs_of(frames) if low_pass.kind != "none" else ():
        root_m[run] = smooth(root_m[run], fps, low_pass)
        angles_rad[run] = smooth(angles_rad[run], fps, low_pass)
        root_quaternion[run] = smooth_quaternions(root_quaternion[run], fps, low_pass)
