"""Whether a camera stands still, by what is seen at the rim of its picture, and frames of one that
shakes, registered to one of them.
"""

from collections.abc import Sequence

import cv2
import numpy as np

from calib.checks import BoolArray, ByteArray, FloatArray
from silhouette_core.image.exposure import Aligner
from silhouette_core.tuning import CAMERA_MOTION

_SIDE_PX = 640  # of the picture whose pixels displacements are measured in
_SIDES_PX = 80, 320  # of those in which they are looked for
_RIM = 5  # of a picture's height and width, the part on each side that is the rim
_PIXELS = 8192  # those of the strongest edges
# Grey levels: root of the summed squares of the strong slopes along a similarity, per side of the
# picture, from which it is told to half a pixel. Of 22 cameras, real and rendered, the least is
# 17,900; a single line on a plain floor has 8,800, and is found up to half a pixel off.
_LEAST_SLOPE = 12_000
_STEP = 3 / 8  # grey levels per pixel: slope of a step of one level, as shades are rounded
_EVERY = 7  # of the rim's pixels, by which residuals are judged
_ROUNDS = 20


class CameraMovement:
    """How a camera moves, by some of its frames; its frames, registered to where it mostly is.

    The rim of their median picture, where people seldom are, is looked for in each. A similarity is
    fitted to all its pixels, with weights of Geman and McClure: a person who passes fits nowhere
    and counts little, and noise moves nothing. What the rim's edges do not tell, as one line does
    not tell a motion along it, is no motion.

    Attributes:
        moves: Whether most frames show another place, or one that is too far away to be found.
        shakes: Whether the rim is found, elsewhere in a quarter of the frames or the empty view.
        other_settings: Whether the empty view differs from the take but for its exposure, or is
            found only with that.
        other_tones: Whether it is found only by the order of its grey levels: no exposure makes it
            what the take shows.

    Source: Lucas and Kanade (1981), coarse to fine.
    """

    def __init__(self, frames: Sequence[ByteArray], empty: Sequence[ByteArray] = ()) -> None:
        """Looks at frames (H, W, 3) uint8, BGR, of a take, and of its empty view."""
        self._size = frames[0].shape[1::-1]
        self._usual = np.median([_reduced(one) for one in frames], axis=0).astype(np.uint8)
        self._median = _Rim(self._usual)
        motions = [self._moved_to(frame) for frame in frames]
        known = [moved for moved in motions if moved is not None]
        self.moves, self.shakes = 2 * len(known) < len(motions), False
        self.other_settings = self.other_tones = False
        if self.moves:
            return
        self._to_median = np.linalg.inv(np.mean(known, axis=0))
        away_px = float(np.quantile([self._away_px(moved) for moved in known], 0.75))
        empty_px = max((self._empty_away_px(frame) for frame in empty), default=0.0)
        self.shakes = max(away_px, empty_px) > CAMERA_MOTION.still_px

    def registered(self, frame: ByteArray) -> ByteArray:
        """A frame of the same size, moved, turned and scaled so that its rim is where it is in the
        mean; as it is where that cannot be told.
        """
        moved = self._moved_to(frame)
        if moved is None:
            return frame
        flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_REPLICATE
        matrix = (moved @ self._to_median)[:2]
        steady = cv2.warpAffine(frame, matrix, self._size, flags=flags, borderMode=border)
        return np.asarray(steady, np.uint8)

    def _empty_away_px(self, frame: ByteArray) -> float:
        """How far a picture of the empty view is away, px as of `_away_px`."""
        grey, away_px = _reduced(frame), [self._away_px(self._moved_to(frame))]
        usual, empty = (np.repeat(one[..., None], 3, axis=2) for one in (self._usual, grey))
        exposed = Aligner(usual.astype(np.float32)).aligned(empty)
        off, left = (
            float(np.median(cv2.absdiff(one, self._usual)[_rim(grey.shape)]))
            for one in (grey, _reduced(exposed))
        )
        self.other_settings = off > CAMERA_MOTION.over_noise * max(left, 1)
        if away_px[0] > CAMERA_MOTION.still_px:
            for picture in (exposed, _with_tones(grey, self._usual)):
                away_px.append(self._away_px(self._moved_to(picture)))
            # It stands still if it does with any settings; else the plainest that finds it tell.
            still = [way for way in range(3) if away_px[way] <= CAMERA_MOTION.still_px]
            way = (still or [way for way in range(3) if np.isfinite(away_px[way])] or [0])[0]
            self.other_settings, self.other_tones = self.other_settings or way > 0, way == 2
            return 0.0 if self.other_tones else away_px[way]
        return away_px[0]

    def _away_px(self, moved: FloatArray | None) -> float:
        """How far the picture's corners are from where they are in the mean of all frames: pixels
        of a picture of 640 px.
        """
        if moved is None:
            return np.inf
        corners = np.array([(x, y, 1) for x in (0, self._size[0]) for y in (0, self._size[1])])
        shifts = corners @ (moved @ self._to_median - np.eye(3)).T
        return float(np.linalg.norm(shifts, axis=1).mean() * _SIDE_PX / max(self._size))

    def _moved_to(self, frame: ByteArray) -> FloatArray | None:
        """Similarity (3, 3) from the median picture to a frame, px; None unless that from there to
        here is its inverse.
        """
        usual, rim = self._median, _Rim(_reduced(frame))
        if usual.bare or rim.bare:
            return np.eye(3)  # nothing moves that can be seen
        forth = usual.fitted(rim, usual.observable)
        back = rim.fitted(usual, usual.observable)
        off = np.abs(_matrix(forth, 1.0) @ _matrix(back, 1.0) - np.eye(3))
        if not off.max() * _SIDE_PX < CAMERA_MOTION.still_px:
            return None
        about = np.eye(3)
        about[:2, 2] = (np.array(self._size) - 1) / 2
        return about @ _matrix(forth, max(self._size)) @ np.linalg.inv(about)


def _reduced(picture: ByteArray, side_px: int = _SIDES_PX[-1]) -> ByteArray:
    """A picture (H, W) or (H, W, 3) uint8 in grey, its longer side at most so long."""
    if picture.ndim == 3:
        picture = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), np.uint8)
    scale = side_px / max(picture.shape)
    if scale < 1:
        small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        picture = np.asarray(small, np.uint8)
    return picture


def _with_tones(grey: ByteArray, like: ByteArray) -> ByteArray:
    """A picture (h, w) with the histogram that another has at its rim, in the order of its own grey
    levels.
    """
    shares = [np.cumsum(np.bincount(one[_rim(one.shape)], minlength=256)) for one in (grey, like)]
    quantiles, wanted = (share / share[-1] for share in shares)
    return np.interp(quantiles, wanted, np.arange(256)).round().astype(np.uint8)[grey]


def _rim(shape: tuple[int, ...]) -> BoolArray:
    """Where the rim of a picture is."""
    height, width = shape
    rim = np.ones(shape, np.bool_)
    rim[height // _RIM : -(height // _RIM), width // _RIM : -(width // _RIM)] = False
    return rim


class _Rim:
    """The rim of a reduced picture (h, w) uint8, at several sizes."""

    def __init__(self, grey: ByteArray) -> None:
        self._levels = [_Level(_reduced(grey, side_px)) for side_px in _SIDES_PX]
        self.observable = self._levels[-1].observable  # similarities (4, n) as columns
        self.bare = not self.observable.shape[1]

    def fitted(self, other: "_Rim", observable: FloatArray) -> FloatArray:
        """Similarity to another frame, of those that can be observed, (4, n) as columns."""
        similarity = np.zeros(4)
        for level, other_level in zip(self._levels, other._levels, strict=True):
            similarity = level.fitted(other_level, similarity, observable)
        return similarity


def _matrix(similarity: FloatArray, side: float) -> FloatArray:
    """Matrix (3, 3) of a similarity (shift right and down, turn, growth), whose lengths are in
    longer sides of a picture, about its middle.
    """
    right, down, turn, growth = similarity
    return np.array([[1 + growth, -turn, right * side], [turn, 1 + growth, down * side], [0, 0, 1]])


class _Level:
    """A picture (h, w) uint8, and the strongest edges of its rim."""

    def __init__(self, grey: ByteArray) -> None:
        self.picture = cv2.GaussianBlur(grey.astype(np.float32), (3, 3), 0)
        height, width = grey.shape
        self.side = max(height, width)
        pixels = np.flatnonzero(_rim(grey.shape))
        self.judged = pixels[::_EVERY]
        right, down = (
            self.side * cv2.Sobel(self.picture, cv2.CV_32F, *order, scale=1 / 8).ravel()[pixels]
            for order in ((1, 0), (0, 1))
        )
        edge = np.hypot(right, down)
        strongest = np.argpartition(-edge, min(_PIXELS, len(pixels) - 1))[:_PIXELS]
        self.strongest, right, down = pixels[strongest], right[strongest], down[strongest]
        rows, columns = np.divmod(self.strongest, width)
        x, y = (columns - (width - 1) / 2) / self.side, (rows - (height - 1) / 2) / self.side
        along = np.array([[x * 0 + 1, x * 0, -y, x], [x * 0, x * 0 + 1, x, y]])
        self.slopes = right * along[0] + down * along[1]
        usual = max(float(np.median(edge)), self.side * _STEP)
        strong = edge[strongest] > CAMERA_MOTION.over_noise * usual
        self.observable = _observable(self.slopes[:, strong], along[:, :, strong], usual)

    def fitted(self, other: "_Level", similarity: FloatArray, observable: FloatArray) -> FloatArray:
        """A similarity from this picture to another, fitted from a first one on, of those that can
        be observed.
        """
        height, width = self.picture.shape
        middle = np.array([width - 1, height - 1]) / 2
        flags, border = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP, cv2.BORDER_REPLICATE
        here = self.picture.ravel()
        for _ in range(_ROUNDS):
            matrix = _matrix(similarity, self.side)[:2]
            matrix[:, 2] += middle - matrix[:, :2] @ middle
            seen = cv2.warpAffine(
                other.picture, matrix, (width, height), flags=flags, borderMode=border
            )
            off = seen.ravel() - here
            brighter = float(np.median(off[self.judged]))  # exposure
            spread = float(np.median(np.abs(off[self.judged] - brighter)))
            off = off[self.strongest] - brighter
            weights = 1 / np.square(1 + np.square(off / max(2 * 1.4826 * spread, 1.0)))
            weighted = self.slopes * weights
            normal = observable.T @ weighted @ self.slopes.T @ observable
            step = observable @ np.linalg.solve(
                normal + np.eye(len(normal)), -observable.T @ weighted @ off
            )
            similarity = similarity + step
            if np.abs(step).max() * _SIDE_PX < 0.05:
                break
        return similarity


def _observable(slopes: FloatArray, along: FloatArray, usual: float) -> FloatArray:
    """Similarities (4, n), as columns, that edges tell: along which they have enough slope beyond
    that of noise. A rim that tells none is bare.

    Args:
        slopes: (4, N), of pixels that stand out of noise, along each parameter.
        along: (2, 4, N), how each parameter moves them.
        usual: median length of all slopes, of noise.
    """
    noise = usual**2 / (
        2 * np.log(2)
    )  # variance along an axis: lengths have Rayleigh's distribution
    excess = slopes @ slopes.T - noise * np.einsum("ain,ajn->ij", along, along)
    scale = np.array([1, 1, 2, 2])  # a turn moves the rim by half a side or so
    level, axes = np.linalg.eigh(excess * np.outer(scale, scale))
    return (axes * scale[:, None])[:, level > _LEAST_SLOPE**2]
