"""Diagnosis and repair of cameras that do not agree with the others.

Each hypothesis is fitted to the outlines; the simplest one that restores agreement is reported,
with the size of the change.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np

from calib.agreement import Agreement, agreement
from calib.camera import Camera, FloatArray, Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.suspect import SuspectCamera, best_offset, moved_camera, solve, stretched_camera
from calib.tangency import OutlineTrack, offset_grid
from calib.tuning import AGREEMENT

Kind = Literal[
    "swapped", "out of step", "turned", "moved", "scaled", "moved and out of step", "unexplained"
]


@dataclass(frozen=True, eq=False)
class Repair:
    """Explanation of a camera's disagreement, and its correction.

    Attributes:
        summary: Description of the change, one sentence.
        before_px: Error of the camera against the others as given.
        after_px: Error after correction.
        others_px: Error of the others among themselves, which is attainable.
        offset_s: Clock offset: its frame of time t shows what the others showed at t - offset.
        turned_deg: Angle of its rotation.
        with_camera: The camera with which it is swapped, or None.
    """

    camera: str
    kind: Kind
    summary: str
    before_px: float
    after_px: float
    others_px: float
    after: Camera
    offset_s: float = 0.0
    turned_deg: float = 0.0
    with_camera: str | None = None

    def rig(self, rig: Rig) -> Rig:
        """The rig with the camera corrected."""
        return Rig(tuple(self.after if camera.name == self.camera else camera for camera in rig))


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
            SuspectCamera(tracks[name], others, moments_s, lines[name].others_px), max_offset_s
        )
        for name in checked.culprits
    ]


def _explain_one(suspect: SuspectCamera, max_offset_s: float) -> Repair:
    """Explanation of one culprit."""
    camera = suspect.track.camera
    before = suspect.error(camera)
    helps_px = AGREEMENT.helping_share * before
    repairs = []
    for kind in ("out of step", "turned", "scaled", "moved", "moved and out of step"):
        repair = _FITS[kind](suspect, max_offset_s)
        if repair is not None:
            repairs.append(repair)
        # A moved, a turned and a scaled camera look similar; one that is out of step does not.
        near = AGREEMENT.late_enough_gain if kind == "out of step" else AGREEMENT.perfect_gain
        if repairs and repairs[-1].after_px <= min(near * suspect.level_px, helps_px):
            return repairs[-1]
    best = min((repair.after_px for repair in repairs), default=np.inf)
    explained_px = max(
        AGREEMENT.explained_gain * suspect.others_px, AGREEMENT.good_px * suspect.scale
    )
    for repair in repairs:
        if repair.after_px <= min(AGREEMENT.simpler_gain * best, explained_px, helps_px):
            return repair
    summary = (
        f"{camera.name} does not fit, and no single change of its place, its picture's scale or its"
        " time explains it: look at its silhouettes for shadows, lost limbs and a wrong background"
        " first"
    )
    return Repair(camera.name, "unexplained", summary, before, before, suspect.others_px, camera)


def _out_of_step(suspect: SuspectCamera, max_offset_s: float) -> Repair | None:
    """Fits a clock offset."""
    camera = suspect.track.camera
    offset_s = best_offset(suspect, camera, max_offset_s)
    if offset_s is None:
        return None
    summary = f"{camera.name} is out of step: {_delay(suspect, offset_s)}"
    return _repair(suspect, "out of step", summary, camera, offset_s)


def _turned(suspect: SuspectCamera, max_offset_s: float) -> Repair:
    """Fits a rotation about the camera's centre."""
    after = moved_camera(suspect.track.camera, solve(suspect, moved_camera, np.zeros(3)))
    return _changed_pose(suspect, "turned", after)


def _moved(suspect: SuspectCamera, max_offset_s: float) -> Repair:
    """Fits a pose."""
    start = np.concatenate([solve(suspect, moved_camera, np.zeros(3)), np.zeros(3)])
    starts = (start, np.zeros(6))
    camera = suspect.track.camera
    fits = [moved_camera(camera, solve(suspect, moved_camera, initial)) for initial in starts]
    return _changed_pose(suspect, "moved", min(fits, key=suspect.error))


def _moved_late(suspect: SuspectCamera, max_offset_s: float) -> Repair | None:
    """Fits a pose and a clock offset: a pose for each offset of a grid, then both alternately."""
    camera = suspect.track.camera
    best = np.inf, 0.0, camera
    offsets = offset_grid(max_offset_s, suspect.track.period_s)
    if len(suspect.track.time_s) <= len(suspect.moments_s):
        return None
    for offset_s in offsets:
        after = moved_camera(camera, solve(suspect, moved_camera, np.zeros(3), offset_s, rounds=6))
        error = suspect.error(after, offset_s)
        if error < best[0]:
            best = error, offset_s, after
    _, offset_s, after = best
    offset_s = best_offset(suspect, after, max_offset_s) or offset_s
    after = moved_camera(camera, solve(suspect, moved_camera, np.zeros(6), offset_s))
    offset_s = best_offset(suspect, after, max_offset_s) or offset_s
    return _changed_pose(suspect, "moved and out of step", after, offset_s)


def _scaled(suspect: SuspectCamera, max_offset_s: float) -> Repair | None:
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
    centred = np.abs(shift).max() < AGREEMENT.shifted * max(camera.size)
    least = AGREEMENT.stretched
    if abs(np.log(scale_x / scale_y)) < least and not (centred and abs(np.log(scale_x)) > least):
        return None
    about = f", and shifted by {shift[0]:.0f}, {shift[1]:.0f} px" if not centred else ""
    summary = (
        f"{camera.name}'s picture is not as it was calibrated: {scale_x:.3f} of the width and"
        f" {scale_y:.3f} of the height{about}"
    )
    return _repair(suspect, "scaled", f"{summary} (black bars, a crop or a stretch)", after)


_FITS: dict[str, Callable[[SuspectCamera, float], Repair | None]] = {
    "out of step": _out_of_step,
    "turned": _turned,
    "scaled": _scaled,
    "moved": _moved,
    "moved and out of step": _moved_late,
}


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
            and after.error_px < AGREEMENT.helping_share * checked.error_px
            and (best is None or after.error_px < best.after_px)
        ):
            summary = f"the videos of {first} and {second} are swapped"
            errors = checked.error_px, after.error_px, after.error_px
            camera = tracks[first].camera
            best = Repair(first, "swapped", summary, *errors, camera, with_camera=second)
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
    errors = suspect.error(camera), suspect.error(after, offset_s), suspect.others_px
    turned_deg = pose_difference(after, camera)[1]
    return Repair(camera.name, kind, summary, *errors, after, offset_s, turned_deg)


def _delay(suspect: SuspectCamera, offset_s: float) -> str:
    """Description of a clock offset."""
    frames, milliseconds = abs(offset_s) / suspect.track.period_s, 1000 * abs(offset_s)
    direction = "late" if offset_s > 0 else "early"
    return f"its pictures come {frames:.1f} frames ({milliseconds:.0f} ms) {direction}"
