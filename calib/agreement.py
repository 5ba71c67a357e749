"""Do silhouettes and cameras agree? A check of a calibration without any board.

Where two cameras are right, the planes through both centres that touch a body are the same for both
(`calib.tangency`). The errors of all pairs of cameras are measured once; any group of cameras can
then be asked whether it agrees within itself, and the culprits are the fewest cameras whose leaving
brings agreement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from calib.tangency import Mask, OutlineTrack, PairErrors, all_tangencies

FloatArray = NDArray[np.float64]

_BETTER = (
    0.8  # share of the errors that count: the rest is of shadows, lost limbs and grazing planes
)
_USUAL_DIAGONAL_PX = 600.0  # tolerances are for pictures of 480 x 360


@dataclass(frozen=True)
class CameraAgreement:
    """One camera's line.

    Attributes:
        camera: Its name.
        error_px: Its error against the cameras that are not to blame.
        others_px: Error of those among themselves, without it.
        outward_px: By how much its outlines reach beyond theirs, median.
        moments: Moments at which it saw somebody.
        planes: Touching planes compared.
    """

    camera: str
    error_px: float
    others_px: float
    outward_px: float
    moments: int
    planes: int


@dataclass(frozen=True)
class Agreement:
    """The check's result.

    Attributes: error_px: Error of all cameras. table: A line per camera. culprits: The cameras
        whose leaving brings agreement; empty where all agree, or where that brings none. agrees:
        Whether all cameras agree.
    """

    error_px: float
    table: tuple[CameraAgreement, ...]
    culprits: tuple[str, ...]
    agrees: bool

    @property
    def words(self) -> str:
        """The result in one sentence."""
        if self.agrees:
            all_of_them = "both" if len(self.table) == 2 else f"all {len(self.table)}"
            return f"{all_of_them} cameras agree: their outlines meet within {self.error_px:.1f} px"
        if len(self.table) == 2:
            return (
                f"the two cameras do not agree ({self.error_px:.1f} px); which one is wrong, only a"
                " third could tell"
            )
        if not self.culprits:
            return (
                f"the cameras do not agree ({self.error_px:.1f} px), and no one of them alone is to"
                " blame"
            )
        lines = [line for line in self.table if line.camera in self.culprits]
        said = " and ".join(f"{line.camera} ({line.error_px:.1f} px)" for line in lines)
        verb = "does" if len(lines) == 1 else "do"
        return (
            f"{said} {verb} not agree with the others, which agree among themselves within"
            f" {lines[0].others_px:.1f} px"
        )


@dataclass(frozen=True)
class Tolerance:
    """When cameras count as agreeing; pixels are those of a picture of 480 x 360, and scale with
    the picture.

    Attributes: least_px: A camera whose error is smaller is never to blame. gain: One whose error
        is larger is to blame if it is as many times the others' error among themselves. floor_px:
        The others' error counts as at least this: what the edges of good silhouettes are worth.
        most_px: Error above which something is wrong even if nobody is to blame.
    """

    least_px: float = 0.7
    gain: float = 2.5
    floor_px: float = 0.28
    most_px: float = 2.5


def check_agreement(
    rig: Rig, moments: Sequence[Mapping[str, Mask]], tolerance: Tolerance | None = None
) -> Agreement:
    """Checks whether a rig and silhouettes taken with it agree.

    Args: rig: At least two cameras; three are needed to tell which one is wrong. moments:
        Silhouettes (H, W) bool by camera name, as recorded (lenses are respected) or scaled down; a
        dozen, spread over the
            recording.
        tolerance: When cameras count as agreeing.

    Returns:
        The result, with a line per camera.

    Raises:
        InputError: Only one camera, or one that never sees somebody together with another.
        ValueError: A silhouette does not have its camera's shape.
    """
    times = np.arange(len(moments), dtype=np.float64)
    return agreement(
        [
            OutlineTrack.from_masks(camera, times, [moment[camera.name] for moment in moments])
            for camera in rig
        ],
        times,
        tolerance,
    )


def agreement(
    tracks: Sequence[OutlineTrack],
    moments_s: FloatArray,
    tolerance: Tolerance | None = None,
    late_s: Mapping[str, float] | None = None,
) -> Agreement:
    """Checks whether cameras agree, as `check_agreement`, from their outlines.

    Args:
        tracks: Each camera's outlines.
        moments_s: (M,) float64, s: when to look.
        tolerance: When cameras count as agreeing.
        late_s: By how much a camera's clock is ahead, by its name, s.

    Returns:
        The result.

    Raises:
        InputError: Only one camera, or one that never sees somebody together with another.
    """
    names = tuple(track.camera.name for track in tracks)
    if len(names) < 2:
        raise InputError(
            "one camera alone cannot be checked: there is nothing that it could agree with"
        )
    tolerance = tolerance or Tolerance()
    errors = all_tangencies(tracks, moments_s, late_s)
    for name in names:
        if not any(np.isfinite(errors[pair]).any() for pair in errors if name in pair):
            raise InputError(
                f"{name} never sees somebody whole together with another camera: leave it out, or"
                " take other moments"
            )
    scale = picture_scale(tracks)
    whole = group_error(errors, names)
    culprits = _culprits(errors, names, tolerance, scale)
    good = [name for name in names if name not in culprits]
    lines = []
    for track in tracks:
        name = track.camera.name
        rest = [other for other in good if other != name]
        own = signed_errors(errors, name, rest)
        line = CameraAgreement(
            name,
            trimmed(own),
            group_error(errors, rest),
            float(np.median(own)),
            int(track.seen.sum()),
            len(own),
        )
        lines.append(line)
    return Agreement(
        whole, tuple(lines), culprits, not culprits and whole <= tolerance.most_px * scale
    )


def picture_scale(tracks: Sequence[OutlineTrack]) -> float:
    """Returns how many px of these cameras' pictures one of a picture of 480 x 360 is; at least
    one, for edges are pixels.
    """
    return max(
        1.0, float(np.mean([np.hypot(*track.camera.size) for track in tracks])) / _USUAL_DIAGONAL_PX
    )


def _culprits(
    errors: PairErrors, names: Sequence[str], tolerance: Tolerance, scale: float
) -> tuple[str, ...]:
    """Returns the fewest cameras, a minority, each of which differs from the rest by more than the
    rest allows.
    """
    most = min(max(1, (len(names) - 1) // 2), len(names) - 2)
    culprits: tuple[str, ...] = ()
    while len(culprits) < most:
        left = [name for name in names if name not in culprits]
        more = _fewest(errors, left, most - len(culprits), tolerance, scale)
        if not more:
            break
        culprits += more  # without them, the next may stand out
    return tuple(name for name in names if name in culprits)


def _fewest(
    errors: PairErrors, names: Sequence[str], most: int, tolerance: Tolerance, scale: float
) -> tuple[str, ...]:
    """Returns the fewest cameras whose leaving brings agreement; of several choices, that which
    stands out most.
    """
    for count in range(1, min(most, len(names) - 2) + 1):
        found = []
        for left_out in combinations(names, count):
            rest = [name for name in names if name not in left_out]
            among = group_error(errors, rest)
            limit = max(
                tolerance.least_px * scale, tolerance.gain * max(among, tolerance.floor_px * scale)
            )
            apart = min(trimmed(signed_errors(errors, name, rest)) for name in left_out)
            if apart > limit and among <= tolerance.most_px * scale:
                found.append((among / apart, left_out))
        if found:
            return min(found)[1]
    return ()


def signed_errors(errors: PairErrors, name: str, others: Sequence[str]) -> FloatArray:
    """Returns by how many px a camera's outlines reach beyond those of others, one number per
    plane.
    """
    listed = [
        values * (1 if first == name else -1)
        for (first, second), values in errors.items()
        if _joins(name, first, second, others)
    ]
    flat = np.concatenate([np.zeros(0), *(values.ravel() for values in listed)])
    return flat[np.isfinite(flat)]


def _joins(name: str, first: str, second: str, others: Sequence[str]) -> bool:
    return (first == name and second in others) or (second == name and first in others)


def group_error(errors: PairErrors, names: Sequence[str]) -> float:
    """Returns the error, px, of a group of cameras among themselves; NaN for one alone."""
    return trimmed(
        np.concatenate(
            [
                np.zeros(0),
                *(v.ravel() for pair, v in errors.items() if pair[0] in names and pair[1] in names),
            ]
        )
    )


def trimmed(errors: FloatArray) -> float:
    """Returns the mean size of the smaller errors; NaN where there are none."""
    sizes = np.sort(np.abs(errors[np.isfinite(errors)]))
    return float(sizes[: max(1, int(_BETTER * len(sizes)))].mean()) if len(sizes) else np.nan
