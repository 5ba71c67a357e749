"""A camera that does not agree with the others, and fits of its pose, image and clock."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from calib.agreement import image_scale, trimmed_mean
from calib.camera import Camera, FloatArray
from calib.rotation import matrix_from_rodrigues
from calib.tangency import OutlineTrack, offset_grid, tangency
from calib.tuning import AGREEMENT


@dataclass(frozen=True, eq=False)
class SuspectCamera:
    """A camera that does not agree, and the data against which hypotheses are tested.

    Attributes:
        others: Outlines of the cameras that agree.
        moments_s: (M,) float64, s, times of comparison.
        others_px: Error of the others among themselves.
    """

    track: OutlineTrack
    others: tuple[OutlineTrack, ...]
    moments_s: FloatArray
    others_px: float

    def residuals(self, camera: Camera, offset_s: float = 0.0) -> FloatArray:
        """Signed errors (planes,), px, for hypothetical parameters; NaN where undetermined."""
        track = self._track_at(offset_s).with_camera(camera)
        return np.concatenate(
            [
                tangency(track, other, self.moments_s, (offset_s, 0.0)).ravel()
                for other in self.others
            ]
        )

    def _track_at(self, offset_s: float) -> OutlineTrack:
        """The frames that an offset needs, cached for the last offset."""
        if self.__dict__.get("_offset_s") != offset_s:
            near = self.track.frames_around(self.moments_s + offset_s)
            near.with_camera(near.camera)  # computes its cached corners
            self.__dict__.update(_offset_s=offset_s, _near=near)
        return self.__dict__["_near"]

    def error(self, camera: Camera, offset_s: float = 0.0) -> float:
        """Error of the camera, px; infinite if too few planes can be compared."""
        errors = self.residuals(camera, offset_s)
        return trimmed_mean(errors) if np.isfinite(errors).sum() > 0.3 * self.known else np.inf

    @property
    def level_px(self) -> float:
        """Attainable error, px: that of the others, but not below that of good silhouettes."""
        return max(self.others_px, AGREEMENT.accurate_px * self.scale)

    @property
    def scale(self) -> float:
        """See `image_scale`."""
        return image_scale([self.track])

    @cached_property
    def known(self) -> int:
        """Number of planes that can be compared with the given calibration."""
        return int(np.isfinite(self.residuals(self.track.camera)).sum())


def best_offset(suspect: SuspectCamera, camera: Camera, max_offset_s: float) -> float | None:
    """Clock offset, s, of the smallest error; None if the frames between the moments are unknown.

    Args:
        max_offset_s: Largest offset tried, in both directions.
    """
    if len(suspect.track.time_s) <= len(suspect.moments_s):
        return None
    offsets = offset_grid(max_offset_s, AGREEMENT.suspect_step_frames * suspect.track.period_s)
    errors = np.array([suspect.error(camera, offset_s) for offset_s in offsets])
    best = int(errors.argmin())
    if not 0 < best < len(offsets) - 1 or not np.isfinite(errors[best - 1 : best + 2]).all():
        return float(offsets[best])
    # The errors rise almost linearly on both sides: the minimum is where lines of equal slope meet.
    left, middle, right = errors[best - 1 : best + 2]
    slope = max(left, right) - middle
    fraction = 0.0 if slope <= 0 else float(np.clip((left - right) / (2 * slope), -1, 1))
    return float(offsets[best] + fraction * (offsets[1] - offsets[0]))


def moved_camera(camera: Camera, x: FloatArray) -> Camera:
    """A camera rotated by x[:3] and translated by x[3:], in units of about a pixel in the image, of
    a body at 4 m.
    """
    pixel = 1 / camera.matrix[0, 0]
    turn = matrix_from_rodrigues(x[:3] * pixel)
    shift = x[3:] * pixel * 4 if len(x) == 6 else np.zeros(3)
    return replace(
        camera, rotation=turn @ camera.rotation, translation=turn @ camera.translation + shift
    )


def stretched_camera(camera: Camera, x: FloatArray) -> Camera:
    """A camera with its image scaled about the middle by x[:2] (logarithms) and shifted by x[2:].

    All are in units of about a pixel.
    """
    factors = np.diag([*np.exp(np.clip(x[:2] / max(camera.size) * 4, -2, 2)), 1.0])
    middle = (np.array(camera.size) - 1) / 2
    about = np.array([[1, 0, middle[0]], [0, 1, middle[1]], [0, 0, 1.0]])
    matrix = about @ factors @ np.linalg.inv(about) @ camera.matrix
    matrix[:2, 2] += x[2:]
    matrix[2] = [0, 0, 1]
    return replace(camera, matrix=matrix)


def solve(
    suspect: SuspectCamera,
    model: Callable[[Camera, FloatArray], Camera],
    start: FloatArray,
    offset_s: float = 0.0,
    rounds: int = 40,
) -> FloatArray:
    """Parameters that minimise the tangency errors by least squares with a soft L1 loss."""
    camera = suspect.track.camera
    unit = max(camera.size) / 480
    base = np.isfinite(suspect.residuals(camera, offset_s))

    def cost(x: FloatArray) -> FloatArray:
        residuals = suspect.residuals(model(camera, x), offset_s)
        return (
            np.where(
                np.isfinite(residuals), residuals, np.where(base, AGREEMENT.lost_px * unit, 0.0)
            )
            / unit
        )

    soft = max(AGREEMENT.soft_px, suspect.others_px / unit)
    solution = least_squares(
        cost, start, loss="soft_l1", f_scale=soft, diff_step=1e-4, x_scale=unit, max_nfev=rounds
    )
    return np.asarray(solution.x)
