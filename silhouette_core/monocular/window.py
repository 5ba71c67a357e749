"""Virtual camera turned toward the person, whose view compares with the library's silhouettes.

The library shows every pose from one distance, with the silhouette's centroid in the middle. An
observed silhouette is brought into the same form: a level camera at the same position is turned
until the centroid lies on its axis, and zoomed until a body of the library's stature at the assumed
distance has the library's size. Beyond paper A, whose person stays in one place.
"""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray, ByteArray, FloatArray, RealArray, check_array
from silhouette_core.image.cleanup import reduce_silhouette

SIZE = (320, 240)  #: (width, height) of the window, px.
STATURE_PX = 158  #: Stature of a body at the assumed distance, px: the library's scale.
_OVERSAMPLE = 2
_TURNS = 3  # the third turn moves the centroid by less than a pixel
_CENTER = np.array([(SIZE[0] - 1) / 2, (SIZE[1] - 1) / 2])


@dataclass(frozen=True, eq=False)
class Window:
    """An observed silhouette in the form of the library's."""

    mask: BoolArray  #: (240, 320) bool, the silhouette.
    seen: BoolArray  #: (240, 320) bool, where the camera's picture reaches, so that it is known.
    world_from_virtual: FloatArray
    """(3, 3) float64, the virtual camera's orientation (x right, level; y down; z forward)."""
    center_m: FloatArray  #: (3,) float64, the camera's place in the world.
    focal_px: float  #: of the virtual camera.
    axis_px: FloatArray  #: (2,) float64, where its optical axis meets the picture.
    distance_m: float  #: assumed distance of the person.

    @property
    def pitch_rad(self) -> float:
        """Angle of the virtual camera's axis below the horizontal."""
        return float(np.arcsin(np.clip(-self.world_from_virtual[2, 2], -1.0, 1.0)))

    @property
    def heading_rad(self) -> float:
        """Heading about the vertical of a body that faces this camera (0: toward -y)."""
        toward_x, toward_y = -self.world_from_virtual[0, 2], -self.world_from_virtual[1, 2]
        return float(np.arctan2(toward_x, -toward_y))

    def unproject(self, pixel: RealArray, distance_m: float) -> FloatArray:
        """World points (N, 3), m, at pixels (N, 2) and a distance along the optical axis."""
        offset = (np.atleast_2d(pixel) - self.axis_px) / self.focal_px
        rays = np.concatenate([offset, np.ones((len(offset), 1))], axis=1)
        return self.center_m + distance_m * rays @ self.world_from_virtual.T

    def weighed(
        self, reduction: int, weights_of: Callable[[BoolArray], RealArray]
    ) -> tuple[BoolArray, FloatArray]:
        """The silhouette (h, w) bool at full, half or quarter size (`reduction` 1, 2, 4) and the
        weights (h, w) float64 of its pixels; 0 where the camera does not reach: what it does not
        show speaks neither for nor against a pose.
        """
        mask, seen = self.mask, self.seen
        for _ in range(int(np.log2(reduction))):
            mask, seen = reduce_silhouette(mask), reduce_silhouette(seen)
        return mask, np.where(seen, weights_of(mask), np.float32(0.0)).astype(np.float64)


def look_at(camera: Camera, mask: BoolArray, distance_m: float, pixels_per_metre: float) -> Window:
    """Window of a virtual camera that is turned toward a silhouette. Raises ValueError where the
    silhouette is empty, or of another size than the camera's.

    Args:
        camera: pinhole camera without distortion, of size (w, h).
        mask: (h, w) bool, the silhouette, not empty.
        distance_m: assumed distance of the person along the virtual optical axis.
        pixels_per_metre: scale of the library's silhouettes at that distance.

    Returns:
        The window. Its silhouette's centroid is within half a pixel of the middle.
    """
    check_array("mask", mask, camera.size[::-1])
    if not mask.any():
        raise ValueError("mask must not be empty")
    focal = pixels_per_metre * distance_m
    picture = _Picture.from_mask(mask)
    camera_from_virtual = _turned(camera, picture.centroid_px)
    half = SIZE[0] // 2, SIZE[1] // 2
    for _ in range(_TURNS):
        coarse = picture.seen_by(camera, camera_from_virtual, focal / 2, half)
        if not coarse.any():
            break
        off = (_centroid(coarse) - ((half[0] - 1) / 2, (half[1] - 1) / 2)) / (focal / 2)
        if np.abs(off).max() * focal < 0.5:
            break
        ray = camera_from_virtual @ np.array([off[0], off[1], 1.0])
        target = camera.matrix[:2, :2] @ (ray[:2] / ray[2]) + camera.matrix[:2, 2]
        camera_from_virtual = _turned(camera, target)
    warped = picture.seen_by(camera, camera_from_virtual, focal, SIZE)
    return Window(
        warped,
        _reach(camera, camera_from_virtual, focal),
        camera.rotation.T @ camera_from_virtual,
        camera.center_m,
        focal,
        _CENTER.copy(),
        distance_m,
    )


@dataclass(frozen=True, eq=False)
class _Picture:
    """A silhouette's own rectangle of a camera's image."""

    crop: ByteArray  #: (h, w) uint8, 0 or 255.
    left_top: tuple[int, int]  #: its upper left pixel (x, y).
    centroid_px: FloatArray  #: of the silhouette in the whole image.

    @classmethod
    def from_mask(cls, mask: BoolArray) -> "_Picture":
        """Cuts out a silhouette (h, w) bool that is not empty."""
        left, top, width, height = cv2.boundingRect(mask.view(np.uint8))
        crop = mask[top : top + height, left : left + width]
        return cls(
            crop.astype(np.uint8) * 255, (left, top), _centroid(crop) + np.array([left, top])
        )

    def seen_by(
        self, camera: Camera, camera_from_virtual: FloatArray, focal: float, size: tuple[int, int]
    ) -> BoolArray:
        """The silhouette (h, w) bool as a virtual camera sees it.

        Only where it can be in the virtual image is that computed.
        """
        matrix = _camera_from_window(camera, camera_from_virtual, focal, size)
        height, width = self.crop.shape
        x, y = self.left_top
        edges = np.array([[x - 1, x + width], [y - 1, y + height]], float)
        corners = np.array([[a, b, 1.0] for a in edges[0] for b in edges[1]]).T
        u, v, w = np.linalg.inv(matrix) @ corners
        seen = np.zeros(size[::-1], bool)
        left, top, right, bottom = 0, 0, *size
        # The four corners are before the virtual camera: so is all between them.
        if w.min() > 1e-9 or w.max() < -1e-9:
            u, v = u / w / _OVERSAMPLE, v / w / _OVERSAMPLE
            left, top = (int(max(np.floor(one.min()) - 1, 0)) for one in (u, v))
            right, bottom = (
                int(min(np.ceil(one.max()) + 2, limit))
                for one, limit in zip((u, v), size, strict=True)
            )
        if left >= right or top >= bottom:
            return seen
        from_part = np.array(
            [[1.0, 0.0, _OVERSAMPLE * left], [0.0, 1.0, _OVERSAMPLE * top], [0.0, 0.0, 1.0]]
        )
        into_crop = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y], [0.0, 0.0, 1.0]])
        part = _warped(self.crop, into_crop @ matrix @ from_part, (right - left, bottom - top))
        seen[top:bottom, left:right] = part
        return seen


def _reach(camera: Camera, camera_from_virtual: FloatArray, focal: float) -> BoolArray:
    """Where in the window (240, 320) the camera's picture reaches."""
    matrix = _camera_from_window(camera, camera_from_virtual, focal, SIZE)
    width, height = SIZE[0] * _OVERSAMPLE - 1, SIZE[1] * _OVERSAMPLE - 1
    u, v, w = matrix @ np.array([[0, width, 0, width], [0, 0, height, height], [1, 1, 1, 1.0]])
    if w.min() > 0:
        u, v, (right, bottom) = u / w, v / w, camera.size
        if min(u.min(), v.min()) > 0 and u.max() < right - 1 and v.max() < bottom - 1:
            return np.ones(SIZE[::-1], bool)
    return _warped(np.full(camera.size[::-1], 255, np.uint8), matrix, SIZE)


def _centroid(mask: BoolArray) -> FloatArray:
    moments = cv2.moments(mask.astype(np.uint8), binaryImage=True)
    return np.array([moments["m10"], moments["m01"]]) / moments["m00"]


def _turned(camera: Camera, pixel: FloatArray) -> FloatArray:
    """Rotation camera_from_virtual (3, 3) of the level camera that looks along a pixel's ray."""
    forward = np.linalg.solve(camera.matrix, np.array([pixel[0], pixel[1], 1.0]))
    forward /= np.linalg.norm(forward)
    up = camera.rotation[:, 2]  # the world's vertical as the camera sees it
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 0.05:  # looking straight down or up: no direction is level
        right = np.cross(forward, [0.0, -1.0, 0.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward], axis=1)


def _camera_from_window(
    camera: Camera, camera_from_virtual: FloatArray, focal: float, size: tuple[int, int]
) -> FloatArray:
    """Homography (3, 3) from the samples of a virtual camera's pixels to pixels of a camera."""
    width, height = size
    fine = _OVERSAMPLE
    virtual = np.array(
        [
            [focal * fine, 0.0, (width * fine - 1) / 2],
            [0.0, focal * fine, (height * fine - 1) / 2],
            [0.0, 0.0, 1.0],
        ]
    )
    return camera.matrix @ camera_from_virtual @ np.linalg.inv(virtual)


def _warped(picture: ByteArray, from_samples: FloatArray, size: tuple[int, int]) -> BoolArray:
    """Picture through a homography from samples; each pixel is the majority of its samples."""
    wide = cv2.warpPerspective(
        picture,
        from_samples,
        (size[0] * _OVERSAMPLE, size[1] * _OVERSAMPLE),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
    )
    return cv2.resize(wide, size, interpolation=cv2.INTER_AREA) > 127
