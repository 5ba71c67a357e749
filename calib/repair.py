"""What happened to a camera that does not agree: swapped, out of step, turned, moved, or its
picture scaled. And the way back.

Each explanation is tried on the outlines themselves; the simplest that brings agreement is told,
with how far the camera is off.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calib.agreement import Agreement, Tolerance, agreement, picture_scale, trimmed
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.extrinsics import apart
from calib.rotation import matrix_from_rodrigues
from calib.tangency import OutlineTrack, tangency

FloatArray = NDArray[np.float64]
Kind = Literal[
    "swapped", "out of step", "turned", "moved", "scaled", "moved and out of step", "unexplained"
]

_SIMPLER = 1.4  # a simpler explanation wins if its error is at most this times the best one's
_HELPS = 0.5  # an explanation has to bring the error below this share
_GOOD, _GOOD_PX = (
    2.0,
    0.4,
)  # and below this many times what the others reach, or this in a picture of 480 x 360
_NEAR, _PERFECT = 1.5, 1.2  # of what the others reach: nothing better is looked for
_STRETCHED = 0.04
_SHIFTED = 0.01  # of the picture's longer side
_LEAST_SOFT_PX = 0.5
_FINE = 0.25  # of a frame: the steps in which offsets are tried


@dataclass(frozen=True, eq=False)
class Repair:
    """An explanation.

    Attributes: camera: Whom it is about. kind: What happened. words: The same in words, with how
        far. before_px: The camera's error against the others as it was given. after_px: The same if
        the explanation is believed. others_px: The others' error among themselves: what can be
        reached. after: The camera as it has to be for that. late_s: By how much its clock is ahead,
        s: its picture of time t shows what the others showed at t - late. moved_mm: How far its
        centre has moved. turned_deg: How far it has turned. with_camera: The camera with which it
        is swapped.
    """

    camera: str
    kind: Kind
    words: str
    before_px: float
    after_px: float
    others_px: float
    after: Camera
    late_s: float = 0.0
    moved_mm: float = 0.0
    turned_deg: float = 0.0
    with_camera: str | None = None

    def rig(self, rig: Rig) -> Rig:
        """Returns a rig with the camera as it has to be."""
        return Rig(tuple(self.after if one.name == self.camera else one for one in rig))


@dataclass(frozen=True, eq=False)
class SuspectCamera:
    """What explanations are judged by.

    Attributes:
        track: The culprit's outlines, at as many frames as are known.
        others: Those of the cameras that are believed.
        moments_s: (M,) float64, s: when to look.
        others_px: Their error among themselves.
    """

    track: OutlineTrack
    others: tuple[OutlineTrack, ...]
    moments_s: FloatArray
    others_px: float

    def residuals(self, camera: Camera, late_s: float = 0.0) -> FloatArray:
        """Returns the signed errors (planes,), px, if the camera were so; NaN where nothing can be
        said.
        """
        track = self._track_at(late_s).with_camera(camera)
        return np.concatenate(
            [tangency(track, other, self.moments_s, (late_s, 0.0)).ravel() for other in self.others]
        )

    def _track_at(self, late_s: float) -> OutlineTrack:
        """The culprit's frames that an offset needs, remembered for the last one."""
        if self.__dict__.get("_late_s") != late_s:
            near = self.track.near(self.moments_s + late_s)
            near.with_camera(near.camera)  # measures its corners
            self.__dict__.update(_late_s=late_s, _near=near)
        return self.__dict__["_near"]

    def error(self, camera: Camera, late_s: float = 0.0) -> float:
        """Returns the camera's error, px; infinite where too little can be compared."""
        found = self.residuals(camera, late_s)
        return trimmed(found) if np.isfinite(found).sum() > 0.3 * self.known else np.inf

    @property
    def level_px(self) -> float:
        """What can be reached: the others' error, at least that of good silhouettes."""
        return max(self.others_px, Tolerance().floor_px * self.scale)

    @property
    def scale(self) -> float:
        """See `picture_scale`."""
        return picture_scale([self.track])

    @cached_property
    def known(self) -> int:
        """How many planes can be compared as things stand."""
        return int(np.isfinite(self.residuals(self.track.camera)).sum())


def explain(
    tracks: Mapping[str, OutlineTrack],
    found: Agreement,
    moments_s: FloatArray,
    most_late_s: float,
    only: Sequence[Kind] | None = None,
) -> list[Repair]:
    """Finds what happened to the culprits of an agreement check.

    Args: tracks: Each camera's outlines; a culprit's at many frames around the moments, where
        offsets are to be found. found: What `agreement` said of them. Without a culprit, only
        swapped cameras are looked for. moments_s: (M,) float64, s: when to look. most_late_s: The
        largest offset that is tried, each way. only: The kinds of explanation to try; None for all.

    Returns: An explanation per culprit (two swapped cameras have one); of kind "unexplained" where
        none brings agreement.
    """
    swap = _swapped(tracks, found, moments_s) if only is None or "swapped" in only else None
    if swap is not None:
        return [swap]
    others = tuple(track for name, track in tracks.items() if name not in found.culprits)
    lines = {line.camera: line for line in found.table}
    return [
        _one(
            SuspectCamera(tracks[name], others, moments_s, lines[name].others_px), most_late_s, only
        )
        for name in found.culprits
    ]


def _one(scene: SuspectCamera, most_late_s: float, only: Sequence[Kind] | None) -> Repair:
    """Explains one culprit."""
    camera = scene.track.camera
    before = scene.error(camera)
    tries = []
    for kind in ("out of step", "turned", "scaled", "moved", "moved and out of step"):
        if only is None or kind in only:
            made = _TRIES[kind](scene, most_late_s)
            if made is not None:
                tries.append(made)
        # Whether a camera was moved or only turned, or its picture scaled, are near each other;
        # whether it is late is not.
        near = _NEAR if kind == "out of step" else _PERFECT
        if tries and tries[-1].after_px <= min(near * scene.level_px, _HELPS * before):
            return tries[-1]
    best = min((one.after_px for one in tries), default=np.inf)
    for one in tries:
        if one.after_px <= min(
            _SIMPLER * best, max(_GOOD * scene.others_px, _GOOD_PX * scene.scale), _HELPS * before
        ):
            return one
    words = (
        f"{camera.name} does not fit, and no single change of its place, its picture's scale or its"
        " time explains it: look at its silhouettes for shadows, lost limbs and a wrong background"
        " first"
    )
    return Repair(camera.name, "unexplained", words, before, before, scene.others_px, camera)


def _out_of_step(scene: SuspectCamera, most_late_s: float) -> Repair | None:
    """Tries the culprit's frames earlier and later."""
    camera = scene.track.camera
    late_s = best_offset(scene, camera, most_late_s)
    if late_s is None:
        return None
    frames = late_s / _period(scene.track)
    words = (
        f"{camera.name} is out of step: its pictures come {_frames(frames)}"
        f" ({abs(late_s) * 1000:.0f} ms) {_late(late_s)}"
    )
    return _repair(scene, "out of step", words, camera, late_s)


def _turned(scene: SuspectCamera, most_late_s: float) -> Repair:
    """Finds by how much the camera was turned where it stands."""
    after = _moved(scene.track.camera, _solve(scene, _moved, np.zeros(3)))
    return _place(scene, "turned", after)


def _moved_too(scene: SuspectCamera, most_late_s: float) -> Repair:
    """Finds where the camera stands now."""
    start = np.concatenate([_solve(scene, _moved, np.zeros(3)), np.zeros(3)])
    starts = (start, np.zeros(6))
    solved = [_moved(scene.track.camera, _solve(scene, _moved, one)) for one in starts]
    return _place(scene, "moved", min(solved, key=scene.error))


def _moved_late(scene: SuspectCamera, most_late_s: float) -> Repair | None:
    """Finds a place and an offset at once: the offset is tried in steps, the place solved for at
    each.
    """
    camera = scene.track.camera
    best = np.inf, 0.0, camera
    offsets = _offsets(scene.track, most_late_s, 1.0)
    if len(scene.track.time_s) <= len(scene.moments_s):
        return None
    for late_s in offsets:
        after = _moved(camera, _solve(scene, _moved, np.zeros(3), late_s, rounds=6))
        error = scene.error(after, late_s)
        if error < best[0]:
            best = error, late_s, after
    _, late_s, after = best
    late_s = best_offset(scene, after, most_late_s) or late_s
    after = _moved(camera, _solve(scene, _moved, np.zeros(6), late_s))
    late_s = best_offset(scene, after, most_late_s) or late_s
    return _place(scene, "moved and out of step", after, late_s)


def _scaled(scene: SuspectCamera, most_late_s: float) -> Repair | None:
    """Finds by how much the camera's picture was scaled and shifted (letterboxed, cropped,
    stretched) since it was calibrated.

    A camera that has moved looks much like one whose picture is shifted and a little larger, so
    only two cases are believed: width and height scaled differently, or scaled about the picture's
    middle.
    """
    camera = scene.track.camera
    after = _stretched(camera, _solve(scene, _stretched, np.zeros(4)))
    wide, high = np.diag(after.matrix)[:2] / np.diag(camera.matrix)[:2]
    middle = (np.array(camera.size) - 1) / 2
    shift = after.matrix[:2, 2] - (
        np.array([wide, high]) * (camera.matrix[:2, 2] - middle) + middle
    )
    middling = np.abs(shift).max() < _SHIFTED * max(camera.size)
    if abs(np.log(wide / high)) < _STRETCHED and not (middling and abs(np.log(wide)) > _STRETCHED):
        return None
    about = f", and shifted by {shift[0]:.0f}, {shift[1]:.0f} px" if not middling else ""
    words = (
        f"{camera.name}'s picture is not as it was calibrated: {wide:.3f} of the width and"
        f" {high:.3f} of the height{about}"
    )
    return _repair(scene, "scaled", f"{words} (black bars, a crop or a stretch)", after)


_TRIES: dict[str, Callable[[SuspectCamera, float], Repair | None]] = {
    "out of step": _out_of_step,
    "turned": _turned,
    "scaled": _scaled,
    "moved": _moved_too,
    "moved and out of step": _moved_late,
}


def _swapped(
    tracks: Mapping[str, OutlineTrack], found: Agreement, moments_s: FloatArray
) -> Repair | None:
    """Tries every two cameras' videos exchanged; None where that does not help."""
    best: Repair | None = None
    for first, second in combinations(tracks, 2):
        # Of two swapped cameras both differ from the rest; but with four in all, one may seem to
        # agree by chance.
        if tracks[first].camera.size != tracks[second].camera.size or not set(found.culprits) <= {
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
            and after.error_px < _HELPS * found.error_px
            and (best is None or after.error_px < best.after_px)
        ):
            words = f"the videos of {first} and {second} are swapped"
            camera = tracks[first].camera
            best = Repair(
                first,
                "swapped",
                words,
                found.error_px,
                after.error_px,
                after.error_px,
                camera,
                with_camera=second,
            )
    return best


def _place(scene: SuspectCamera, kind: Kind, after: Camera, late_s: float = 0.0) -> Repair:
    """Says in words where a camera has gone."""
    name = scene.track.camera.name
    millimetres, degrees = apart(after, scene.track.camera)
    if kind == "turned":
        words = f"{name} was turned by about {degrees:.1f} degrees after calibration"
    else:
        words = (
            f"{name} was moved after calibration: by about {millimetres:.0f} mm, and turned by"
            f" {degrees:.1f} degrees"
        )
    if late_s:
        frames = late_s / _period(scene.track)
        words = (
            f"{words}; and its pictures come {_frames(frames)} ({abs(late_s) * 1000:.0f} ms)"
            f" {_late(late_s)}"
        )
    return _repair(scene, kind, words, after, late_s)


def _repair(
    scene: SuspectCamera, kind: Kind, words: str, after: Camera, late_s: float = 0.0
) -> Repair:
    camera = scene.track.camera
    millimetres, degrees = apart(after, camera)
    error = scene.error(after, late_s), scene.others_px
    return Repair(
        camera.name, kind, words, scene.error(camera), *error, after, late_s, millimetres, degrees
    )


def best_offset(scene: SuspectCamera, camera: Camera, most_late_s: float) -> float | None:
    """Returns the offset, s, at which a camera agrees best; None where the frames between the
    moments are unknown.
    """
    if len(scene.track.time_s) <= len(scene.moments_s):
        return None
    offsets = _offsets(scene.track, most_late_s, _FINE)
    errors = np.array([scene.error(camera, late_s) for late_s in offsets])
    best = int(errors.argmin())
    if not 0 < best < len(offsets) - 1 or not np.isfinite(errors[best - 1 : best + 2]).all():
        return float(offsets[best])
    # The errors rise about linearly to both sides, so the minimum lies where lines of the same
    # slope meet.
    left, middle, right = errors[best - 1 : best + 2]
    slope = max(left, right) - middle
    share = 0.0 if slope <= 0 else float(np.clip((left - right) / (2 * slope), -1, 1))
    return float(offsets[best] + share * (offsets[1] - offsets[0]))


def _offsets(track: OutlineTrack, most_late_s: float, step: float) -> FloatArray:
    """Returns the offsets to be tried, s."""
    period = _period(track)
    count = int(most_late_s / (period * step))
    return np.asarray(np.arange(-count, count + 1) * (period * step), dtype=np.float64)


def _period(track: OutlineTrack) -> float:
    return float(np.median(np.diff(track.time_s))) if len(track.time_s) > 1 else 1.0


def _moved(camera: Camera, x: FloatArray) -> Camera:
    """Returns a camera turned by x[:3] and shifted by x[3:]; each number moves the picture by about
    so many pixels.
    """
    pixel = 1 / camera.matrix[0, 0]
    turn = matrix_from_rodrigues(x[:3] * pixel)
    shift = x[3:] * pixel * _DEPTH_M if len(x) == 6 else np.zeros(3)
    return replace(
        camera, rotation=turn @ camera.rotation, translation=turn @ camera.translation + shift
    )


_DEPTH_M = 4.0  # a usual distance of the body, for the numbers' scale alone


def _stretched(camera: Camera, x: FloatArray) -> Camera:
    """Returns a camera whose picture is scaled about its middle by x[:2] (logarithms) and shifted
    by x[2:], each about so many pixels.
    """
    factors = np.diag([*np.exp(np.clip(x[:2] / max(camera.size) * 4, -2, 2)), 1.0])
    middle = (np.array(camera.size) - 1) / 2
    about = np.array([[1, 0, middle[0]], [0, 1, middle[1]], [0, 0, 1.0]])
    matrix = about @ factors @ np.linalg.inv(about) @ camera.matrix
    matrix[:2, 2] += x[2:]
    matrix[2] = [0, 0, 1]
    return replace(camera, matrix=matrix)


def _solve(
    scene: SuspectCamera,
    model: Callable[[Camera, FloatArray], Camera],
    start: FloatArray,
    late_s: float = 0.0,
    rounds: int = 40,
) -> FloatArray:
    """Minimises the errors over a camera's numbers from a start; returns them.

    Source: least squares with a soft L1 loss (scipy's trust region), on the touching planes'
    errors.
    """
    camera = scene.track.camera
    unit = max(camera.size) / 480
    unknown = (
        20.0 * unit
    )  # a plane that is lost costs as much as a bad one, or else losing all would be best
    base = np.isfinite(scene.residuals(camera, late_s))

    def cost(x: FloatArray) -> FloatArray:
        found = scene.residuals(model(camera, x), late_s)
        return np.where(np.isfinite(found), found, np.where(base, unknown, 0.0)) / unit

    soft = max(_LEAST_SOFT_PX, scene.others_px / unit)
    solved = least_squares(
        cost, start, loss="soft_l1", f_scale=soft, diff_step=1e-4, x_scale=unit, max_nfev=rounds
    )
    return np.asarray(solved.x)


def _frames(frames: float) -> str:
    return f"{abs(frames):.1f} frames"


def _late(late_s: float) -> str:
    return "late" if late_s > 0 else "early"
