"""From boards that several cameras saw at once to where the cameras stand.

Pairs of cameras that share boards give relative places; the pairs form a graph, its best tree gives
a start for all, and bundle adjustment moves everything together. A camera without a path to the
others is said in words.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.adjust import Adjusted, BundleScene, Observations, adjust, rms_px
from calib.board import Board, BoardView
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.pairs import (
    Pair,
    Placed,
    Pose,
    Views,
    chain,
    place_boards,
    refuse_mirrored,
    shared_boards,
    turned_points,
)
from calib.rotation import nearest_rotation, rodrigues_from_matrix

FloatArray = NDArray[np.float64]

_FAR_PX = 20.0  # boards that fit worse than this after the start are left out of the adjustment
_FOCAL_PX = 1000.0  # brings ideal coordinates to a scale on which that is a fair number
_ODD_ONE_OUT = 1.5  # times the other cameras' median error


@dataclass(frozen=True)
class CameraError:
    """One line of the table: a camera, how many boards (or points) it saw, its error (px, rms), and
    the standard errors of its place.

    The standard errors are relative to the first camera, NaN for itself; with points, relative to
    the world.
    """

    camera: str
    seen: int
    rms_px: float
    position_mm: float
    rotation_deg: float


@dataclass(frozen=True, eq=False)
class Extrinsics:
    """A calibrated rig, its table, the overall error (px, rms), how many boards each pair shared,
    and words about what is odd.
    """

    rig: Rig
    table: tuple[CameraError, ...]
    rms_px: float
    shared_boards: Mapping[Pair, int]
    advice: tuple[str, ...]


def calibrate_extrinsics(
    board: Board, lenses: Rig, views: Views, floor: str | None = None, refine_lenses: bool = False
) -> Extrinsics:
    """Finds where cameras stand.

    Args: board: The board that was carried about. lenses: Cameras whose lenses are right; their
        places are not looked at. views: For every moment, which camera saw the board: moment ->
        camera name -> view. floor: The moment at which the board lay on the floor, face up. Its
        first corner becomes the world's origin, its rows the
            x axis, and up is z. Without it the world is the first camera's frame. (A board that
            half a turn leaves as it is has no
            first corner: take one with an odd number of squares one way and an even number the
                other.)
        refine_lenses: Whether the lenses may change too, where they are not known better from
            boards that were nearer.

    Returns:
        The rig and how sure it is.

    Raises: InputError: A camera saw no board, the cameras do not hang together, or the floor's
        board is not there or upside down.
    """
    for name in {name for seen in views.values() for name in seen} - set(lenses.names):
        raise InputError(
            f"camera {name} saw boards but has no lens calibration: calibrate its intrinsics first"
        )
    placed = place_boards(board, lenses, views)
    shared = shared_boards(lenses.names, placed)
    starts, agreeing = chain(lenses.names, placed, shared)
    refuse_mirrored(board, lenses, views, agreeing, shared)
    cameras = tuple(
        replace(camera, rotation=starts[camera.name][0], translation=starts[camera.name][1])
        for camera in lenses
    )
    moments, scene, seen = _scene(board, cameras, views, placed, floor)
    adjusted = adjust(scene, seen, "both" if refine_lenses else "places")
    cameras = adjusted.scene.cameras
    if floor is not None:
        cameras = _on_floor(floor, moments, adjusted.scene)
    counts = [len(np.unique(seen.board[seen.camera == index])) for index in range(len(cameras))]
    table = tuple(camera_error(index, adjusted, seen, count) for index, count in enumerate(counts))
    return Extrinsics(Rig(cameras), table, rms_px(adjusted.residuals_px), shared, _advice(table))


def _scene(
    board: Board,
    cameras: tuple[Camera, ...],
    views: Views,
    placed: Placed,
    floor: str | None,
) -> tuple[list[str], BundleScene, Observations]:
    """Places every board in the world by the camera's candidate that all cameras like best, and
    gathers what was seen.
    """
    moments: list[str] = []
    rotations, translations, parts = [], [], []
    by_name = {camera.name: (index, camera) for index, camera in enumerate(cameras)}
    for moment, seen in placed.items():
        choices = []
        if len(seen) < 2 and moment != floor:
            continue  # says nothing about how cameras stand to each other
        for name, poses in seen.items():
            _, camera = by_name[name]
            for rotation, translation, _, turned in poses:
                place = (
                    camera.rotation.T @ rotation,
                    camera.rotation.T @ (translation - camera.translation),
                )
                if not turned or len(seen) > 1:
                    choices.append((*_misfit(board, by_name, views[moment], place), place))
        if not choices:
            continue
        error, turns, place = min(choices, key=lambda choice: choice[0])
        if error > _FAR_PX * len(turns):
            continue
        for name, turned in turns.items():
            view, index = views[moment][name], by_name[name][0]
            points = board.points_m[view.ids]
            points = turned_points(board, points) if turned else points
            parts.append(
                (
                    np.full(len(points), index),
                    np.full(len(points), len(moments)),
                    points,
                    view.pixels,
                )
            )
        moments.append(moment)
        rotations.append(place[0])
        translations.append(place[1])
    if not moments:
        raise InputError("no board fits any camera: are the board's numbers and the lenses right?")
    seen_all = Observations(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return moments, BundleScene(cameras, np.array(rotations), np.array(translations)), seen_all


def _misfit(
    board: Board,
    by_name: Mapping[str, tuple[int, Camera]],
    seen: Mapping[str, BoardView],
    place: Pose,
) -> tuple[float, dict[str, bool]]:
    """Returns the summed error of a board's place over cameras (px of a focal length of 1000, each
    at most 20), and who counts turned.
    """
    total, turns = 0.0, {}
    for name, view in seen.items():
        camera = by_name[name][1]
        points = board.points_m[view.ids]
        options = (
            {False: points, True: turned_points(board, points)}
            if board.turns_into_itself
            else {False: points}
        )
        errors = {}
        for turned, option in options.items():
            pixels, _ = camera.project(option @ place[0].T + place[1])
            error = (
                np.linalg.norm(pixels - view.pixels, axis=1).mean()
                * _FOCAL_PX
                / camera.matrix[0, 0]
            )
            errors[turned] = float(error) if np.isfinite(error) else np.inf
        best = min(errors, key=lambda turned: errors[turned])
        total += min(errors[best], 5 * _FAR_PX)
        turns[name] = best
    return total, turns


def _on_floor(floor: str, moments: list[str], scene: BundleScene) -> tuple[Camera, ...]:
    """Moves the world to the board on the floor.

    Raises:
        InputError: That board was not seen, or lies so that cameras would be under the floor.
    """
    if floor not in moments:
        raise InputError(
            f"the floor's board {floor!r} was not seen by any calibrated camera: name a moment at"
            " which it lies in view"
        )
    at = moments.index(floor)
    # The board's z points into the floor, its y toward the reader: up is -z, and y turns with it.
    world_from_old = np.diag([1.0, -1, -1]) @ scene.rotations[at].T
    origin = scene.translations[at]
    moved = []
    for camera in scene.cameras:
        rotation = camera.rotation @ world_from_old.T
        moved.append(
            replace(
                camera, rotation=rotation, translation=camera.translation + camera.rotation @ origin
            )
        )
    under = [camera.name for camera in moved if camera.center_m[2] < 0]
    if under:
        raise InputError(
            f"{', '.join(under)} would be under the floor: the board must lie on it, face up, at"
            f" the moment {floor!r}"
        )
    return tuple(moved)


def camera_error(index: int, adjusted: Adjusted, seen: Observations, count: int) -> CameraError:
    """Returns a camera's line of the table.

    Args:
        index: The camera's number.
        adjusted: The scene it is in.
        seen: What all cameras saw.
        count: Of how many boards or points that was made by this one.
    """
    name, covariance = adjusted.scene.cameras[index].name, adjusted.covariances[index][:6, :6]
    rows = seen.camera == index
    error = rms_px(adjusted.residuals_px[rows]) if rows.any() else np.nan
    if not covariance.any():
        return CameraError(name, count, error, np.nan, np.nan)
    # The centre is -R' t with t moved by the block's last three numbers.
    position = float(np.sqrt(np.trace(covariance[3:, 3:])))
    turn = float(np.sqrt(np.trace(covariance[:3, :3])))
    return CameraError(name, count, error, 1000 * position, float(np.degrees(turn)))


def _advice(table: tuple[CameraError, ...]) -> tuple[str, ...]:
    """Says what is odd."""
    said = []
    for line in table:
        others = [
            other.rms_px for other in table if other is not line and np.isfinite(other.rms_px)
        ]
        if others and line.rms_px > max(1.0, _ODD_ONE_OUT * float(np.median(others))):
            said.append(
                f"camera {line.camera} disagrees with the others ({line.rms_px:.1f} px): wrong"
                " lens, mirrored picture or out of sync?"
            )
        if line.seen < 5:
            said.append(
                f"camera {line.camera} saw {line.seen} boards only: carry the board before it for"
                " longer"
            )
    return tuple(said)


def same_world(rig: Rig, reference: Rig) -> Rig:
    """Turns and shifts a rig as a whole onto a reference with the same camera names, by their
    centres and axes (least squares).

    Raises:
        InputError: They have fewer than one camera in common.
    """
    names = [name for name in rig.names if name in reference]
    if not names:
        raise InputError("the two rigs have no camera name in common")
    rotation = nearest_rotation(
        sum(reference[name].rotation.T @ rig[name].rotation for name in names)
    )
    shift = np.mean(
        [reference[name].center_m - rotation @ rig[name].center_m for name in names], axis=0
    )
    moved = []
    for camera in rig:
        turned = camera.rotation @ rotation.T
        moved.append(
            replace(
                camera, rotation=turned, translation=-turned @ (rotation @ camera.center_m + shift)
            )
        )
    return Rig(tuple(moved))


def apart(left: Camera, right: Camera) -> tuple[float, float]:
    """Returns how far two cameras are apart: millimetres between centres, degrees between axes."""
    turn = rodrigues_from_matrix(left.rotation @ right.rotation.T)
    return 1000 * float(np.linalg.norm(left.center_m - right.center_m)), float(
        np.degrees(np.linalg.norm(turn))
    )
