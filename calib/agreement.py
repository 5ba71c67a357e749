"""Do silhouettes and cameras agree? A check of a calibration without any board.

Where all cameras are right, the viewing ray of every pixel on a body's outline runs into the body, so some point of the ray lies inside
every other camera's silhouette. How far the best point of a ray stays outside (px, in the worst other camera) is that ray's error: zero
in a perfect world, a pixel or two with real silhouettes, and many once a camera has been moved.

The errors of all rays, points and cameras are measured once; any group of cameras can then be asked whether it agrees within itself, and
the culprit is the camera whose leaving brings agreement.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from calib.errors import InputError

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]
Moment = Mapping[str, Mask]

FAR_PX = 100.0  # errors are not told apart beyond this
_RAYS = 120
_DEPTHS = 320
_REACH_M = 1.6  # half the depth that is searched: more than an arm's span
_LEAST_PIXELS = 50
_ONE_SIDED = 4.0
_GAP = 0.01  # of the image's diagonal
_LARGE_PIECE = 0.25  # of the largest piece's area
_BETTER = 0.8  # share of a camera's rays that count: outlines have bays where shadows and other things stick to the body
_STRAY_PIECE = 0.5
_STRAY = 0.04  # of the image diagonal


@dataclass(frozen=True)
class CameraAgreement:
    """One camera's line.

    Attributes:
        camera: Its name.
        own_px: Error of its outline's rays against all the others: what only this camera shows.
        denied_px: By how much it raises the others' errors: what only this camera does not show.
        others_px: Error of the others among themselves, without it.
        moments: Moments at which it saw somebody.
    """

    camera: str
    own_px: float
    denied_px: float
    others_px: float
    moments: int


@dataclass(frozen=True)
class Agreement:
    """The check's result.

    Attributes:
        error_px: Mean error over all cameras and rays.
        table: A line per camera.
        culprit: The camera whose leaving brings agreement, or None where all agree, or where no single one is to blame.
        agrees: Whether all cameras agree.
    """

    error_px: float
    table: tuple[CameraAgreement, ...]
    culprit: str | None
    agrees: bool

    @property
    def words(self) -> str:
        """The result in one sentence."""
        if self.agrees:
            return f"all {len(self.table)} cameras agree: outlines meet within {self.error_px:.2f} px"
        if self.culprit is None:
            return f"the cameras do not agree ({self.error_px:.1f} px) and no single one is to blame: two swapped, or calibrate again"
        line = next(line for line in self.table if line.camera == self.culprit)
        said = f"{line.camera} does not agree with the others: {self.error_px:.2f} px with it, {line.others_px:.2f} px without"
        if line.own_px > _ONE_SIDED * line.denied_px:
            return f"{said}; it shows what no other sees, so look at its silhouettes for shadows and other things first"
        if line.denied_px > _ONE_SIDED * line.own_px:
            return f"{said}; it misses what all others see, so look at its silhouettes for holes and lost limbs first"
        return f"{said}; it was moved, scaled or is out of step"


@dataclass(frozen=True)
class Tolerance:
    """When cameras count as agreeing.

    Attributes:
        least_px: Error up to which all is well whatever else, px for an image diagonal of 1000 px.
        gain: Above it, a camera is to blame if without it the error falls by this factor.
        most_px: Error above which something is wrong even if no single camera is to blame, for the same diagonal.
    """

    least_px: float = 0.05
    gain: float = 3.0
    most_px: float = 2.0


def check_agreement(rig: Rig, moments: Sequence[Moment], tolerance: Tolerance | None = None) -> Agreement:
    """Checks whether a rig and silhouettes taken with it agree.

    Args:
        rig: At least three cameras.
        moments: Silhouettes (H, W) bool by camera name, as recorded (lenses are respected); a dozen, spread over the recording.
        tolerance: When cameras count as agreeing.

    Returns:
        The result, with a line per camera.

    Raises:
        InputError: Fewer than three cameras, or no moment at which three saw somebody.
        ValueError: A silhouette is not as large as its camera's image.
    """
    tolerance = tolerance or Tolerance()
    names = rig.names
    if len(names) < 3:
        raise InputError(f"agreement needs three cameras to find the one that is wrong, this rig has {len(names)}")
    evidence = [Evidence.from_moment(rig, moment) for moment in moments]
    evidence = [one for one in evidence if len(one.names) >= 3]
    if not evidence:
        raise InputError("nobody is seen by three cameras at once at any of these moments: take others")
    whole = group_error(evidence, names)
    lines = []
    for name in names:
        rest = tuple(other for other in names if other != name)
        own = float(np.nanmean([one.error(name, names) for one in evidence if name in one.names] or [np.nan]))
        without = group_error(evidence, rest)
        with_it = float(np.mean([one.error(other, names) for one in evidence for other in rest if other in one.names]))
        lines.append(CameraAgreement(name, own, with_it - without, without, sum(name in one.names for one in evidence)))
    scale = float(np.mean([np.hypot(*camera.size) for camera in rig])) / 1000
    suspects = [line for line in lines if whole > tolerance.least_px * scale and line.others_px * tolerance.gain < whole]
    # Two cameras may dispute what none other sees. Then all rays are asked, down to the least.
    remaining = {line.camera: group_error(evidence, [name for name in names if name != line.camera], share=1.0) for line in suspects}
    culprit = min(remaining, key=lambda name: remaining[name]) if suspects else None
    return Agreement(whole, tuple(lines), culprit, culprit is None and whole <= tolerance.most_px * scale)


def group_error(evidence: Sequence["Evidence"], names: Sequence[str], share: float = _BETTER) -> float:
    """Returns the mean error (px) of a group of cameras among themselves, over that share of their rays, the better ones."""
    errors = [one.error(name, names, share) for one in evidence for name in names if name in one.names]
    return float(np.nanmean(errors)) if errors else np.nan


@dataclass(frozen=True, eq=False)
class Evidence:
    """What one moment says.

    Attributes:
        names: Cameras that saw somebody.
        pixels: By camera: its outline's pixels (rays, 2).
        outside_px: By camera: (rays, depths, cameras) float32, how far each point of each of its outline's rays is outside each
            camera's silhouette, at most `FAR_PX`; NaN where that camera cannot tell.
        stray_px: The error from which on a ray is not of the body at all.
    """

    names: tuple[str, ...]
    pixels: Mapping[str, FloatArray]
    outside_px: Mapping[str, NDArray[np.float32]]
    stray_px: float

    @classmethod
    def from_moment(cls, rig: Rig, moment: Moment) -> "Evidence":
        """Measures one moment.

        Raises:
            ValueError: A silhouette is not (H, W) bool of its camera's size.
        """
        seen = [camera for camera in rig if camera.name in moment and _usable(camera, moment[camera.name])]
        if len(seen) < 2:
            return cls(tuple(camera.name for camera in seen), {}, {}, FAR_PX)
        bodies = {camera.name: body_pieces(moment[camera.name]) for camera in seen}
        first = cls._measure(seen, bodies)
        kept = {name: _without_strays(body, first.pixels[name], first.strays[name]) for name, body in bodies.items()}
        return first if all(kept[name] is bodies[name] for name in kept) else cls._measure(seen, kept)

    @classmethod
    def _measure(cls, seen: Sequence[Camera], bodies: Mapping[str, Mask]) -> "Evidence":
        """Measures how all cameras like all points of all rays."""
        fields = {name: OutsideField.from_mask(body) for name, body in bodies.items()}
        middle = body_middle(seen, list(bodies.values()))
        table, pixels = {}, {}
        for camera in seen:
            points, pixels[camera.name] = ray_points(camera, outline_pixels(bodies[camera.name]), middle)
            flat = points.reshape(-1, 3)
            values = [fields[other.name].look_up(other, flat) for other in seen]
            table[camera.name] = np.stack(values, axis=-1).reshape(*points.shape[:2], len(seen)).astype(np.float32)
        diagonal = float(np.mean([np.hypot(*camera.size) for camera in seen]))
        return cls(tuple(table), pixels, table, min(_STRAY * diagonal, 0.9 * FAR_PX))

    def errors(self, name: str, group: Sequence[str]) -> NDArray[np.float32]:
        """Returns each of a camera's rays' error (rays,), px, against the other cameras of a group."""
        against = [index for index, other in enumerate(self.names) if other in group and other != name]
        if not against:
            return np.zeros(0, dtype=np.float32)
        return np.nan_to_num(self.outside_px[name][:, :, against], nan=0.0).max(axis=2).min(axis=1)

    def error(self, name: str, group: Sequence[str], share: float = _BETTER) -> float:
        """Returns the mean of a camera's better rays' errors, px; NaN where it has nobody to compare with."""
        errors = np.sort(self.errors(name, group))
        return float(errors[: max(1, int(share * len(errors)))].mean()) if len(errors) else np.nan

    @cached_property
    def strays(self) -> dict[str, NDArray[np.bool_]]:
        """Rays (rays,) by camera that are far from the body: of shadows, flicker, another person."""
        return {name: self.errors(name, self.names) > self.stray_px for name in self.names}


@dataclass(frozen=True, eq=False)
class OutsideField:
    """How far every pixel is outside a silhouette: (H, W) float32 px, at most `FAR_PX`, and whether the body leaves the image."""

    distance_px: NDArray[np.float32]
    leaves_image: bool

    @classmethod
    def from_mask(cls, mask: Mask) -> "OutsideField":
        """Measures a silhouette (H, W) bool."""
        distance = cv2.distanceTransform((~mask).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        border = mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any()
        return cls(np.minimum(distance, FAR_PX).astype(np.float32), bool(border))

    def look_up(self, camera: Camera, points_m: FloatArray) -> NDArray[np.float32]:
        """Returns how far points (N, 3) m are outside, (N,) px; NaN for points behind the camera or outside its lens's field.

        A point outside the image is as far as the image's nearest pixel and the way there; where the body itself leaves the image the
        camera cannot tell, and the point is NaN.
        """
        pixels, _ = camera.project(points_m)
        known = np.isfinite(pixels).all(axis=1)
        pixels[~known] = 0
        height, width = self.distance_px.shape
        nearest = np.clip(pixels, 0, [width - 1, height - 1])
        beyond = np.linalg.norm(pixels - nearest, axis=1)
        values = np.minimum(_between(self.distance_px, nearest) + beyond, FAR_PX)
        if self.leaves_image:
            known &= beyond < 1
        values[~known] = np.nan
        return values.astype(np.float32)


def _between(image: NDArray[np.float32], pixels: FloatArray) -> NDArray[np.float32]:
    """Reads an image (H, W) between its pixels (N, 2), linearly."""
    # OpenCV's maps may have at most 32767 rows or columns.
    padded = np.zeros((-(-len(pixels) // 1024) * 1024, 2), dtype=np.float32)
    padded[: len(pixels)] = pixels
    maps = padded.reshape(-1, 1024, 2)
    read = cv2.remap(image, maps[..., 0], maps[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE) if len(pixels) else padded[:, 0]
    return np.asarray(read, dtype=np.float32).ravel()[: len(pixels)]


def body_pieces(mask: Mask) -> Mask:
    """Returns the large pieces of a silhouette: a body is one or a few, flicker and shadows are many small ones.

    Pieces that are a hundredth of the image apart count as one, for limbs come off where clothes look like the background.
    """
    reach = int(_GAP * np.hypot(*mask.shape)) | 1
    thick = cv2.dilate(mask.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach)))
    _, labels = cv2.connectedComponents(thick, connectivity=8)
    area = np.bincount(labels[mask])
    large = np.flatnonzero(area >= _LARGE_PIECE * area.max())
    return mask & np.isin(labels, large)


def _without_strays(body: Mask, pixels: FloatArray, strays: NDArray[np.bool_]) -> Mask:
    """Drops a silhouette's pieces whose outlines stray; the silhouette itself where nothing would be left."""
    _, labels = cv2.connectedComponents(body.astype(np.uint8), connectivity=4)
    owner = labels[pixels[:, 1].astype(int), pixels[:, 0].astype(int)]
    pieces = np.unique(owner)
    gone = [piece for piece in pieces if strays[owner == piece].mean() > _STRAY_PIECE]
    return body & ~np.isin(labels, gone) if 0 < len(gone) < len(pieces) else body


def outline_pixels(body: Mask, count: int = _RAYS) -> FloatArray:
    """Returns about `count` pixels (N, 2) as (x, y) spread along a silhouette's outline, on the inside; the image's edge is no outline."""
    padded = cv2.copyMakeBorder(body.astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_REPLICATE)
    filled = cv2.morphologyEx(padded, cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    inner = cv2.erode(filled, np.ones((3, 3), np.uint8))[1:-1, 1:-1]
    row, column = np.nonzero(body & (inner == 0))
    chosen = np.unique(np.linspace(0, len(row) - 1, count).astype(int)) if len(row) else np.zeros(0, dtype=int)
    return np.column_stack([column[chosen], row[chosen]]).astype(np.float64)


def ray_points(camera: Camera, pixels: FloatArray, middle_m: FloatArray, count: int = _DEPTHS) -> tuple[FloatArray, FloatArray]:
    """Returns points (rays, count, 3), m, along the rays of pixels, as deep as the body may be, and the pixels that have a ray."""
    origin, directions = camera.rays(pixels)
    kept = np.isfinite(directions).all(axis=1)
    distance = float(np.linalg.norm(middle_m - origin))
    depths = np.linspace(max(0.1, distance - _REACH_M), distance + _REACH_M, count)
    return origin + directions[kept][:, None] * depths[:, None], pixels[kept]


def body_middle(cameras: Sequence[Camera], masks: Sequence[Mask]) -> FloatArray:
    """Returns the point (3,), m, nearest to the rays through the silhouettes' middles; the rays that fit worst count least.

    Source: weighted least squares on point-to-line distances, weights 1 / distance (the geometric median's), ten rounds.
    """
    origins, directions = [], []
    for camera, mask in zip(cameras, masks, strict=True):
        row, column = np.nonzero(mask)
        origin, direction = camera.rays(np.array([[np.median(column), np.median(row)]]))
        if np.isfinite(direction).all():
            origins.append(origin)
            directions.append(direction[0])
    across = np.eye(3) - np.einsum("ni,nj->nij", directions, directions)
    weights = np.ones(len(across))
    middle = np.zeros(3)
    for _ in range(10):
        normal = np.einsum("n,nij->ij", weights, across) + 1e-9 * np.eye(3)
        middle = np.linalg.solve(normal, np.einsum("n,nij,nj->i", weights, across, origins))
        apart = np.linalg.norm(np.einsum("nij,nj->ni", across, middle - np.array(origins)), axis=1)
        weights = 1 / np.maximum(apart, 0.05)
    return middle


def _usable(camera: Camera, mask: Mask) -> bool:
    """Whether somebody is in a silhouette, after checking it."""
    width, height = camera.size
    if mask.shape != (height, width) or mask.dtype != np.bool_:
        raise ValueError(f"camera {camera.name}: silhouette must be ({height}, {width}) bool, got {mask.shape} {mask.dtype}")
    return int(mask.sum()) >= _LEAST_PIXELS
