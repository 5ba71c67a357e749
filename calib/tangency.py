"""Epipolar tangency: what two cameras' outlines of one body say about each other.

A plane through two cameras' centres that touches a body touches its outline in both pictures.
Turned about the line between the centres (the baseline), the first and the last such plane that
meet the body have to be the same, seen from either camera. This holds
for bodies of any shape, needs no correspondences, and errs to both sides: an outline that is a
pixel too far out is as visible as one that is a pixel short. It needs calibrated cameras, and
extremes of the outline that lie within the picture.

Source: Åström, Cipolla and Giblin, Generalised epipolar constraints; Sinha, Pollefeys and McMillan,
Camera network calibration from dynamic silhouettes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.checks import check_array
from calib.components import label_components

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]

_LEAST_PIXELS = 50
_GAP = 0.01  # of the image's diagonal
_LARGE_PIECE = 0.25  # of the largest piece's area
_NEAR_BORDER_PX = 1.5
_WIDEST_RAD = np.radians(
    150.0
)  # beyond, the baseline runs through or close by the body and nothing touches
_AROUND = 0.5 * np.array([[np.cos(angle), np.sin(angle)] for angle in np.arange(8) * np.pi / 4])
_REMEMBERED = 64
_LEAST_ACROSS = 0.05  # sine of a ray's angle to the baseline


@dataclass(frozen=True, eq=False)
class Outline:
    """The convex hull of one silhouette.

    Attributes: pixels: (N, 2) float64, px of the recorded image: the corners, half a pixel outside
        the outermost pixel centres. inside: (N,) bool: the corner is not at the image's border,
        beyond which the body may go on. middle: (2,) float64, px: median of the silhouette.
        height_px: from the lowest to the highest corner. area_px: of the silhouette.
    """

    pixels: FloatArray
    inside: NDArray[np.bool_]
    middle: FloatArray
    height_px: float
    area_px: float

    @classmethod
    def from_mask(cls, camera: Camera, mask: Mask) -> "Outline | None":
        """Measures a silhouette.

        Args:
            camera: Its camera.
            mask: (H, W) bool, of the camera's image or of the same scaled down.

        Returns:
            The outline of its large pieces; None where nobody is seen.

        Raises:
            ValueError: The silhouette has another shape than the camera's image.
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
        body = body_pieces(mask)
        contours, _ = cv2.findContours(
            body.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
        )
        edge = np.concatenate(contours).reshape(-1, 2)
        border = (np.minimum(edge, np.array(mask.shape[::-1]) - 1 - edge) < _NEAR_BORDER_PX).any(
            axis=1
        )
        points = ((edge[:, None] + _AROUND).reshape(-1, 2) + 0.5) / scale - 0.5
        straight = camera.undistort(points)  # only there are lines straight
        known = np.flatnonzero(np.isfinite(straight).all(axis=1))
        if len(known) < 3:
            return None
        corners = known[
            np.asarray(
                cv2.convexHull(straight[known].astype(np.float32), returnPoints=False),
                dtype=np.int64,
            ).ravel()
        ]
        row, column = np.nonzero(body)
        middle = (np.array([np.median(column), np.median(row)]) + 0.5) / scale - 0.5
        pixels = points[corners]
        inside = ~np.repeat(border, len(_AROUND))[corners]
        return cls(
            pixels, inside, middle, float(np.ptp(pixels[:, 1])), len(row) / float(np.prod(scale))
        )


def body_pieces(mask: Mask) -> Mask:
    """Returns the large pieces of a silhouette: a body is one or a few, flicker and shadows are
    many small ones.

    Pieces that are a hundredth of the image apart count as one, for limbs come off where clothes
    look like the background.
    """
    reach = int(_GAP * np.hypot(*mask.shape)) | 1
    thick = cv2.dilate(
        mask.astype(np.uint8), cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach))
    )
    labels = label_components(thick.view(bool)).labels
    area = np.bincount(labels[mask])
    large = np.flatnonzero(area >= _LARGE_PIECE * area.max())
    return mask & np.isin(labels, large)


@dataclass(frozen=True, eq=False)
class OutlineTrack:
    """One camera's outlines in time.

    Attributes:
        camera: The camera.
        time_s: (T,) float64, increasing: when its frames were taken, by its own clock.
        outlines: T; None where nobody is seen.
    """

    camera: Camera
    time_s: FloatArray
    outlines: tuple[Outline | None, ...]

    @classmethod
    def from_masks(
        cls, camera: Camera, time_s: FloatArray, masks: Sequence[Mask]
    ) -> "OutlineTrack":
        """Measures silhouettes (H, W) bool."""
        return cls(
            camera,
            np.asarray(time_s, dtype=np.float64),
            tuple(Outline.from_mask(camera, mask) for mask in masks),
        )

    @property
    def seen(self) -> NDArray[np.bool_]:
        """(T,) bool: somebody is seen."""
        return np.array([outline is not None for outline in self.outlines], dtype=bool)

    def with_camera(self, camera: Camera) -> "OutlineTrack":
        """Returns the same outlines as another camera's, which may stand or look elsewhere."""
        track = replace(self, camera=camera)
        same = camera.matrix is self.camera.matrix or np.array_equal(
            camera.matrix, self.camera.matrix
        )
        if same and camera.distortion.tobytes() == self.camera.distortion.tobytes():
            track.__dict__.update(_corners=self._corners, _toward_body=self._toward_body)
        return track

    @cached_property
    def _corners(self) -> tuple[FloatArray, NDArray[np.int64], NDArray[np.bool_]]:
        """Rays (N, 3) of all corners in the camera's frame, the moment of each, and whether it is
        inside.
        """
        known = [(at, outline) for at, outline in enumerate(self.outlines) if outline is not None]
        if not known:
            return np.zeros((0, 3)), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool)
        _, rays = self.camera.rays(np.concatenate([outline.pixels for _, outline in known]))
        moment = np.repeat([at for at, _ in known], [len(outline.pixels) for _, outline in known])
        inside = np.concatenate([outline.inside for _, outline in known])
        good = np.isfinite(rays).all(axis=1)
        return (rays @ self.camera.rotation.T)[good], moment[good], inside[good]

    def near(self, at_s: FloatArray) -> "OutlineTrack":
        """Returns the same track with only those frames that `between` needs at these times (M,)."""
        after = np.searchsorted(self.time_s, at_s + 1e-6 * np.sign(at_s))
        needed = np.unique(np.clip(after[:, None] + [-2, -1, 0, 1], 0, len(self.time_s) - 1))
        return replace(
            self, time_s=self.time_s[needed], outlines=tuple(self.outlines[at] for at in needed)
        )

    def toward_body(self) -> FloatArray:
        """Returns the direction (3,), world, in which its bodies are, the median over time."""
        return self.camera.rotation.T @ self._toward_body

    def touching_once(
        self, baseline: FloatArray, zero: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """As `touching`, remembered: while one camera is looked for, the others are asked the same
        again and again.
        """
        memory: dict[bytes, tuple[FloatArray, FloatArray]] = self.__dict__.setdefault("_memory", {})
        key = baseline.tobytes() + zero.tobytes()
        if key not in memory:
            if len(memory) >= _REMEMBERED:
                memory.clear()
            memory[key] = self.touching(baseline, zero)
        return memory[key]

    @cached_property
    def _toward_body(self) -> FloatArray:
        """In the camera's frame."""
        middles = np.array(
            [outline.middle for outline in self.outlines if outline is not None]
        ).reshape(-1, 2)
        rays = self.camera.rays(middles)[1] @ self.camera.rotation.T
        return np.nanmedian(rays, axis=0) if np.isfinite(rays).any() else np.array([0, 0, 1.0])

    def touching(self, baseline: FloatArray, zero: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Turns a plane about a baseline through the camera until it touches its outlines.

        Args:
            baseline: (3,) unit vector, world.
            zero: (3,) vector, world: the plane of angle zero holds it.

        Returns: Angles (T, 2), rad, of the first and the last plane, NaN where the outline does not
            say; and how far (T, 2) the touching point moves in the picture, px per rad.
        """
        shape = (len(self.outlines), 2)
        angle, speed = np.full(shape, np.nan), np.full(shape, np.nan)
        corners, moment, inside = self._corners
        if not len(corners):
            return angle, speed
        first = zero - (zero @ baseline) * baseline
        first /= max(float(np.linalg.norm(first)), 1e-12)
        axes = self.camera.rotation @ np.column_stack([first, np.cross(baseline, first)])
        beside = corners @ axes
        across = np.hypot(beside[:, 0], beside[:, 1])
        around = np.arctan2(beside[:, 1], beside[:, 0])
        starts = np.flatnonzero(np.diff(moment, prepend=-1))
        segment = np.cumsum(np.diff(moment, prepend=-1) > 0) - 1
        # Counted from each outline's first corner, so that nothing wraps within one.
        turn = (
            around[starts][segment]
            + (around - around[starts][segment] + np.pi) % (2 * np.pi)
            - np.pi
        )
        low, high = np.minimum.reduceat(turn, starts), np.maximum.reduceat(turn, starts)
        focal = float(np.sqrt(self.camera.matrix[0, 0] * self.camera.matrix[1, 1]))
        for side, extreme in enumerate((low, high)):
            at = np.flatnonzero(turn == extreme[segment])
            at = at[np.unique(segment[at], return_index=True)[1]]
            good = inside[at] & (high - low < _WIDEST_RAD) & (across[at] > _LEAST_ACROSS)
            angle[moment[starts][good], side] = extreme[good]
            speed[moment[starts][good], side] = focal * across[at][good]
        return angle, speed


def tangency(
    first: OutlineTrack,
    second: OutlineTrack,
    moments_s: FloatArray,
    late_s: tuple[float, float] = (0.0, 0.0),
) -> FloatArray:
    """Measures by how much two cameras' touching planes differ.

    Args:
        first: One camera's outlines.
        second: Another's.
        moments_s: (M,) float64, s: when to look. Between two frames, angles are interpolated.
        late_s: By how much each camera's clock is ahead: its frame of time t was taken at t - late.

    Returns: (M, 2) float64, px, for both planes: by how much the first camera's outline reaches
        beyond the second's; NaN where one of them does not say.
    """
    baseline = second.camera.center_m - first.camera.center_m
    length = float(np.linalg.norm(baseline))
    if length < 1e-6:
        return np.full((len(moments_s), 2), np.nan)
    baseline = baseline / length
    zero = second.toward_body()
    angles, speeds = [], []
    for track, late in zip((first, second), late_s, strict=True):
        angle, speed = track.touching_once(baseline, zero)
        angles.append(between(track.time_s, angle, moments_s + late))
        speeds.append(between(track.time_s, speed, moments_s + late))
    apart = (angles[1] - angles[0] + np.pi) % (2 * np.pi) - np.pi
    return apart * [1, -1] / np.sqrt(0.5 / speeds[0] ** 2 + 0.5 / speeds[1] ** 2)


def between(time_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    """Interpolates values (T, K) in time; NaN beyond the ends and beside a NaN that is needed."""
    index = np.clip(np.searchsorted(time_s, at_s, side="right") - 1, 0, max(0, len(time_s) - 2))
    after = np.minimum(index + 1, len(time_s) - 1)
    span = np.where(after > index, time_s[after] - time_s[index], 1.0)
    share = (at_s - time_s[index]) / span
    share[np.abs(share) < 1e-6] = 0.0
    share[np.abs(share - 1) < 1e-6] = 1.0
    outside = (share < 0) | (share > 1)
    left, right = values[index], values[after]
    share = share[:, None]
    mixed = np.where(
        share == 0, left, np.where(share == 1, right, (1 - share) * left + share * right)
    )
    mixed[outside] = np.nan
    return mixed


PairErrors = Mapping[tuple[str, str], FloatArray]


def all_tangencies(
    tracks: Sequence[OutlineTrack], moments_s: FloatArray, late_s: Mapping[str, float] | None = None
) -> dict[tuple[str, str], FloatArray]:
    """Measures every two cameras' `tangency` (M, 2), by their names."""
    late = late_s or {}
    return {
        (a.camera.name, b.camera.name): tangency(
            a, b, moments_s, (late.get(a.camera.name, 0.0), late.get(b.camera.name, 0.0))
        )
        for index, a in enumerate(tracks)
        for b in tracks[index + 1 :]
    }
