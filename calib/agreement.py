"""Check of a calibration against silhouettes, without a board.

For two correctly calibrated cameras, the planes through both centres that touch a body are the same
(`calib.tangency`). The errors of all pairs of cameras are measured once; the error of any group of
cameras follows from them. The culprits are the smallest set of cameras without which the others
agree.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from calib.camera import FloatArray
from calib.errors import InputError
from calib.tangency import OutlineTrack, PairErrors, all_tangencies
from calib.tuning import AGREEMENT

ROUNDING_PX = 1 / np.sqrt(12)
"""px of a small image: standard deviation of an outline that is known to whole pixels."""
OUTLINES_PX = np.sqrt(2) * ROUNDING_PX
"""px of a small image: that of the difference of two such outlines."""
SUBFRAME = (1 + AGREEMENT.step_frames) / 2
"""Frames: offsets up to half a frame do no harm and cannot be corrected by whole frames, nor what
their estimate is off by."""


@dataclass(frozen=True)
class CameraAgreement:
    """Agreement of one camera with the others."""

    camera: str
    error_px: float  #: Its error against the cameras that are not culprits.
    others_px: float  #: Error of those among themselves, without it.
    moments: int  #: Number of moments at which it saw somebody.
    planes: int


@dataclass(frozen=True)
class Agreement:
    """Result of the check."""

    error_px: float  #: Error of all cameras.
    table: tuple[CameraAgreement, ...]
    culprits: tuple[str, ...]
    """The cameras without which the others agree; empty if all agree, or if no subset does."""
    agrees: bool

    @property
    def summary(self) -> str:
        """The result in one sentence."""
        if self.agrees:
            every = "both" if len(self.table) == 2 else f"all {len(self.table)}"
            return f"{every} cameras agree: their outlines meet within {self.error_px:.1f} px"
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
        culprits = " and ".join(f"{line.camera} ({line.error_px:.1f} px)" for line in lines)
        verb = "does" if len(lines) == 1 else "do"
        return (
            f"{culprits} {verb} not agree with the others, which agree among themselves within"
            f" {lines[0].others_px:.1f} px"
        )


def agreement(
    tracks: Sequence[OutlineTrack],
    moments_s: FloatArray,
    offset_s: Mapping[str, float] | None = None,
) -> Agreement:
    """Checks a rig against silhouettes recorded with it. InputError where there is only one camera,
    or one never sees somebody together with another.

    Args:
        tracks: Outlines of at least two cameras; three are needed to identify a wrong one.
        moments_s: (M,) float64, s: times at which outlines are compared; a dozen, spread over the
            recording.
        offset_s: Clock offset by camera name, s: by how much its clock is ahead.
    """
    names = tuple(track.camera.name for track in tracks)
    if len(names) < 2:
        raise InputError(
            "one camera alone cannot be checked: there is nothing that it could agree with"
        )
    errors = all_tangencies(tracks, moments_s, offset_s)
    for name in names:
        if not any(np.isfinite(errors[pair]).any() for pair in errors if name in pair):
            raise InputError(
                f"{name} never sees somebody whole together with another camera: leave it out, or"
                " take other moments"
            )
    scale = image_scale(tracks)
    whole = group_error(errors, names)
    culprits = _culprits(errors, names, scale)
    good = [name for name in names if name not in culprits]
    lines = []
    for track in tracks:
        name = track.camera.name
        rest = [other for other in good if other != name]
        signed_px = signed_errors(errors, name, rest)
        error_px, others_px = trimmed_mean(signed_px), group_error(errors, rest)
        moments = int(track.seen.sum())
        lines.append(CameraAgreement(name, error_px, others_px, moments, len(signed_px)))
    agrees = not culprits and whole <= AGREEMENT.disagree_px * scale
    return Agreement(whole, tuple(lines), culprits, agrees)


def image_scale(tracks: Sequence[OutlineTrack]) -> float:
    """Size of the cameras' images relative to 480 x 360, at least 1: edges are whole pixels."""
    diagonal_px = float(np.mean([np.hypot(*track.camera.size) for track in tracks]))
    return max(1.0, diagonal_px / float(np.hypot(480, 360)))


def _culprits(errors: PairErrors, names: Sequence[str], scale: float) -> tuple[str, ...]:
    """Smallest minority of cameras of which each differs too much from the remaining ones."""
    max_count = min(max(1, (len(names) - 1) // 2), len(names) - 2)
    culprits: tuple[str, ...] = ()
    while len(culprits) < max_count:
        remaining = [name for name in names if name not in culprits]
        further = _smallest_set(errors, remaining, max_count - len(culprits), scale)
        if not further:
            break
        culprits += further  # without these, further ones may be detectable
    return tuple(name for name in names if name in culprits)


def _smallest_set(
    errors: PairErrors, names: Sequence[str], max_count: int, scale: float
) -> tuple[str, ...]:
    """Smallest set of cameras without which the others agree; of several, the most distinct one."""
    for count in range(1, min(max_count, len(names) - 2) + 1):
        candidates = []
        for left_out in combinations(names, count):
            rest = [name for name in names if name not in left_out]
            rest_px = group_error(errors, rest)
            limit = AGREEMENT.culprit_gain * max(rest_px, ROUNDING_PX * scale)
            distance_px = min(trimmed_mean(signed_errors(errors, name, rest)) for name in left_out)
            if distance_px > limit and rest_px <= AGREEMENT.disagree_px * scale:
                candidates.append((rest_px / distance_px, left_out))
        if candidates:
            return min(candidates)[1]
    return ()


def signed_errors(errors: PairErrors, name: str, others: Sequence[str]) -> FloatArray:
    """Distances, px, by which a camera's outlines exceed those of others, one per plane."""
    listed = [
        values * (1 if first == name else -1)
        for (first, second), values in errors.items()
        if (first == name and second in others) or (second == name and first in others)
    ]
    flat = np.concatenate([np.zeros(0), *(values.ravel() for values in listed)])
    return flat[np.isfinite(flat)]


def group_error(errors: PairErrors, names: Sequence[str]) -> float:
    """Error, px, of a group of cameras among themselves; NaN for a single camera."""
    inside = [values.ravel() for pair, values in errors.items() if set(pair) <= set(names)]
    return trimmed_mean(np.concatenate([np.zeros(0), *inside]))


def trimmed_mean(errors: FloatArray) -> float:
    """Mean absolute value of the smaller errors; NaN if there are none."""
    sizes = np.sort(np.abs(errors[np.isfinite(errors)]))
    count = max(1, int(AGREEMENT.trimmed * len(sizes)))
    return float(sizes[:count].mean()) if len(sizes) else np.nan
