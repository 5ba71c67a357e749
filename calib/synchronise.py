"""By how much cameras' clocks differ, from silhouettes.

Whoever moves changes every camera's outline at the same time. First, how fast outlines move
(middle, height, area) is correlated between
cameras. Then, where the calibration is known, the touching planes of every two cameras
(`calib.tangency`) have to turn together: their error has a sharp least at the right offset, which
least squares over all pairs finds to a small part of a frame.

Source: normalised cross-correlation of the speeds; Sinha and Pollefeys, Synchronization and
calibration of camera networks from silhouettes, for offsets from frontier points; standard errors
by the delete-a-block jackknife.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from calib.agreement import picture_scale, trimmed
from calib.errors import InputError
from calib.tangency import OutlineTrack, between, tangency

FloatArray = NDArray[np.float64]

_MOST_MOMENTS = 240
_STEP = 0.5  # of a frame
_LEAST_PLANES = 8
_LEAST_OVERLAP_S = 0.4
_SOFT_PX = 0.5
_GOOD_PX = 0.4
_SLOPE_FRAMES = 0.2
_BLOCKS = 6
_STILL_PX = 2.5  # over a quarter of the recording, in a picture of 480 px: edges tremble by a pixel
_ROUNDS = 4


@dataclass(frozen=True)
class Offset:
    """One camera's clock.

    Attributes: camera: Its name. late_s: By how much it is ahead of the reference's clock, s: its
        frame of time t was taken at t - late. error_s: Standard error of that. frames: The same in
        its frames. correlation: Of its outlines' speed with the reference's at that offset, -1 to
        1.
    """

    camera: str
    late_s: float
    error_s: float
    frames: float
    correlation: float


@dataclass(frozen=True)
class Synchronisation:
    """What was found.

    Attributes: reference: The camera whose clock counts. offsets: A line per camera. before_px:
        Error of all cameras' touching planes without offsets; NaN where none can be compared.
        after_px: With them. agreed: The calibration could be used: cameras agree at these offsets.
        Otherwise they rest on speeds alone.
    """

    reference: str
    offsets: tuple[Offset, ...]
    before_px: float
    after_px: float
    agreed: bool

    @property
    def late_s(self) -> dict[str, float]:
        """By camera name."""
        return {line.camera: line.late_s for line in self.offsets}


def synchronise(
    tracks: Sequence[OutlineTrack],
    most_s: float,
    reference: str | None = None,
    most_px: float = 2.5,
) -> Synchronisation:
    """Finds the offsets between cameras' clocks.

    Args: tracks: At least two cameras' outlines, each with the times of its own clock, frame by
        frame. most_s: The largest offset that is looked for, s. reference: The camera whose clock
        counts; None for the first. most_px: Error, px of a picture of 480 x 360, beyond which the
        calibration is not believed.

    Returns:
        The offsets.

    Raises:
        InputError: Fewer than two cameras, an unknown reference, or nobody moves.
    """
    names = [track.camera.name for track in tracks]
    if len(names) < 2:
        raise InputError("one camera alone has nothing to be in step with")
    reference = reference or names[0]
    if reference not in names:
        raise InputError(f"there is no camera {reference}: there are {', '.join(names)}")
    for track in tracks:
        _require_motion(track)
    ordered = [next(track for track in tracks if track.camera.name == reference)]
    ordered += [track for track in tracks if track.camera.name != reference]
    pairs = {
        (a, b): _Pair.measured(ordered[a], ordered[b], most_s)
        for a, b in combinations(range(len(ordered)), 2)
    }
    start = _placed(pairs, len(ordered), most_s)
    late, errors = _refined(ordered, start, np.array([pair.weight for pair in pairs.values()]))
    before, after = _error(ordered, np.zeros(len(ordered))), _error(ordered, late)
    agreed = bool(np.isfinite(after) and after <= most_px * picture_scale(tracks))
    if not agreed:
        late, errors = (
            _placed(pairs, len(ordered), most_s, by_speed=True),
            np.full(len(ordered), np.nan),
        )
    lines = []
    for index, track in enumerate(ordered):
        speed = 1.0 if index == 0 else pairs[0, index].correlation(late[index])
        lines.append(
            Offset(
                track.camera.name,
                float(late[index]),
                float(errors[index]),
                float(late[index] / period_s(track)),
                speed,
            )
        )
    lines.sort(key=lambda line: names.index(line.camera))
    return Synchronisation(reference, tuple(lines), before, _error(ordered, late), agreed)


def period_s(track: OutlineTrack) -> float:
    """Returns the time between a track's frames, s."""
    return float(np.median(np.diff(track.time_s))) if len(track.time_s) > 1 else 1.0


def speeds(track: OutlineTrack) -> FloatArray:
    """Returns how fast a track's outlines move: (T, 3) of the middle, the height and the area,
    heights per second; NaN unseen.
    """
    rows = np.full((len(track.outlines), 4), np.nan)
    for at, outline in enumerate(track.outlines):
        if outline is not None:
            rows[at] = [*outline.middle, outline.height_px, np.sqrt(outline.area_px)]
    size = max(float(np.nanmedian(rows[:, 2])) if np.isfinite(rows[:, 2]).any() else 1.0, 1.0)
    rate = np.asarray(np.gradient(rows, track.time_s, axis=0)) / size
    return np.column_stack(
        [np.hypot(rate[:, 0], rate[:, 1]), np.abs(rate[:, 2]), np.abs(rate[:, 3])]
    )


def _require_motion(track: OutlineTrack) -> None:
    """Refuses a camera in which nothing moves."""
    if track.seen.sum() < 3:
        raise InputError(
            f"{track.camera.name} sees nobody: offsets are found from somebody's motion"
        )
    corners = [outline.pixels for outline in track.outlines if outline is not None]
    box = np.array([[*one.min(axis=0), *one.max(axis=0)] for one in corners]) / (
        max(track.camera.size) / 480
    )
    later = len(box) // 4
    moved = np.abs(box[later:] - box[: len(box) - later]).max(axis=1)
    if np.median(moved) < _STILL_PX:
        raise InputError(
            f"nobody moves in {track.camera.name}, so its offset cannot be found: take a part in"
            " which somebody walks or swings the arms"
        )


@dataclass(frozen=True, eq=False)
class _Pair:
    """Two cameras at all offsets (K,), s, of the second against the first: errors, px of 480 x 360,
    and correlations of speed.
    """

    offsets_s: FloatArray
    errors_px: FloatArray
    correlations: FloatArray

    @classmethod
    def measured(cls, first: OutlineTrack, second: OutlineTrack, most_s: float) -> "_Pair":
        step = _STEP * min(period_s(first), period_s(second))
        count = int(most_s / step)
        offsets = np.arange(-count, count + 1, dtype=np.float64) * step
        moments = first.time_s[:: max(1, len(first.time_s) // _MOST_MOMENTS)]
        found = [
            tangency(first, second, moments, (0.0, late)) / picture_scale([first, second])
            for late in offsets
        ]
        known = np.array([np.isfinite(one).sum() for one in found])
        errors = np.array([trimmed(one) for one in found])
        errors[known < max(_LEAST_PLANES, 0.25 * known.max())] = np.nan
        return cls(offsets, errors, _correlations(first, second, offsets))

    def correlation(self, late_s: float) -> float:
        return float(np.interp(late_s, self.offsets_s, np.nan_to_num(self.correlations)))

    @property
    def weight(self) -> float:
        """How far the pair is believed: 1 where it agrees at some offset, less the worse it does
        even at the best one.
        """
        known = self.errors_px[np.isfinite(self.errors_px)]
        return _GOOD_PX / max(_GOOD_PX, float(known.min())) if len(known) else 0.0

    def cost(self, late_s: FloatArray, by_speed: bool) -> FloatArray:
        """What speaks against offsets (K,): the error as a share of the worst, or a lack of
        correlation; 1 where nothing is known.
        """
        if by_speed or not np.isfinite(self.errors_px).any():
            values = np.where(np.isfinite(self.correlations), 1 - self.correlations, 1.0)
        else:
            values = np.where(
                np.isfinite(self.errors_px), self.errors_px, np.nanmax(self.errors_px)
            ) / max(np.nanmedian(self.errors_px), 1e-9)
        return np.interp(late_s, self.offsets_s, values, left=values.max(), right=values.max())


def _correlations(first: OutlineTrack, second: OutlineTrack, offsets_s: FloatArray) -> FloatArray:
    """Returns the normalised correlation (K,) of two cameras' speeds, the mean of the three kinds."""
    left, right = _smooth(speeds(first)), _smooth(speeds(second))
    found = np.full(len(offsets_s), np.nan)
    for at, late in enumerate(offsets_s):
        other = between(second.time_s, right, first.time_s + late)
        both = np.isfinite(left).all(axis=1) & np.isfinite(other).all(axis=1)
        if both.sum() * period_s(first) < _LEAST_OVERLAP_S or both.sum() < 0.25 * min(
            len(left), len(right)
        ):
            continue
        a, b = left[both] - left[both].mean(axis=0), other[both] - other[both].mean(axis=0)
        scale = np.sqrt((a**2).sum(axis=0) * (b**2).sum(axis=0))
        found[at] = float(np.mean((a * b).sum(axis=0) / np.maximum(scale, 1e-12)))
    return found


def _smooth(values: FloatArray) -> FloatArray:
    """Averages three frames (T, K)."""
    padded = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    return (padded[:-2] + padded[1:-1] + padded[2:]) / 3


def _placed(
    pairs: Mapping[tuple[int, int], _Pair], count: int, most_s: float, by_speed: bool = False
) -> FloatArray:
    """Returns offsets (cameras,), s, the first's being 0: each camera where those placed before
    want it, then each once more in turn.
    """
    step = min(
        float(pair.offsets_s[1] - pair.offsets_s[0]) if len(pair.offsets_s) > 1 else most_s
        for pair in pairs.values()
    )
    grid = np.arange(-int(most_s / step), int(most_s / step) + 1) * step
    late = np.zeros(count)

    def wanted(camera: int, others: Sequence[int]) -> tuple[float, float]:
        cost = np.zeros(len(grid))
        for other in others:
            pair = pairs[min(camera, other), max(camera, other)]
            cost += pair.cost((grid - late[other]) * (1 if camera > other else -1), by_speed)
        best = int(cost.argmin())
        return float(cost[best] - np.median(cost)) / max(1, len(others)), float(grid[best])

    placed, waiting = [0], list(range(1, count))
    while waiting:
        # The camera whose place is clearest comes first.
        _, camera, place = min(
            (*wanted(camera, placed)[:1], camera, wanted(camera, placed)[1]) for camera in waiting
        )
        late[camera] = place
        placed.append(camera)
        waiting.remove(camera)
    for _ in range(_ROUNDS):
        for camera in range(1, count):
            late[camera] = wanted(camera, [other for other in range(count) if other != camera])[1]
    return late


def _moments(tracks: Sequence[OutlineTrack], late: FloatArray) -> FloatArray:
    """Returns times (M,), s, of the first camera's clock at which any two cameras may have filmed."""
    begin = min(float(track.time_s[0]) - offset for track, offset in zip(tracks, late, strict=True))
    end = max(float(track.time_s[-1]) - offset for track, offset in zip(tracks, late, strict=True))
    step = max(max(period_s(track) for track in tracks), (end - begin) / _MOST_MOMENTS)
    return np.arange(begin, end, step)


def _residuals(tracks: Sequence[OutlineTrack], late: FloatArray, moments: FloatArray) -> FloatArray:
    """Returns the signed errors (pairs, M, 2), px of a picture of 480 x 360; NaN unknown."""
    chosen = combinations(range(len(tracks)), 2)
    found = [
        tangency(tracks[a], tracks[b], moments, (float(late[a]), float(late[b]))) for a, b in chosen
    ]
    return np.array(found) / picture_scale(tracks)


def _error(tracks: Sequence[OutlineTrack], late: FloatArray) -> float:
    """Returns the error of all cameras, px."""
    return trimmed(_residuals(tracks, late, _moments(tracks, late))) * picture_scale(tracks)


def _refined(
    tracks: Sequence[OutlineTrack], start: FloatArray, weights: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Minimises the errors, weighted by pairs (pairs,), over the offsets (cameras,), s; returns
    them and their standard errors.
    """
    moments = _moments(tracks, start)
    unit = min(period_s(track) for track in tracks)
    known = np.isfinite(_residuals(tracks, start, moments))
    if not known.any():
        return start, np.full(len(tracks), np.nan)

    def solved(use: NDArray[np.bool_], begin: FloatArray) -> FloatArray:
        def cost(x: FloatArray) -> FloatArray:
            found = weights[:, None, None] * _residuals(
                tracks, np.concatenate([[0.0], x * unit]), moments
            )
            return np.where(use & np.isfinite(found), found, 0.0)[use]

        def slopes(x: FloatArray) -> FloatArray:
            # Wide steps: between frames angles are straight lines, with corners at the frames.
            steps = _SLOPE_FRAMES * np.eye(len(x))
            return np.array(
                [(cost(x + step) - cost(x - step)) / (2 * _SLOPE_FRAMES) for step in steps]
            ).T

        # The stubs know only the names of finite differences.
        result = least_squares(
            cost, begin[1:] / unit, jac=slopes, loss="soft_l1", f_scale=_SOFT_PX, max_nfev=30
        )  # type: ignore[arg-type]
        return np.concatenate([[0.0], result.x * unit])

    late = solved(known, start)
    block = np.arange(len(moments)) * _BLOCKS // len(moments)
    without = [
        solved(known & (block != left_out)[None, :, None], late) for left_out in range(_BLOCKS)
    ]
    spread = np.array(without) - np.mean(without, axis=0)
    return late, np.sqrt((_BLOCKS - 1) / _BLOCKS * (spread**2).sum(axis=0))
