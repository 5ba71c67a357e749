"""Diagnosis and repair of cameras that do not agree with the others.

Each hypothesis about a camera's pose, image and clock is fitted to the outlines; the simplest one
that restores agreement is reported, with the size of the change.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from calib.agreement import (
    OUTLINES_PX,
    ROUNDING_PX,
    Agreement,
    agreement,
    image_scale,
    trimmed_mean,
)
from calib.camera import Camera, FloatArray, Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.rotation import matrix_from_rodrigues
from calib.tangency import OutlineTrack, offset_grid, tangency
from calib.tuning import AGREEMENT, SIGNALS

Kind = Literal[
    "swapped", "out of step", "turned", "moved", "scaled", "moved and out of step", "unexplained"
]


@dataclass(frozen=True, eq=False)
class Repair:
    """Explanation of a camera's disagreement, and its correction."""

    camera: str
    kind: Kind
    summary: str  #: Description of the change, one sentence.
    after_px: float  #: Error of the camera against the others after correction.
    after: Camera
    offset_s: float = 0.0
    """Clock offset: its frame of time t shows what the others showed at t - offset."""
    turned_deg: float = 0.0  #: Angle of its rotation.
    with_camera: str | None = None  #: The camera with which it is swapped, or None.

    def rig(self, rig: Rig) -> Rig:
        """The rig with the camera corrected."""
        return Rig(tuple(self.after if camera.name == self.camera else camera for camera in rig))


@dataclass(frozen=True, eq=False)
class SuspectCamera:
    """A camera that does not agree, and the data against which hypotheses are tested."""

    track: OutlineTrack
    others: tuple[OutlineTrack, ...]  #: Outlines of the cameras that agree.
    moments_s: FloatArray  #: (M,) float64, s, times of comparison.
    others_px: float  #: Error of the others among themselves.
    max_offset_s: float  #: Largest clock offset tried, in both directions.

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
            track = self.track.frames_around(self.moments_s + offset_s)
            track.with_camera(track.camera)  # computes its cached corners
            self.__dict__.update(_offset_s=offset_s, _near=track)
        return self.__dict__["_near"]

    def error(self, camera: Camera, offset_s: float = 0.0) -> float:
        """Error of the camera, px; infinite if too few planes can be compared."""
        errors = self.residuals(camera, offset_s)
        return (
            trimmed_mean(errors)
            if np.isfinite(errors).sum() > SIGNALS.overlap * self.known
            else np.inf
        )

    @property
    def level_px(self) -> float:
        """Attainable error, px: that of the others, but not below that of good silhouettes."""
        return max(self.others_px, ROUNDING_PX * self.scale)

    @property
    def scale(self) -> float:
        """See `image_scale`."""
        return image_scale([self.track])

    @property
    def timed(self) -> bool:
        """Whether the frames between the moments are known, so that offsets can be tried."""
        return len(self.track.time_s) > len(self.moments_s)

    @cached_property
    def known(self) -> int:
        """Number of planes that can be compared with the given calibration."""
        return int(np.isfinite(self.residuals(self.track.camera)).sum())


def explain(
    tracks: Mapping[str, OutlineTrack],
    checked: Agreement,
    moments_s: FloatArray,
    max_offset_s: float,
) -> list[Repair]:
    """Explains the disagreement of the culprits of an agreement check.

    Args:
        tracks: Outlines by camera; those of a culprit at many frames around the moments, if offsets
            are to be estimated.
        checked: Result of `agreement`. Without culprits, only swapped cameras are tested.
        moments_s: (M,) float64, s, times of comparison.
        max_offset_s: Largest clock offset tried, in both directions.

    Returns:
        One explanation per culprit (one for two swapped cameras), of kind "unexplained" if none
        restores agreement.
    """
    swap = _swapped(tracks, checked, moments_s)
    if swap is not None:
        return [swap]
    others = tuple(track for name, track in tracks.items() if name not in checked.culprits)
    lines = {line.camera: line for line in checked.table}
    return [
        _explain_one(
            SuspectCamera(tracks[name], others, moments_s, lines[name].others_px, max_offset_s)
        )
        for name in checked.culprits
    ]


def _explain_one(suspect: SuspectCamera) -> Repair:
    """Explanation of one culprit."""
    camera = suspect.track.camera
    before = suspect.error(camera)
    helps_px = before / AGREEMENT.explained_gain
    repairs = []
    for repair in _repairs(suspect):
        # A moved, a turned and a scaled camera look similar; one that is out of step does not.
        late = repair.kind == "out of step"
        gain = AGREEMENT.alike_gain if late else AGREEMENT.perfect_gain
        if repair.after_px <= min(gain * suspect.level_px, helps_px):
            return repair
        repairs.append(repair)
    best = min(repair.after_px for repair in repairs)
    explained_px = max(AGREEMENT.explained_gain * suspect.others_px, OUTLINES_PX * suspect.scale)
    for repair in repairs:
        if repair.after_px <= min(AGREEMENT.alike_gain * best, explained_px, helps_px):
            return repair
    summary = (
        f"{camera.name} does not fit, and no single change of its place, its picture's scale or its"
        " time explains it: look at its silhouettes for shadows, lost limbs and a wrong background"
        " first"
    )
    return Repair(camera.name, "unexplained", summary, before, camera)


def _repairs(suspect: SuspectCamera) -> Iterator[Repair]:
    """Yields a fit of each kind of change, the simpler ones first."""
    camera = suspect.track.camera
    if suspect.timed:
        offset_s = best_offset(suspect, camera)
        summary = f"{camera.name} is out of step: {_delay(suspect, offset_s)}"
        yield _repair(suspect, "out of step", summary, camera, offset_s)
    turn = solve(suspect, moved_camera, np.zeros(3))
    yield _changed_pose(suspect, "turned", moved_camera(camera, turn))
    scaled = _scaled(suspect)
    if scaled is not None:
        yield scaled
    starts = np.concatenate([turn, np.zeros(3)]), np.zeros(6)
    fits = [moved_camera(camera, solve(suspect, moved_camera, start)) for start in starts]
    yield _changed_pose(suspect, "moved", min(fits, key=suspect.error))
    if suspect.timed:
        yield _moved_late(suspect)


def _moved_late(suspect: SuspectCamera) -> Repair:
    """Fits a pose and a clock offset: a pose for each offset of a grid, then both alternately."""
    camera = suspect.track.camera
    best = np.inf, 0.0, camera
    for offset_s in offset_grid(suspect.max_offset_s, suspect.track.period_s):
        after = moved_camera(camera, solve(suspect, moved_camera, np.zeros(3), offset_s, rounds=6))
        error = suspect.error(after, offset_s)
        if error < best[0]:
            best = error, offset_s, after
    _, offset_s, after = best
    offset_s = best_offset(suspect, after) or offset_s
    after = moved_camera(camera, solve(suspect, moved_camera, np.zeros(6), offset_s))
    offset_s = best_offset(suspect, after) or offset_s
    return _changed_pose(suspect, "moved and out of step", after, offset_s)


def _scaled(suspect: SuspectCamera) -> Repair | None:
    """Fits a scaling and a shift of the image (letterboxed, cropped or stretched).

    A moved camera looks much like one whose image is shifted and a little larger, so only two cases
    are accepted: different scales of width and height, or a scaling about the image's middle.
    """
    camera = suspect.track.camera
    after = stretched_camera(camera, solve(suspect, stretched_camera, np.zeros(4)))
    scale_x, scale_y = np.diag(after.matrix)[:2] / np.diag(camera.matrix)[:2]
    middle = (np.array(camera.size) - 1) / 2
    shift = after.matrix[:2, 2] - (
        np.array([scale_x, scale_y]) * (camera.matrix[:2, 2] - middle) + middle
    )
    least = AGREEMENT.stretched
    # Less than half of what the least scaling moves an edge of the image.
    centred = np.abs(shift).max() < least / 4 * max(camera.size)
    if abs(np.log(scale_x / scale_y)) < least and not (centred and abs(np.log(scale_x)) > least):
        return None
    about = f", and shifted by {shift[0]:.0f}, {shift[1]:.0f} px" if not centred else ""
    summary = (
        f"{camera.name}'s picture is not as it was calibrated: {scale_x:.3f} of the width and"
        f" {scale_y:.3f} of the height{about}, a field of view of {after.view_deg:.0f} degrees, not"
        f" {camera.view_deg:.0f} (another mode of its lens, black bars, a crop or a stretch)"
    )
    return _repair(suspect, "scaled", summary, after)


def _swapped(
    tracks: Mapping[str, OutlineTrack], checked: Agreement, moments_s: FloatArray
) -> Repair | None:
    """Tests the exchange of every two cameras' videos; None if that does not help."""
    best: Repair | None = None
    for first, second in combinations(tracks, 2):
        # Both of two swapped cameras differ from the rest, but one of four may agree by chance.
        if tracks[first].camera.size != tracks[second].camera.size or not set(checked.culprits) <= {
            first,
            second,
        }:
            continue
        exchanged = dict(tracks)
        exchanged[first] = tracks[second].with_camera(tracks[first].camera)
        exchanged[second] = tracks[first].with_camera(tracks[second].camera)
        try:
            after = agreement(list(exchanged.values()), moments_s)
        except InputError:
            continue
        if (
            after.agrees
            and after.error_px < checked.error_px / AGREEMENT.explained_gain
            and (best is None or after.error_px < best.after_px)
        ):
            summary = f"the videos of {first} and {second} are swapped"
            camera = tracks[first].camera
            best = Repair(first, "swapped", summary, after.error_px, camera, with_camera=second)
    return best


def _changed_pose(
    suspect: SuspectCamera, kind: Kind, after: Camera, offset_s: float = 0.0
) -> Repair:
    """Repair of a changed pose."""
    name = suspect.track.camera.name
    millimetres, degrees = pose_difference(after, suspect.track.camera)
    if kind == "turned":
        summary = f"{name} was turned by about {degrees:.1f} degrees after calibration"
    else:
        summary = (
            f"{name} was moved after calibration: by about {millimetres:.0f} mm, and turned by"
            f" {degrees:.1f} degrees"
        )
    if offset_s:
        summary = f"{summary}; and {_delay(suspect, offset_s)}"
    return _repair(suspect, kind, summary, after, offset_s)


def _repair(
    suspect: SuspectCamera, kind: Kind, summary: str, after: Camera, offset_s: float = 0.0
) -> Repair:
    camera = suspect.track.camera
    after_px, turned_deg = suspect.error(after, offset_s), pose_difference(after, camera)[1]
    return Repair(camera.name, kind, summary, after_px, after, offset_s, turned_deg)


def _delay(suspect: SuspectCamera, offset_s: float) -> str:
    """Description of a clock offset."""
    frames, milliseconds = abs(offset_s) / suspect.track.period_s, 1000 * abs(offset_s)
    direction = "late" if offset_s > 0 else "early"
    return f"its pictures come {frames:.1f} frames ({milliseconds:.0f} ms) {direction}"


def best_offset(suspect: SuspectCamera, camera: Camera) -> float:
    """Clock offset, s, of the smallest error."""
    offsets = offset_grid(suspect.max_offset_s, AGREEMENT.step_frames * suspect.track.period_s)
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
    return camera.turned(turn, shift)


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
    # A plane that is lost costs as much as at first, so that losing all is not best.
    lost = np.nan_to_num(suspect.residuals(camera, offset_s))

    def cost(x: FloatArray) -> FloatArray:
        residuals = suspect.residuals(model(camera, x), offset_s)
        return np.where(np.isfinite(residuals), residuals, lost) / unit

    soft = max(OUTLINES_PX, suspect.others_px / unit)
    solution = least_squares(
        cost, start, loss="soft_l1", f_scale=soft, diff_step=1e-4, x_scale=unit, max_nfev=rounds
    )
    return np.asarray(solution.x)
