"""Common parts of the calibration formats: units, validated numbers, and error messages."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np

from calib.camera import Camera, FloatArray, Rig
from calib.errors import InputError
from calib.rotation import matrix_from_quaternion, matrix_from_rodrigues, nearest_rotation

METRES = {"m": 1, "cm": 1 / 100, "mm": 1 / 1000}
_REMEDY = "mend the file or calibrate this camera again"
# What no real camera has; within these, sums and products of all values stay finite.
_LARGEST = {"matrix": 10_000_000, "distortions": 10_000_000}
_FARTHEST_M = 100_000
_LONGEST_SIDE_PX = 30_000
_LARGEST_IMAGE_PX = 100_000_000
_LONGEST_NAME = 200
_PICTURES = frozenset(".jpg .jpeg .png .tif .tiff .bmp .webp .mp4 .mov .avi .mkv".split())


@dataclass(frozen=True)
class Source:
    """A calibration file to be read, with values that the file may lack."""

    path: Path
    unit: str | None = None
    """Unit of its lengths ("m", "cm" or "mm") as given by the caller, or None."""
    size: tuple[int, int] | None = None
    """Image (width, height), px, as given by the caller, or None."""
    cameras: Sequence[str] | None = None
    """Names of the cameras that are wanted; None for all. One that is not may lack its position."""
    lenses: bool = False  #: Whether lenses alone are wanted: positions and the unit may be missing.

    def error(self, message: str, camera: str | None = None) -> InputError:
        """Error with a message of one line that names the file and the camera."""
        whose = "" if camera is None else f"camera {camera[:_LONGEST_NAME]}: "
        return InputError(" ".join(f"{self.path}: {whose}{message}".split()))

    def metres_per_unit(self, stated: object, remedy: str) -> float:
        """Length of the file's unit in metres. InputError where no unit is given, it is unknown, or
        the file and the caller differ.

        Args:
            remedy: How a unit is written in this format.
        """
        unit = self.unit if stated is None else stated
        if unit is None and self.lenses:
            return 1
        if unit is None:
            raise self.error(
                f"in which unit are its lengths? {remedy} or pass --unit m|cm|mm (Pose2Sim writes"
                " m, FreeMoCap mm)"
            )
        if not isinstance(unit, str) or unit not in METRES:
            raise self.error(f"unit must be m, cm or mm, not {brief(unit)}: {remedy}")
        if self.unit is not None and self.unit != unit:
            raise self.error(
                f"the file says its unit is {unit}, --unit says {self.unit}: leave --unit out or"
                " correct the file"
            )
        return METRES[unit]

    def numbers(
        self, camera: str, key: str, value: object, shape: tuple[int, ...] | None = None
    ) -> FloatArray:
        """Finite float64 numbers of a given shape. InputError where the value is missing, not
        numbers, not finite, or has another shape.

        Args:
            value: The value; lists nested one level deeper than needed are accepted.
            shape: Required shape; None for any number of values, flat.
        """
        if value is None:
            raise self.error(f"{key} is missing: {_REMEDY}", camera)
        try:
            array = np.array(value, dtype=np.float64)
        except (TypeError, ValueError, OverflowError):
            raise self.error(
                f"{key} must be numbers, got {brief(value)}: {_REMEDY}", camera
            ) from None
        count = array.size if shape is None else int(np.prod(shape))
        if array.size != count or (
            shape is not None and len(shape) == 2 and array.ndim == 2 and array.shape != shape
        ):
            raise self.error(f"{key} must have shape {shape}, got {array.shape}: {_REMEDY}", camera)
        if not np.isfinite(array).all():
            raise self.error(f"{key} holds a NaN or infinite number: {_REMEDY}", camera)
        if array.size and np.abs(array).max() > _LARGEST.get(key, 1e12):
            raise self.error(
                f"{key} holds {np.abs(array).max():.3g}, which no camera has: {_REMEDY}", camera
            )
        return array.reshape(-1 if shape is None else shape)

    def camera(self, name: str, values: Mapping[str, Any], metres_per_unit: float) -> Camera | None:
        """Camera from raw values; None where it has no position and is not wanted. InputError where
        a value is missing or wrong.

        Args:
            values: `size`, `matrix`, `distortions`, `rotation` (Rodrigues or matrix), `translation`
                and optionally `fisheye`.
            metres_per_unit: Length of the translation's unit, m.
        """
        if values.get("rotation") is None and values.get("translation") is None:
            if not self.lenses:
                return self._refuse_unposed(name)
            values = {**values, "rotation": np.eye(3), "translation": np.zeros(3)}
        size = self.image_size(name, values.get("size"))
        matrix = self.numbers(name, "matrix", values.get("matrix"), (3, 3))
        shortest_px = min(matrix[0, 0], matrix[1, 1])
        if 0 < shortest_px < 0.1:
            raise self.error(
                f"a focal length of {shortest_px:g} px is no camera's: {_REMEDY}", name
            )
        fisheye = values.get("fisheye", False)
        if not isinstance(fisheye, bool):
            raise self.error(f"fisheye must be true or false, got {brief(fisheye)}", name)
        distortion = self.numbers(name, "distortions", values.get("distortions"))
        if fisheye and len(distortion) == 5 and distortion[4] == 0:
            distortion = distortion[:4]  # some programs write five terms for fisheyes too
        translation = self.numbers(name, "translation", values.get("translation"), (3,))
        if np.abs(translation * metres_per_unit).max() > _FARTHEST_M:
            raise self.error(
                f"the camera is {np.abs(translation).max() * metres_per_unit / 1000:.3g} km away:"
                f" correct translation or the unit",
                name,
            )
        try:
            return Camera(
                name=name,
                size=size,
                matrix=matrix,
                distortion=distortion,
                rotation=self.rotation(name, values.get("rotation")),
                translation=translation * metres_per_unit,
                fisheye=fisheye,
            )
        except ValueError as error:
            raise self.error(f"{str(error)[:300]}: {_REMEDY}") from None

    def _refuse_unposed(self, name: str) -> None:
        """Refuses a camera without a position, unless it is left out."""
        if self.cameras is None or name in self.cameras:
            raise self.error(
                "has a lens and no position: `voxelpose calibrate extrinsics --intrinsics"
                f" {self.path}` finds positions; or leave it out with --cameras",
                name,
            )

    def lens(
        self, camera: str, values: Mapping[str, object], fisheye: bool = False
    ) -> dict[str, Any]:
        """Matrix and distortion, as `camera` takes them, of a lens whose numbers have names and
        count from the corner of the first pixel, half a pixel before its centre. InputError where a
        number is missing or is none.

        Args:
            values: `fx`, `fy`, `cx`, `cy`, px, or one focal length `f`; optionally `skew`, px, and
                OpenCV's terms `k1`, `p1` ...
        """
        terms = ("k1", "k2", "k3", "k4") if fisheye else ("k1", "k2", "p1", "p2", "k3")
        more = () if fisheye else ("k4", "k5", "k6")
        number = {
            key: self.numbers(camera, key, values.get(key, missing), (1,))[0]
            for keys, missing in ((("cx", "cy"), None), (("skew", *terms, *more), 0))
            for key in keys
        }
        fx, fy = (
            self.numbers(camera, key, values.get(key, values.get("f")), (1,))[0]
            for key in ("fx", "fy")
        )
        centre = number["cx"] - 0.5, number["cy"] - 0.5
        if any(number[key] for key in more):
            terms += more
        return {
            "matrix": [[fx, number["skew"], centre[0]], [0, fy, centre[1]], [0, 0, 1]],
            "distortions": [number[key] for key in terms],
            "fisheye": fisheye,
        }

    def rotation(self, camera: str, value: object) -> FloatArray:
        """Rotation (3, 3) from a Rodrigues vector (3 numbers, rad) or from a rounded matrix."""
        numbers = self.numbers(camera, "rotation", value)
        if numbers.size == 3:
            if np.linalg.norm(numbers) > 2 * np.pi + 1e-6:
                raise self.error(
                    f"rotation {numbers.tolist()} turns more than once: give a Rodrigues vector in"
                    " radians",
                    camera,
                )
            return matrix_from_rodrigues(numbers)
        if numbers.size != 9:
            raise self.error(
                f"rotation must be 3 (Rodrigues) or 9 (matrix) numbers, got {numbers.size}:"
                f" {_REMEDY}",
                camera,
            )
        given = numbers.reshape(3, 3)
        rotation = nearest_rotation(given)
        error = float(np.abs(given - rotation).max())
        if error > 1e-3:
            raise self.error(
                f"rotation is not a rotation matrix (off by {error:.2g}): {_REMEDY}", camera
            )
        # An exact rotation is kept as it is, to preserve its last digits.
        return rotation if error > 1e-12 else given

    def quaternion(self, camera: str, wxyz: object) -> FloatArray:
        """Rotation (3, 3) from a quaternion w, x, y, z, rounded or of another length."""
        numbers = self.numbers(camera, "quaternion", wxyz, (4,))
        if not numbers.any():
            raise self.error(f"quaternion 0 0 0 0 is no rotation: {_REMEDY}", camera)
        return matrix_from_quaternion(numbers)

    def image_size(self, camera: str, value: object) -> tuple[int, int]:
        """Image (width, height), from the file or else from the caller."""
        if value is None:
            if self.size is None:
                raise self.error(
                    "the image size is not in the file: state it (width and height in px), or give"
                    " `voxelpose calibrate convert` --size 1920x1080",
                    camera,
                )
            return self.size
        width, height = self.numbers(camera, "size", value, (2,)).tolist()
        if width != round(width) or height != round(height) or min(width, height) < 1:
            raise self.error(
                f"size must be width and height in whole pixels, got {brief(value)}", camera
            )
        if max(width, height) > _LONGEST_SIDE_PX or width * height > _LARGEST_IMAGE_PX:
            raise self.error(
                f"an image of {width:.0f} x {height:.0f} px is no camera's: {_REMEDY}", camera
            )
        return int(width), int(height)

    def rig(self, entries: Sequence[Camera | None], notes: Sequence[str] = ()) -> Rig:
        """Rig of the cameras; an error if there is none or two share a name."""
        cameras = [camera for camera in entries if camera is not None]
        if entries and not cameras:
            raise self.error(
                f"none of {', '.join(self.cameras or ())} is in it with a position: choose others"
            )
        if not cameras:
            raise self.error(
                "no camera in it: expected at least one with matrix, distortions, rotation and"
                " translation"
            )
        for name in (camera.name for camera in cameras):
            if not name.strip() or len(name) > _LONGEST_NAME or not name.isprintable():
                raise self.error(f"{brief(name)} is no camera's name: rename it")
        try:
            return Rig(tuple(cameras), tuple(notes))
        except ValueError as error:
            raise self.error(f"{error}: give every camera its own name") from None


def camera_values(camera: Camera) -> dict[str, Any]:
    """Returns a camera as the plain values that `Source.camera` reads."""
    return {
        "name": camera.name,
        "size": list(camera.size),
        "matrix": camera.matrix.tolist(),
        "distortions": camera.distortion.tolist(),
        "rotation": camera.rotation.tolist(),
        "translation": camera.translation.tolist(),
        "fisheye": camera.fisheye,
    }


def folder_with(path: Path, names: Sequence[str]) -> Path | None:
    """The folder that holds any of the files of a calibration, of its path or that of one of
    them; None where it is none of these.
    """
    folder = path if path.is_dir() else path.parent if path.name in names else None
    return folder if folder and any((folder / name).is_file() for name in names) else None


def names_of_pictures(pictures: Sequence[str]) -> list[str]:
    """Names of cameras by their pictures: the file names without endings, or where those repeat
    (cam_1/0001.png, cam_2/0001.png) the folders'.
    """
    paths = [PureWindowsPath(picture) for picture in pictures]
    names = [path.stem if path.suffix.lower() in _PICTURES else path.name for path in paths]
    return names if len(set(names)) == len(names) else [path.parent.name for path in paths]


def video_cameras(
    source: Source, kinds: Mapping[str, str], filming: Collection[str], unused: Collection[str]
) -> tuple[list[str], list[str]]:
    """Names of the cameras to read, of a system with cameras for markers: those that film, all
    where none does, and any that is asked for by name.

    Args:
        kinds: Model by the name of every calibrated camera.
        unused: Cameras that are not calibrated or not in use.

    Returns:
        The names, and notes that list those left out.
    """
    asked = set(source.cameras or ())
    names = [name for name in kinds if name in filming or name in asked or not filming]
    markers = [f"{name} ({kind})" for name, kind in kinds.items() if name not in names]
    left = ((markers, "cameras for markers"), (sorted(unused), "cameras that are not calibrated"))
    return names, [
        f"{source.path}: left out {what}: {', '.join(which)}" for which, what in left if which
    ]


def five_distortion_numbers(camera: Camera, container: str) -> FloatArray:
    """Returns k1 k2 p1 p2 k3 of a camera, (5,) float64; messages name the container, which holds no
    other numbers. InputError where the camera's lens has more terms.
    """
    if camera.fisheye or len(camera.distortion) > 5:
        raise InputError(
            f"camera {camera.name}: {container} holds k1 k2 p1 p2 k3 and no more: write TOML"
        )
    return np.concatenate([camera.distortion, np.zeros(5 - len(camera.distortion))])


def brief(value: object) -> str:
    """Representation of a value, of at most 40 characters."""
    text = repr(value)
    return text if len(text) <= 40 else text[:37] + "..."
