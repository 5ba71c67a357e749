"""OpenCV's lens models, between normalised coordinates (x / z, y / z) and distorted ones.

A distortion polynomial is only valid up to the radius at which it folds back on itself; beyond it,
two directions would share one pixel. Both classes compute that radius once and return NaN outside.
"""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from calib.checks import FloatArray

_NEWTON_STEPS = 20
_WIDEST = 100  # tangent of 89.4 degrees: a flat image ends somewhere


def _first_positive_root(coefficients: ArrayLike) -> float:
    """Smallest positive real root, or infinity, of a polynomial: lowest order first, not zero."""
    # In 1 / s the constant leads, so that a tiny highest coefficient gives a root near zero and not
    # an overflow.
    inverse = np.roots(np.asarray(coefficients, dtype=np.float64))
    real = inverse[
        (np.abs(inverse.imag) < 1e-9 * np.maximum(1, np.abs(inverse.real))) & (inverse.real > 1e-12)
    ].real
    return float(1 / real.max()) if real.size else np.inf


class RationalLens:
    """OpenCV's rational, tangential, thin-prism and tilted model.

    Args:
        coefficients: (n,) float64, k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty; missing ones are 0.

    Source: OpenCV, "Camera Calibration and 3D Reconstruction", detailed description.
    """

    def __init__(self, coefficients: FloatArray) -> None:
        full = np.zeros(14)
        full[: len(coefficients)] = coefficients
        k1, k2, self._p1, self._p2, k3, k4, k5, k6 = full[:8]
        self._above = np.array([1, k1, k2, k3])  # polynomials in r^2
        self._below = np.array([1, k4, k5, k6])
        self._prism = full[8:12]
        self._tilt = _tilt_matrix(full[12], full[13]) if full[12:].any() else None
        self._decentred = bool(full[2:4].any() or full[8:12].any())
        self._identity = not full.any()

    @cached_property
    def field_radius(self) -> float:
        """Radius of the first fold, from the derivative of the polynomial and, with decentring
        terms, from the determinant of the Jacobian.
        """
        above, below = np.polynomial.Polynomial(self._above), np.polynomial.Polynomial(self._below)
        s = np.polynomial.Polynomial([0, 1])
        # d/dr of r A(r^2) / B(r^2), times B^2.
        slope = above * below + 2 * s * (above.deriv() * below - above * below.deriv())
        radius = float(
            np.sqrt(min(_first_positive_root(slope.coef), _first_positive_root(below.coef)))
        )
        if not self._decentred:
            return radius
        radii = np.geomspace(1e-3, min(radius, _WIDEST), 400)
        angle = np.linspace(0, 2 * np.pi, 72, endpoint=False)
        x, y = np.outer(radii, np.cos(angle)), np.outer(radii, np.sin(angle))
        _, jacobian = self._distort(np.column_stack([x.ravel(), y.ravel()]), jacobian=True)
        with np.errstate(invalid="ignore"):
            determinant = jacobian[:, 0] * jacobian[:, 3] - jacobian[:, 1] * jacobian[:, 2]
        folded = ~(determinant.reshape(x.shape) > 0).all(axis=1)
        return float(radii[max(0, int(np.argmax(folded)) - 1)]) if folded.any() else radius

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Radii and their radially distorted values, as initial values of the inverse."""
        radii = np.linspace(0, min(self.field_radius, _WIDEST), 4096)
        squared = radii**2
        ratio = np.polynomial.polynomial.polyval(
            squared, self._above
        ) / np.polynomial.polynomial.polyval(squared, self._below)
        return radii, radii * ratio

    def distort(self, normalised: FloatArray) -> FloatArray:
        """Distorted coordinates (N, 2) of normalised ones (N, 2); NaN outside the field."""
        if self._identity:
            return normalised
        distorted = self.distort_unbounded(normalised)
        distorted[np.einsum("ni,ni->n", normalised, normalised) > self.field_radius**2] = np.nan
        return distorted

    def distort_unbounded(self, normalised: FloatArray) -> FloatArray:
        """As `distort`, without the check of the field: for solvers, whose steps may leave it."""
        distorted, _ = self._distort(normalised)
        return distorted if self._tilt is None else _apply_homography(self._tilt, distorted)

    def undistort(self, distorted: FloatArray) -> FloatArray:
        """Normalised coordinates (N, 2) of distorted ones (N, 2).

        Newton's method; the initial values come from the radial terms alone.
        """
        if self._identity:
            return distorted
        if self._tilt is not None:
            distorted = _apply_homography(np.linalg.inv(self._tilt), distorted)
        radii, radii_distorted = self._table
        radius_distorted = np.linalg.norm(distorted, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            estimate = (
                distorted
                * np.where(
                    radius_distorted > 0,
                    np.interp(radius_distorted, radii_distorted, radii) / radius_distorted,
                    1.0,
                )[:, None]
            )
        rows = np.arange(len(distorted))
        for _ in range(_NEWTON_STEPS):
            step = self._newton_step(estimate[rows], distorted[rows])
            estimate[rows] -= step
            rows = rows[np.abs(step).max(axis=1, initial=0.0) > 1e-12]
            if not len(rows):
                break
        distorted_again, _ = self._distort(estimate)
        wrong = ~(
            np.linalg.norm(distorted_again - distorted, axis=1) < 1e-8 * (1 + radius_distorted)
        )
        wrong |= np.linalg.norm(estimate, axis=1) > self.field_radius * (1 + 1e-9)
        estimate[wrong] = np.nan
        return estimate

    @np.errstate(invalid="ignore", over="ignore", divide="ignore")
    def _newton_step(self, estimate: FloatArray, distorted: FloatArray) -> FloatArray:
        """Step (N, 2) of Newton's method to be subtracted, at most a fifth of the radius."""
        distorted_again, jacobian = self._distort(estimate, jacobian=True)
        error = distorted_again - distorted
        a, b, c, d = jacobian.T
        step = (
            np.column_stack([d * error[:, 0] - b * error[:, 1], a * error[:, 1] - c * error[:, 0]])
            / (a * d - b * c)[:, None]
        )
        # Near the fold the slope vanishes, and a whole step would leave the field.
        limit = 0.2 * np.maximum(np.linalg.norm(estimate, axis=1), 0.05)
        return (
            step * np.minimum(1, limit / np.maximum(np.linalg.norm(step, axis=1), 1e-300))[:, None]
        )

    # Far outside the field numbers may overflow; callers check for finite ones.
    @np.errstate(invalid="ignore", over="ignore", divide="ignore")
    def _distort(
        self, normalised: FloatArray, jacobian: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Applies all terms but the tilt.

        Returns:
            Distorted coordinates (N, 2), and if requested their Jacobian (N, 4) as xx, xy, yx, yy
            (else empty).
        """
        x, y = normalised[:, 0], normalised[:, 1]
        s = x * x + y * y
        (_, k1, k2, k3), (_, k4, k5, k6) = self._above, self._below
        s1, s2, s3, s4 = self._prism
        p1, p2 = self._p1, self._p2
        below = 1 + s * (k4 + s * (k5 + s * k6))
        ratio = (1 + s * (k1 + s * (k2 + s * k3))) / below
        distorted = np.empty_like(normalised)
        distorted[:, 0] = x * ratio
        distorted[:, 1] = y * ratio
        if self._decentred:
            distorted[:, 0] += 2 * p1 * x * y + p2 * (s + 2 * x * x) + s * (s1 + s * s2)
            distorted[:, 1] += p1 * (s + 2 * y * y) + 2 * p2 * x * y + s * (s3 + s * s4)
        if not jacobian:
            return distorted, np.empty((0, 4))
        # d ratio / d s, then ds/dx = 2x.
        slope = (k1 + s * (2 * k2 + 3 * s * k3) - ratio * (k4 + s * (2 * k5 + 3 * s * k6))) / below
        prism_x, prism_y = s1 + 2 * s * s2, s3 + 2 * s * s4
        table = np.empty((len(s), 4))
        table[:, 0] = ratio + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x + 2 * x * prism_x
        table[:, 1] = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * y * prism_x
        table[:, 2] = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y + 2 * x * prism_y
        table[:, 3] = ratio + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x + 2 * y * prism_y
        return distorted, table


class FisheyeLens:
    """OpenCV's fisheye model: the radius is a polynomial of the angle from the optical axis.

    Only directions in front of the camera (less than 90 degrees from the axis) are covered, as in
    OpenCV.

    Source: OpenCV, "Fisheye camera model" (Kannala and Brandt's polynomial with the leading term
    1).
    """

    def __init__(self, coefficients: FloatArray) -> None:
        """Stores the series theta_d = theta (1 + k1 theta^2 + ... + k4 theta^8)."""
        self._series = np.concatenate([[1.0], coefficients])

    @cached_property
    def _angle_limit(self) -> float:
        """Angle, rad, at which the polynomial folds back, at most 90 degrees."""
        slope = self._series * (2 * np.arange(5) + 1)
        return float(min(np.sqrt(_first_positive_root(slope)), np.pi / 2))

    @cached_property
    def _table(self) -> tuple[FloatArray, FloatArray]:
        """Angles and distorted radii."""
        angles = np.linspace(0, self._angle_limit, 4096)
        return angles, self._radius(angles)

    @property
    def field_radius(self) -> float:
        """Tangent of the angle of the first fold."""
        return np.inf if self._angle_limit >= np.pi / 2 else float(np.tan(self._angle_limit))

    def _radius(self, angle: FloatArray) -> FloatArray:
        """Distorted radius theta_d of an angle theta."""
        return angle * np.polynomial.polynomial.polyval(angle * angle, self._series)

    def distort(self, normalised: FloatArray) -> FloatArray:
        """Distorted coordinates (N, 2) of normalised ones (N, 2); NaN outside the field."""
        distorted = self.distort_unbounded(normalised)
        distorted[~(np.arctan(np.linalg.norm(normalised, axis=1)) <= self._angle_limit)] = np.nan
        return distorted

    def distort_unbounded(self, normalised: FloatArray) -> FloatArray:
        """As `distort`, without the check of the field: for solvers, whose steps may leave it."""
        radius = np.linalg.norm(normalised, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(radius > 0, self._radius(np.arctan(radius)) / radius, 1.0)
        return normalised * ratio[:, None]

    def undistort(self, distorted: FloatArray) -> FloatArray:
        """Normalised coordinates (N, 2) of distorted ones, by Newton's method on the angle."""
        radius = np.linalg.norm(distorted, axis=1)
        angles, radii = self._table
        angle = np.interp(radius, radii, angles)
        powers = self._series * (2 * np.arange(5) + 1)
        for _ in range(_NEWTON_STEPS):
            slope = np.polynomial.polynomial.polyval(angle * angle, powers)
            step = (self._radius(angle) - radius) / np.where(slope > 1e-9, slope, 1e-9)
            angle = np.clip(angle - step, 0, self._angle_limit)
            if not np.nanmax(np.abs(step), initial=0.0) > 1e-12:
                break
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = np.where(radius > 0, np.tan(angle) / radius, 1.0)
        normalised = distorted * ratio[:, None]
        normalised[~(radius <= radii[-1] * (1 + 1e-12)) | ~(angle < np.pi / 2)] = np.nan
        return normalised


def _tilt_matrix(tau_x: float, tau_y: float) -> FloatArray:
    """Homography (3, 3) of a sensor tilted by tau_x, tau_y, rad.

    Source: OpenCV, as above.
    """
    rotation = Rotation.from_euler("xy", [-tau_x, -tau_y]).as_matrix()
    onto_plane = np.array(
        [[rotation[2, 2], 0, -rotation[0, 2]], [0, rotation[2, 2], -rotation[1, 2]], [0, 0, 1]]
    )
    return onto_plane @ rotation


def _apply_homography(homography: NDArray[np.floating], points: FloatArray) -> FloatArray:
    """Applies a homography (3, 3) to points (N, 2); NaN where the third coordinate is negative."""
    mapped = points @ homography[:, :2].T + homography[:, 2]
    mapped[~(mapped[:, 2] > 0)] = np.nan
    return mapped[:, :2] / mapped[:, 2:]
