"""Cameras and rigs: projection, viewing rays and undistortion.

World: metres, right-handed, z up. Camera as in OpenCV: x right, y down, z forward, `x_camera =
rotation @ x_world + translation`. Integer pixel coordinates are pixel centres. A point that a
camera cannot see (behind it, or outside the field in which its lens model is one to one) has NaN
pixels, and a pixel without a ray has a NaN ray.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.checks import FloatArray, float_array, image_size
from calib.errors import InputError
from calib.lens import FisheyeLens, RationalLens

_COUNTS = (0, 4, 5, 8, 12, 14)


def _read_only(name: str, value: ArrayLike, shape: tuple[int | str, ...]) -> FloatArray:
    """Returns a read-only float64 copy of finite numbers."""
    array = float_array(name, value, shape, finite=True).copy()
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class Camera:
    """One calibrated camera. ValueError where a value has the wrong shape, is not finite, or is
    impossible.
    """

    name: str  #: Name, unique in its rig.
    size: tuple[int, int]  #: Image (width, height), px.
    matrix: FloatArray
    """(3, 3) float64, upper triangular, px. A skew is respected (OpenCV ignores it)."""
    distortion: FloatArray
    """(n,) float64 in OpenCV's order: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 tx ty, n = 0, 4, 5, 8, 12
    or 14; k1 k2 k3 k4 if `fisheye`."""
    rotation: FloatArray  #: (3, 3) float64, camera from world.
    translation: FloatArray  #: (3,) float64, m, camera from world.
    fisheye: bool = False  #: Whether `distortion` belongs to OpenCV's fisheye model.

    def __post_init__(self) -> None:
        who = f"camera {self.name}: "
        matrix = _read_only(who + "matrix", self.matrix, (3, 3))
        if matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
            raise ValueError(
                f"{who}focal lengths must be positive, got {matrix[0, 0]:g} and {matrix[1, 1]:g}"
            )
        if np.any(matrix[[1, 2, 2], [0, 0, 1]] != 0) or matrix[2, 2] != 1:
            raise ValueError(
                f"{who}matrix must be [[fx, s, cx], [0, fy, cy], [0, 0, 1]], got {matrix.tolist()}"
            )
        distortion = _read_only(who + "distortion", self.distortion, ("n",))
        counts = (4,) if self.fisheye else _COUNTS
        if len(distortion) not in counts:
            raise ValueError(
                f"{who}distortion must have {' or '.join(map(str, counts))} numbers, got"
                f" {len(distortion)}"
            )
        rotation = _read_only(who + "rotation", self.rotation, (3, 3))
        error = np.abs(rotation @ rotation.T - np.eye(3)).max()  # files round to a few digits
        if error > 1e-3 or np.linalg.det(rotation) < 0:
            raise ValueError(
                f"{who}rotation must be a rotation (orthonormal, determinant +1), got"
                f" {rotation.tolist()}"
            )
        for key, value in (
            ("size", image_size(who + "size", self.size)),
            ("matrix", matrix),
            ("distortion", distortion),
            ("rotation", rotation),
            ("translation", _read_only(who + "translation", self.translation, (3,))),
        ):
            object.__setattr__(self, key, value)

    @cached_property
    def lens(self) -> RationalLens | FisheyeLens:
        """The lens between normalised and distorted coordinates."""
        return FisheyeLens(self.distortion) if self.fisheye else RationalLens(self.distortion)

    @property
    def center_m(self) -> FloatArray:
        """(3,) float64, m: the centre of projection in the world."""
        return -self.rotation.T @ self.translation

    @property
    def projection(self) -> FloatArray:
        """(3, 4) float64: K [R | t], the pinhole part, from world metres to homogeneous pixels."""
        return self.matrix @ np.column_stack([self.rotation, self.translation])

    @property
    def view_deg(self) -> float:
        """Angle between the middles of the image's left and right edges, degrees."""
        edges = np.array([[-0.5, self.matrix[1, 2]], [self.size[0] - 0.5, self.matrix[1, 2]]])
        left, right = self.rays(edges)[1]
        return float(np.degrees(np.arccos(np.clip(left @ right, -1, 1))))

    @property
    def is_pinhole(self) -> bool:
        """Whether the lens has no distortion."""
        return not self.fisheye and not self.distortion.any()

    def turned(self, turn: FloatArray, shift_m: FloatArray | float = 0.0) -> "Camera":
        """A camera that has what is at x before this one at turn x + shift, m, before it."""
        translation = turn @ self.translation + shift_m
        return replace(self, rotation=turn @ self.rotation, translation=translation)

    def in_world(self, turn: FloatArray, shift_m: FloatArray) -> "Camera":
        """The same camera in a world in which a point x of this one is at turn x + shift, m."""
        rotation = self.rotation @ turn.T
        return replace(self, rotation=rotation, translation=self.translation - rotation @ shift_m)

    def project(self, points_world: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Projects world points (N, 3), m, into the image plane.

        Pixels outside the image are returned as well.

        Returns:
            Pixels (N, 2) float64, NaN where the camera cannot see the point, and depth along the
            optical axis (N,) float64, m.
        """
        points_camera = (
            float_array("points_world", points_world, ("N", 3)) @ self.rotation.T + self.translation
        )
        depth_m = points_camera[:, 2].copy()
        with np.errstate(divide="ignore", invalid="ignore"):
            normalised = points_camera[:, :2] / depth_m[:, None]
        normalised[~(depth_m > 0)] = np.nan
        return self._pixels(self.lens.distort(normalised)), depth_m

    def rays(self, pixels: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Casts viewing rays through pixels (N, 2), x and y, px, of the recorded image.

        Returns:
            Origin (3,) float64, m, and directions (N, 3) float64, unit length, in the world; NaN
            where no ray meets the pixel.
        """
        normalised = self.lens.undistort(self._normalised(float_array("pixels", pixels, ("N", 2))))
        directions = np.column_stack([normalised, np.ones(len(normalised))]) @ self.rotation
        return self.center_m, directions / np.linalg.norm(directions, axis=1, keepdims=True)

    def undistort(self, pixels: ArrayLike) -> FloatArray:
        """Undistorted pixels (N, 2) float64 of recorded pixels (N, 2), for the same matrix."""
        return self._pixels(
            self.lens.undistort(self._normalised(float_array("pixels", pixels, ("N", 2))))
        )

    def pinhole(self, scale: float = 1.0) -> "Camera":
        """Returns the same camera without distortion, its image scaled by `scale`."""
        if not scale > 0:
            raise ValueError(f"scale must be positive, got {scale}")
        # Pixel centres are integers, so the image's corner is at -0.5 and scales about that.
        half = 0.5 * (scale - 1)
        scaling = np.array([[scale, 0, half], [0, scale, half], [0, 0, 1.0]])
        size = (max(1, round(self.size[0] * scale)), max(1, round(self.size[1] * scale)))
        return replace(
            self, size=size, matrix=scaling @ self.matrix, distortion=np.zeros(0), fisheye=False
        )

    def pinhole_maps(self, scale: float = 1.0) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Maps with which `cv2.remap` undistorts an image to that of `pinhole(scale)`.

        Returns:
            map_x and map_y, each (height, width) float32, px of the recorded image; -1 (outside)
            where the lens sees nothing.
        """
        ideal = self.pinhole(scale)
        width, height = ideal.size
        x, y = np.meshgrid(np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64))
        recorded = self._pixels(
            self.lens.distort(ideal._normalised(np.column_stack([x.ravel(), y.ravel()])))
        )
        recorded[np.isnan(recorded).any(axis=1)] = -1
        maps = recorded.astype(np.float32).reshape(height, width, 2)
        return np.ascontiguousarray(maps[..., 0]), np.ascontiguousarray(maps[..., 1])

    def _pixels(self, distorted: FloatArray) -> FloatArray:
        """Applies the camera matrix to (N, 2) normalised coordinates."""
        return distorted @ self.matrix[:2, :2].T + self.matrix[:2, 2]

    def _normalised(self, pixels: FloatArray) -> FloatArray:
        """Applies the inverse of the camera matrix to (N, 2) pixels."""
        y = (pixels[:, 1] - self.matrix[1, 2]) / self.matrix[1, 1]
        x = (pixels[:, 0] - self.matrix[0, 2] - self.matrix[0, 1] * y) / self.matrix[0, 0]
        return np.column_stack([x, y])


@dataclass(frozen=True, eq=False)
class Rig:
    """Cameras calibrated in one world, accessible by name. ValueError where there is no camera, or
    two have one name.
    """

    cameras: tuple[Camera, ...]
    notes: tuple[str, ...] = ()  #: What its file holds and the rig does not, for messages.

    def __post_init__(self) -> None:
        object.__setattr__(self, "cameras", tuple(self.cameras))
        if not self.cameras:
            raise ValueError("a rig needs at least one camera")
        repeated = sorted({name for name in self.names if self.names.count(name) > 1})
        if repeated:
            raise ValueError(
                f"camera names must differ, but these appear more than once: {', '.join(repeated)}"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """The cameras' names, in order."""
        return tuple(camera.name for camera in self.cameras)

    def __getitem__(self, name: str) -> Camera:
        for camera in self.cameras:
            if camera.name == name:
                return camera
        raise KeyError(f"no camera {name!r} among {', '.join(self.names)}")

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[Camera]:
        return iter(self.cameras)

    def __len__(self) -> int:
        return len(self.cameras)

    def select(self, names: Sequence[str]) -> "Rig":
        """Returns the rig of the named cameras, in that order. InputError where a name is not in
        the rig, or there is none.
        """
        if not names:
            raise InputError(f"no camera is chosen: the rig has {', '.join(self.names)}")
        missing = [name for name in names if name not in self.names]
        if missing:
            raise InputError(
                f"no calibration for {', '.join(missing)}: the rig has {', '.join(self.names)}"
            )
        return Rig(tuple(self[name] for name in names))
