"""How the whole body is headed, decided over time.

Seen from the front and from behind, silhouettes are nearly alike; the frames that tell decide for
the others, by a hidden Markov model whose states are headings. Beyond paper A.
"""

import numpy as np
from numpy.typing import NDArray

from calib.checks import FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES, SIDES
from silhouette_core.monocular.tuning import HEADING
from silhouette_core.motion.dynamics import FPS, ROOT_STEP_RAD

_HEADINGS = 72
_STATES_RAD = np.arange(_HEADINGS) * 2 * np.pi / _HEADINGS
_LEFT, _RIGHT = (
    [LANDMARK_NAMES.index(f"{side}_{name}") for name in ("hip", "shoulder")] for side in SIDES
)


def body_headings(joints: FloatArray) -> FloatArray:
    """Headings (…,), rad, of the axis from right to left hip and shoulder, of joints (…, 15, 3)."""
    across = (joints[..., _LEFT, :] - joints[..., _RIGHT, :]).sum(axis=-2)
    return np.arctan2(across[..., 1], across[..., 0])


def smooth_headings(
    heading_rad: FloatArray,
    probability: FloatArray,
    time_s: FloatArray,
    first_rad: float | None = None,
) -> FloatArray:
    r"""Probabilities of modes, given the headings of all frames.

    The heading :math:`\phi_t` is the state of a hidden Markov model on a circle of 72 states, that
    turns by a normally distributed angle from frame to frame; it is observed through the mixture

    .. math:: p(z_t|\phi_t) \propto \Bigl(\sum_m \pi_{tm}\, N(\phi_t;\, \phi_{tm}, \sigma^2)\Bigr)^a

    Args:
        heading_rad: (T, M), headings of the modes, :math:`\phi_{tm}`.
        probability: (T, M), :math:`\pi_{tm}`.
        time_s: (T,), increasing.
        first_rad: heading expected in the first frame, loosely; None: any.

    Returns:
        (T, M), :math:`\pi_{tm}` times the smoothed probability of the mode's heading, normalised.

    Source: the forward-backward algorithm, textbook.
    """
    kernel, seen = _observed(heading_rad, probability)
    causal, backward = HeadingFilter(), np.ones_like(seen)
    forward = [causal.step(*frame, first_rad) for frame in zip(seen, time_s, strict=True)]
    for t in range(len(seen) - 2, -1, -1):
        turning = _turning(time_s[t + 1] - time_s[t])
        backward[t] = _convolved(backward[t + 1] * seen[t + 1], turning)
        backward[t] /= backward[t].sum()
    return _weighed(probability, kernel, np.array(forward) * backward)


class HeadingFilter:
    """The forward pass of `smooth_headings`, frame by frame."""

    def __init__(self) -> None:
        self._density: FloatArray | None = None
        self._time_s = 0.0

    def update(
        self,
        heading_rad: FloatArray,
        probability: FloatArray,
        time_s: float,
        first_rad: float | None = None,
    ) -> FloatArray:
        """Probabilities (M,) of the modes of the next frame, given the headings of all so far.

        Args:
            heading_rad: (M,), headings of the modes.
            probability: (M,), of the modes.
            time_s: time of the frame, later than the last one's.
            first_rad: heading expected in the first frame, loosely; None: any.
        """
        kernel, seen = _observed(heading_rad, probability)
        return _weighed(probability, kernel, self.step(seen, time_s, first_rad))

    def step(self, seen: FloatArray, time_s: float, first_rad: float | None) -> FloatArray:
        """Density (72,) of the heading from the likelihood (72,) of the next frame."""
        if self._density is not None:
            seen = seen * _convolved(self._density, _turning(time_s - self._time_s))
        elif first_rad is not None:
            seen = seen * np.exp(HEADING.expected * (np.cos(_STATES_RAD - first_rad) - 1))
        density = seen / seen.sum()
        self._density, self._time_s = density, time_s
        return density


def _observed(heading_rad: FloatArray, probability: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Density (…, M, 72) of headings about the modes (…, M), and likelihood (…, 72) of each."""
    apart = np.abs((_STATES_RAD - heading_rad[..., None] + np.pi) % (2 * np.pi) - np.pi)
    kernel = np.exp(-0.5 * (apart / np.radians(HEADING.sigma_deg)) ** 2)
    kernel /= kernel.sum(axis=-1, keepdims=True)
    seen = np.einsum("...m,...ms->...s", probability, kernel)
    return kernel, seen**HEADING.independence


def _turning(interval_s: float) -> NDArray[np.complexfloating]:
    """Spectrum of the density of the turn within an interval."""
    turn, steps = (_STATES_RAD + np.pi) % (2 * np.pi) - np.pi, max(interval_s * FPS, 0.1)
    moved = np.exp(-0.5 * (turn / ROOT_STEP_RAD) ** 2 / steps)
    return np.fft.rfft(moved / moved.sum())


def _weighed(probability: FloatArray, kernel: FloatArray, density: FloatArray) -> FloatArray:
    """Probabilities (…, M) of modes, times the density (…, 72) of their headings."""
    density = density / density.sum(axis=-1, keepdims=True)
    weighted = probability * np.einsum("...s,...ms->...m", density, kernel)
    return weighted / weighted.sum(axis=-1, keepdims=True)


def _convolved(density: FloatArray, spectrum: NDArray[np.complexfloating]) -> FloatArray:
    return np.maximum(np.fft.irfft(np.fft.rfft(density) * spectrum, _HEADINGS), 1e-300)
