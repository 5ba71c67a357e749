"""From points of the scene that cameras see, some of them measured in the world, to where the
cameras stand.

Cameras that see four measured points are placed by them; points that two placed cameras see are
then known too, and place further cameras. Bundle adjustment moves all of it together; measured
points stay.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.adjust import Adjusted, BundleScene, Observations, adjust, rms_px
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.extrinsics import Extrinsics, camera_error
from calib.rotation import matrix_from_rodrigues

FloatArray = NDArray[np.float64]

_NEEDED = 4
_CLICKED_WRONG = 4.0  # times the median error
_CLICKED_WELL_PX = 2.0


@dataclass(frozen=True, eq=False)
class ScenePoints:
    """Listed points.

    Attributes:
        pixels: Point -> camera -> (2,) float64, px, where it is seen.
        known_m: Point -> (3,) float64, m, of those whose place in the world was measured; z is up.
    """

    pixels: Mapping[str, Mapping[str, FloatArray]]
    known_m: Mapping[str, FloatArray]

    def cameras(self) -> set[str]:
        """Returns the names of all cameras that see a point."""
        return {camera for seen in self.pixels.values() for camera in seen}


def calibrate_from_points(lenses: Rig, points: ScenePoints) -> Extrinsics:
    """Finds where cameras stand.

    Args:
        lenses: Cameras whose lenses are right; their places are not looked at.
        points: What they see.

    Returns: The rig in the world of the measured points. Its standard errors are relative to that
        world, and count points, not boards.

    Raises:
        InputError: Too few points are measured, or they do not place every camera.
    """
    for name in sorted(points.cameras() - set(lenses.names)):
        raise InputError(
            f"points are listed for camera {name}, which has no lens calibration: calibrate its"
            " intrinsics first"
        )
    measured = [name for name in points.pixels if name in points.known_m]
    if len(measured) < _NEEDED:
        raise InputError(
            f"{len(measured)} points have world coordinates, {_NEEDED} are needed: without them the"
            " scale is unknown"
        )
    placed, found_m = _start(lenses, points)
    free = [name for name in points.pixels if name in found_m and name not in points.known_m]
    place = {name: (number, np.zeros(3)) for number, name in enumerate(free, start=1)}
    place |= {name: (0, points.known_m[name]) for name in measured}
    rows = [(camera, name) for name in place for camera in points.pixels[name]]
    cameras = tuple(placed[name] for name in lenses.names)
    number = {name: index for index, name in enumerate(lenses.names)}
    seen = Observations(
        np.array([number[camera] for camera, _ in rows]),
        np.array([place[name][0] for _, name in rows]),
        np.array([place[name][1] for _, name in rows]),
        np.array([points.pixels[name][camera] for camera, name in rows]),
    )
    # The measured points are one rigid board that stays, each other point a board of a single
    # corner.
    shifts = np.concatenate(
        [np.zeros((1, 3)), np.array([found_m[name] for name in free]).reshape(-1, 3)]
    )
    adjusted = adjust(
        BundleScene(cameras, np.repeat(np.eye(3)[None], len(shifts), axis=0), shifts),
        seen,
        "places",
        fixed="board",
    )
    counts = np.bincount(seen.camera, minlength=len(cameras))
    table = tuple(
        camera_error(index, adjusted, seen, int(counts[index])) for index in range(len(cameras))
    )
    shared = {
        (a, b): sum(a in views and b in views for views in points.pixels.values())
        for index, a in enumerate(lenses.names)
        for b in lenses.names[index + 1 :]
    }
    lone = [name for name in points.pixels if name not in place]
    return Extrinsics(
        Rig(adjusted.scene.cameras),
        table,
        rms_px(adjusted.residuals_px),
        shared,
        _advice(rows, adjusted, lone),
    )


def _start(lenses: Rig, points: ScenePoints) -> tuple[dict[str, Camera], dict[str, FloatArray]]:
    """Places cameras and points one by one, those with most points first.

    Raises:
        InputError: A camera cannot be reached.
    """
    placed: dict[str, Camera] = {}
    found = {name: np.asarray(place, dtype=np.float64) for name, place in points.known_m.items()}
    while len(placed) < len(lenses):
        waiting = {
            camera.name: [
                name
                for name, seen in points.pixels.items()
                if camera.name in seen and name in found
            ]
            for camera in lenses
            if camera.name not in placed
        }
        best = max(waiting, key=lambda name: len(waiting[name]))
        if len(waiting[best]) < _NEEDED:
            counts = ", ".join(f"{name} {len(known)}" for name, known in waiting.items())
            raise InputError(
                f"too few points to place {', '.join(waiting)} (points that are measured, or seen"
                f" by two placed cameras: {counts}; {_NEEDED} are needed): list more points that"
                " these cameras share with others"
            )
        known = waiting[best]
        placed[best] = _place(
            lenses[best],
            np.array([found[name] for name in known]),
            np.array([points.pixels[name][best] for name in known]),
        )
        for name, seen in points.pixels.items():
            both = [camera for camera in seen if camera in placed]
            if name not in points.known_m and len(both) > 1:
                found[name] = _meet(
                    [placed[camera] for camera in both], np.array([seen[camera] for camera in both])
                )
    return placed, found


def _place(camera: Camera, points_m: FloatArray, pixels: FloatArray) -> Camera:
    """Places a camera by points (N, 3) m and where it sees them (N, 2) px.

    Source: Terzakis and Lourakis, A Consistently Fast and Globally Optimal Solution to the PnP
    Problem, 2020 (OpenCV's SOLVEPNP_SQPNP).
    """
    ideal = camera.undistort(pixels)
    good = np.isfinite(ideal).all(axis=1)
    done, turn, shift = False, None, None
    if good.sum() >= _NEEDED:
        done, turn, shift = cv2.solvePnP(
            points_m[good], ideal[good], camera.matrix, np.zeros(4), flags=cv2.SOLVEPNP_SQPNP
        )
    if not done or turn is None or shift is None:
        raise InputError(
            f"camera {camera.name}: its points do not say where it stands: are some on one line, or"
            " outside its lens?"
        )
    return replace(
        camera,
        rotation=matrix_from_rodrigues(turn),
        translation=np.asarray(shift, dtype=np.float64).ravel(),
    )


def _meet(cameras: list[Camera], pixels: FloatArray) -> FloatArray:
    """Returns the point (3,) nearest to the rays of pixels (N, 2), one per camera."""
    normal, target = np.zeros((3, 3)), np.zeros(3)
    for camera, pixel in zip(cameras, pixels, strict=True):
        origin, direction = camera.rays(pixel[None])
        across = np.eye(3) - np.outer(direction[0], direction[0])
        normal += across
        target += across @ origin
    return np.asarray(np.linalg.lstsq(normal, target, rcond=None)[0], dtype=np.float64)


def _advice(rows: list[tuple[str, str]], adjusted: Adjusted, lone: list[str]) -> tuple[str, ...]:
    """Names points that are off, and those that say nothing."""
    errors = np.linalg.norm(adjusted.residuals_px, axis=1)
    limit = max(_CLICKED_WELL_PX, _CLICKED_WRONG * float(np.median(errors)))
    said = [
        f"point {name} in camera {camera} is off by {error:.1f} px: mistaken for another, or"
        " measured wrongly?"
        for (camera, name), error in sorted(
            zip(rows, errors, strict=True), key=lambda line: -line[1]
        )
        if error > limit
    ]
    if lone:
        said.append(f"seen by one camera and not measured, so of no use: {', '.join(lone)}")
    return tuple(said)
