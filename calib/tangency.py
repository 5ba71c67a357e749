"""Epipolar tangency: consistency of two cameras' outlines of one body.

A plane through two cameras' centres that touches a body touches its outline in both images. Among
the planes through the line between the centres (the baseline), the first and the last that meet the
body are therefore the same for both cameras. This holds for bodies of any shape, needs no
correspondences, and is signed: outlines that are too large and too small are both detected. It
needs calibrated cameras, and extremes of the outline that lie within the image.

Source: Åström, Cipolla and Giblin, Generalised epipolar constraints; Sinha, Pollefeys and McMillan,
Camera network calibration from dynamic silhouettes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, FloatArray
from calib.checks import check_array
from calib.components import label_components
from calib.tuning import OUTLINES

Mask = NDArray[np.bool_]

_LEAST_PIXELS = 50
_BORDER_PX = 1  # an outline so near to the image's border may be cut off there
_TOUCHING_PX = 3  # a silhouette so near to something unknown goes on behind it
_AROUND = np.array([[np.cos(angle), np.sin(angle)] for angle in np.arange(8) * np.pi / 4]) / 2
_CACHE_SIZE = 64


@dataclass(frozen=True, eq=False)
class Outline:
    """The convex hull of one silhouette."""

    pixels: FloatArray
    """(N, 2) float64, px of the recorded image, the corners: half a pixel outside the outermost
    pixel centres."""
    inside: NDArray[np.bool_]
    """(N,) bool, whether a corner is not at the image's border, where the body may be cut off."""
    middle: FloatArray  #: (2,) float64, px, median of the silhouette's pixels.

    @classmethod
    def from_mask(cls, camera: Camera, mask: Mask, unknown: Mask | None = None) -> "Outline | None":
        """Outline of the large components of a silhouette, or None if it is (nearly) empty.
        TypeError where the silhouette is not bool; ValueError where the silhouette has another
        aspect than the camera's image.

        Args:
            mask: (H, W) bool, silhouette in the camera's image or in a reduced one.
            unknown: (H, W) bool, where nothing is known: where that touches the silhouette, the
                body may go on behind it, as it does at the image's border. None: nowhere.
        """
        width, height = camera.size
        scaled = mask.ndim == 2 and abs(mask.shape[0] * width / mask.shape[1] - height) <= 4
        check_array(
            f"camera {camera.name}: silhouette",
            mask,
            mask.shape if scaled else (height, width),
            np.bool_,
        )
        if np.count_nonzero(mask) < _LEAST_PIXELS:
            return None
        scale = np.array(mask.shape[::-1]) / camera.size
        body = main_components(mask)
        contours, _ = cv2.findContours(
            body.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        edge = np.concatenate(contours).reshape(-1, 2)
        within_px = np.minimum(edge, np.array(mask.shape[::-1]) - 1 - edge).min(axis=1)
        border = within_px <= _BORDER_PX
        if unknown is not None and len(hiding := _occluding_edge(body, unknown)):
            edge = np.concatenate([edge, hiding])
            border = np.concatenate([border, np.ones(len(hiding), np.bool_)])
        points = ((edge[:, None] + _AROUND).reshape(-1, 2) + 0.5) / scale - 0.5
        undistorted = camera.undistort(points)  # a convex hull needs straight lines
        known = np.flatnonzero(np.isfinite(undistorted).all(axis=1))
        if len(known) < 3:
            return None
        corners = known[
            np.asarray(
                cv2.convexHull(undistorted[known].astype(np.float32), returnPoints=False),
                dtype=np.int64,
            ).ravel()
        ]
        row, column = np.nonzero(body)
        middle = (np.array([np.median(column), np.median(row)]) + 0.5) / scale - 0.5
        return cls(points[corners], ~np.repeat(border, len(_AROUND))[corners], middle)


def _occluding_edge(body: Mask, unknown: Mask) -> NDArray[np.int64]:
    """Edge (N, 2), px, of the unknown places (H, W) that touch a silhouette."""
    wide = np.ones((2 * _TOUCHING_PX + 1, 2 * _TOUCHING_PX + 1), np.uint8)
    places = np.asarray(cv2.dilate(unknown.astype(np.uint8), wide), np.uint8).view(np.bool_)
    labels = label_components(places).labels
    touched = np.unique(labels[places & body])
    if not len(touched):
        return np.zeros((0, 2), np.int64)
    places &= np.isin(labels, touched)
    contours, _ = cv2.findContours(
        places.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    return np.concatenate(contours).reshape(-1, 2).astype(np.int64)


def main_components(mask: Mask) -> Mask:
    """Large components of a silhouette (H, W) bool, without flicker and small shadows.

    Components closer than a hundredth of the image's diagonal count as one: limbs become detached
    where clothes look like the background.
    """
    reach = int(OUTLINES.gap * np.hypot(*mask.shape)) | 1
    thick = cv2.dilate(
        mask.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))
    )
    labels = label_components(thick.view(bool)).labels
    area = np.bincount(labels[mask])
    large = np.flatnonzero(area >= OUTLINES.large_component * area.max())
    return mask & np.isin(labels, large)


@dataclass(frozen=True, eq=False)
class OutlineTrack:
    """Outlines of one camera over time."""

    camera: Camera
    time_s: FloatArray  #: (T,) float64, increasing: times of its frames by its own clock.
    outlines: tuple[Outline | None, ...]  #: T outlines; None where nobody is seen.

    @classmethod
    def from_masks(
        cls, camera: Camera, time_s: FloatArray, masks: Sequence[Mask], unknown: Mask | None = None
    ) -> "OutlineTrack":
        """Outlines of silhouettes (H, W) bool taken at times (T,), but for what is unknown."""
        return cls(
            camera,
            np.asarray(time_s, dtype=np.float64),
            tuple(Outline.from_mask(camera, mask, unknown) for mask in masks),
        )

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(T,) bool, whether somebody is seen."""
        return np.array([outline is not None for outline in self.outlines], dtype=bool)

    @property
    def period_s(self) -> float:
        """Time between frames, s."""
        return float(np.median(np.diff(self.time_s))) if len(self.time_s) > 1 else 1.0

    def with_camera(self, camera: Camera) -> "OutlineTrack":
        """The same outlines for another camera, which may have another pose or lens."""
        track = replace(self, camera=camera)
        same = camera.matrix is self.camera.matrix or np.array_equal(
            camera.matrix, self.camera.matrix
        )
        if same and camera.distortion.tobytes() == self.camera.distortion.tobytes():
            track.__dict__.update(_corners=self._corners, _toward_body=self._toward_body)
        return track

    @cached_property
    def _corners(self) -> tuple[FloatArray, NDArray[np.int64], NDArray[np.bool_]]:
        """Rays (N, 3) of all corners in the camera's frame, their frame numbers (N,), and `inside`
        (N,).
        """
        known = [(k, outline) for k, outline in enumerate(self.outlines) if outline is not None]
        if not known:
            return np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
        _, rays = self.camera.rays(np.concatenate([outline.pixels for _, outline in known]))
        moment = np.repeat([k for k, _ in known], [len(outline.pixels) for _, outline in known])
        inside = np.concatenate([outline.inside for _, outline in known])
        good = np.isfinite(rays).all(axis=1)
        return (rays @ self.camera.rotation.T)[good], moment[good], inside[good]

    def frames_around(self, at_s: FloatArray) -> "OutlineTrack":
        """The frames that `interpolate` needs at given times (M,), s."""
        after = np.searchsorted(self.time_s, at_s + 1e-6 * np.sign(at_s))
        needed = np.unique(np.clip(after[:, None] + [-2, -1, 0, 1], 0, len(self.time_s) - 1))
        return replace(
            self, time_s=self.time_s[needed], outlines=tuple(self.outlines[k] for k in needed)
        )

    def toward_body(self) -> FloatArray:
        """Direction (3,), world, to the body, median over time."""
        return self.camera.rotation.T @ self._toward_body

    def cached_tangent_angles(
        self, baseline: FloatArray, zero: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """As `tangent_angles`, cached: while one camera is optimised, the others do not change."""
        cache: dict[bytes, tuple[FloatArray, FloatArray]] = self.__dict__.setdefault("_memory", {})
        key = baseline.tobytes() + zero.tobytes()
        if key not in cache:
            if len(cache) >= _CACHE_SIZE:
                cache.clear()
            cache[key] = self.tangent_angles(baseline, zero)
        return cache[key]

    @cached_property
    def _toward_body(self) -> FloatArray:
        """As `toward_body`, in the camera's frame."""
        middles = np.array(
            [outline.middle for outline in self.outlines if outline is not None]
        ).reshape(-1, 2)
        rays = self.camera.rays(middles)[1] @ self.camera.rotation.T
        return np.nanmedian(rays, axis=0) if np.isfinite(rays).any() else np.array([0, 0, 1.0])

    def tangent_angles(
        self, baseline: FloatArray, zero: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        r"""Tangent planes of the outlines through a baseline.

        With the ray :math:`d` of a corner, the unit vector :math:`b` of the baseline and an
        orthonormal basis :math:`u, v` of the plane normal to it,

        .. math:: \phi = \operatorname{atan2}(v \cdot d, u \cdot d)

        is the angle of the plane through the corner; the smallest and the largest one are tangent.

        Args:
            baseline: (3,) unit vector, world.
            zero: (3,) vector, world, contained in the plane of angle zero.

        Returns:
            Angles (T, 2), rad, of the first and the last plane, NaN where the outline does not
            determine it; and speed (T, 2), px per rad, of the tangent point in the image.
        """
        shape = (len(self.outlines), 2)
        angle, speed = np.full(shape, np.nan), np.full(shape, np.nan)
        corners, moment, inside = self._corners
        if not len(corners):
            return angle, speed
        beside = corners @ (self.camera.rotation @ plane_axes(baseline, zero).T)
        across = np.hypot(beside[:, 0], beside[:, 1])
        around = np.arctan2(beside[:, 1], beside[:, 0])
        starts = np.flatnonzero(np.diff(moment, prepend=-1))
        segment = np.cumsum(np.diff(moment, prepend=-1) > 0) - 1
        # Relative to each outline's first corner, so that angles do not wrap within an outline.
        unwrapped = (
            around[starts][segment]
            + (around - around[starts][segment] + np.pi) % (2 * np.pi)
            - np.pi
        )
        low, high = np.minimum.reduceat(unwrapped, starts), np.maximum.reduceat(unwrapped, starts)
        focal = float(np.sqrt(self.camera.matrix[0, 0] * self.camera.matrix[1, 1]))
        for side, extreme in enumerate((low, high)):
            corner = np.flatnonzero(unwrapped == extreme[segment])
            corner = corner[np.unique(segment[corner], return_index=True)[1]]
            good = inside[corner] & (high - low < np.pi)  # else the baseline meets the body
            angle[moment[starts][good], side] = extreme[good]
            speed[moment[starts][good], side] = focal * across[corner][good]
        return angle, speed


def plane_axes(baseline: FloatArray, zero: FloatArray) -> FloatArray:
    """Orthonormal basis (2, 3) of the plane normal to a unit vector (3,), its first vector toward
    another one (3,).
    """
    first = zero - (zero @ baseline) * baseline
    first /= max(float(np.linalg.norm(first)), 1e-12)
    return np.stack([first, np.cross(baseline, first)])


def tangency(
    first: OutlineTrack,
    second: OutlineTrack,
    moments_s: FloatArray,
    offset_s: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    r"""Difference of two cameras' tangent planes.

    With the angles :math:`\phi_1, \phi_2` of corresponding tangent planes and the speeds
    :math:`s_1, s_2` of their tangent points, px per rad, the error is

    .. math:: e = \pm \frac{\phi_2 - \phi_1}{\sqrt{1 / (2 s_1^2) + 1 / (2 s_2^2)}}

    Args:
        moments_s: (M,) float64, s, times of comparison. Angles are interpolated between frames.
        offset_s: Clock offset of each camera: its frame of time t was taken at t - offset.

    Returns:
        (M, 2) float64, px, for both planes: distance by which the first camera's outline exceeds
        the second's; NaN where one of them does not determine it.
    """
    baseline = second.camera.center_m - first.camera.center_m
    length = float(np.linalg.norm(baseline))
    if length < 1e-6:
        return np.full((len(moments_s), 2), np.nan)
    baseline = baseline / length
    zero = second.toward_body()
    angles, speeds = [], []
    for track, offset in zip((first, second), offset_s, strict=True):
        angle, speed = track.cached_tangent_angles(baseline, zero)
        angles.append(interpolate(track.time_s, angle, moments_s + offset))
        speeds.append(interpolate(track.time_s, speed, moments_s + offset))
    difference = (angles[1] - angles[0] + np.pi) % (2 * np.pi) - np.pi
    return difference * [1, -1] / np.sqrt(0.5 / speeds[0] ** 2 + 0.5 / speeds[1] ** 2)


def interpolate(time_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    """Values (T, K) interpolated at times (M,); NaN outside the track and next to a needed NaN."""
    index = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, max(0, len(time_s) - 2))
    after = np.minimum(index + 1, len(time_s) - 1)
    span = np.where(after > index, time_s[after] - time_s[index], 1.0)
    fraction = (at_s - time_s[index]) / span
    fraction[np.abs(fraction) < 1e-6] = 0.0
    fraction[np.abs(fraction - 1) < 1e-6] = 1.0
    outside = (fraction < 0) | (fraction > 1)
    left, right = values[index], values[after]
    fraction = fraction[:, None]
    interpolated = np.where(
        fraction == 0,
        left,
        np.where(fraction == 1, right, (1 - fraction) * left + fraction * right),
    )
    interpolated[outside] = np.nan
    return interpolated


def offset_grid(max_offset_s: float, step_s: float) -> FloatArray:
    """Multiples of a step, s, up to a largest offset in both directions."""
    count = int(max_offset_s / step_s)
    return np.arange(-count, count + 1, dtype=np.float64) * step_s


PairErrors = Mapping[tuple[str, str], FloatArray]


def all_tangencies(
    tracks: Sequence[OutlineTrack],
    moments_s: FloatArray,
    offset_s: Mapping[str, float] | None = None,
) -> dict[tuple[str, str], FloatArray]:
    """`tangency` (M, 2) of every pair of cameras, by their names."""
    offset = offset_s or {}
    return {
        (a.camera.name, b.camera.name): tangency(
            a, b, moments_s, (offset.get(a.camera.name, 0.0), offset.get(b.camera.name, 0.0))
        )
        for index, a in enumerate(tracks)
        for b in tracks[index + 1 :]
    }
