"""Camera poses from boards seen by several cameras at once.

Pairs of cameras that share boards give relative poses; the best spanning tree of the graph of pairs
gives initial poses, and bundle adjustment refines them all. A camera that is not connected to the
others is reported by name.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from calib.adjust import Adjustment, BundleScene, Observations, adjust, rms_px
from calib.board import Board, BoardView
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.pairs import (
    Candidates,
    Pair,
    Pose,
    Views,
    board_candidates,
    chain_poses,
    flipped_points,
    refuse_mirrored,
    shared_boards,
)
from calib.rotation import rodrigues_from_matrix
from calib.tuning import AGREEMENT, BOARDS


@dataclass(frozen=True)
class CameraError:
    """Accuracy of one camera's pose."""

    camera: str
    seen: int  #: Number of boards (or points) it saw.
    rms_px: float  #: Root mean square reprojection error.
    position_mm: float
    """Standard error of its position relative to the first camera (NaN for that one), or relative
    to the world if calibrated from points."""
    rotation_deg: float  #: Standard error of its rotation, likewise.


@dataclass(frozen=True, eq=False)
class Extrinsics:
    """A calibrated rig."""

    rig: Rig
    table: tuple[CameraError, ...]  #: Accuracy of each camera.
    rms_px: float  #: Root mean square reprojection error of all cameras.
    shared_boards: Mapping[Pair, int]  #: Number of boards seen by each pair of cameras.
    advice: tuple[str, ...]  #: Remarks on implausible results.
    before_px: Mapping[str, float] = field(default_factory=dict)
    """Root mean square reprojection error of an earlier calibration, in the same pictures, by the
    names of its cameras; empty where there is none."""


def calibrate_extrinsics(
    board: Board, lenses: Rig, views: Views, floor: str | None = None, refine_lenses: bool = False
) -> Extrinsics:
    """Estimates the poses of cameras, and their accuracy. InputError where a camera saw no board,
    the cameras are not connected by shared boards, or the board on the floor is missing or upside
    down.

    Args:
        lenses: Cameras with calibrated lenses; their poses are ignored.
        views: Detected boards: moment -> camera name -> view.
        floor: The moment at which the board lay on the floor, face up. Its first corner becomes the
            world's origin, its rows the x axis, and z points up. None: the world is the first
            camera's frame. A symmetric board has no first corner: use one with an odd number of
            squares in one direction and an even number in the other.
        refine_lenses: Whether the lens parameters are refined too; only useful if they are not
            known better from boards closer to the camera.
    """
    for name in {name for seen in views.values() for name in seen} - set(lenses.names):
        raise InputError(
            f"camera {name} saw boards but has no lens calibration: calibrate its intrinsics first"
        )
    candidates = board_candidates(board, lenses, views)
    shared = shared_boards(lenses.names, candidates)
    starts, agreeing = chain_poses(lenses.names, candidates, shared)
    refuse_mirrored(board, lenses, views, agreeing, shared)
    cameras = tuple(
        replace(camera, rotation=starts[camera.name][0], translation=starts[camera.name][1])
        for camera in lenses
    )
    moments, scene, seen = _scene(board, cameras, views, candidates, floor)
    adjusted = adjust(scene, seen, "both" if refine_lenses else "poses")
    cameras = adjusted.scene.cameras
    if floor is not None:
        cameras = _on_floor(floor, moments, adjusted.scene)
    counts = [len(np.unique(seen.board[seen.camera == index])) for index in range(len(cameras))]
    table = tuple(camera_error(index, adjusted, seen, count) for index, count in enumerate(counts))
    return Extrinsics(Rig(cameras), table, rms_px(adjusted.residuals_px), shared, _advice(table))


def board_errors(board: Board, rig: Rig, views: Views) -> dict[str, float]:
    """Root mean square reprojection error, px, by the names of a rig's cameras, which stay where
    they are while each board is moved to where it fits best. InputError where no two of the cameras
    saw a board at the same moment, or pictures have another size than the lenses were calibrated
    at.

    Args:
        views: Detected boards: moment -> camera name -> view; other cameras' do not count.
    """
    known = {
        moment: {name: view for name, view in seen.items() if name in rig}
        for moment, seen in views.items()
    }
    candidates = board_candidates(board, rig, known)
    _, scene, seen = _scene(board, rig.cameras, known, candidates, None, every=True)
    residuals_px = adjust(scene, seen, "boards").residuals_px
    rows = {camera.name: seen.camera == index for index, camera in enumerate(rig)}
    return {name: rms_px(residuals_px[mask]) for name, mask in rows.items() if mask.any()}


def _scene(
    board: Board,
    cameras: tuple[Camera, ...],
    views: Views,
    candidates: Candidates,
    floor: str | None,
    every: bool = False,
) -> tuple[list[str], BundleScene, Observations]:
    """Initial pose of every board, and the observations.

    Each board gets the candidate pose with the smallest error over all cameras; boards that fit
    nowhere are left out, unless `every` one counts.
    """
    moments: list[str] = []
    rotations, translations, parts = [], [], []
    by_name = {camera.name: (index, camera) for index, camera in enumerate(cameras)}
    for moment, seen in candidates.items():
        choices = []
        if len(seen) < 2 and moment != floor:
            continue  # does not constrain the relative poses of cameras
        for name, poses in seen.items():
            _, camera = by_name[name]
            for rotation, translation, _, flipped in poses:
                pose = (
                    camera.rotation.T @ rotation,
                    camera.rotation.T @ (translation - camera.translation),
                )
                if not flipped or len(seen) > 1:
                    choices.append((*_misfit(board, by_name, views[moment], pose), pose))
        if not choices:
            continue
        error, flips, pose = min(choices, key=lambda choice: choice[0])
        if error > BOARDS.far_px * len(flips) and not every:
            continue
        for name, flipped in flips.items():
            view, index = views[moment][name], by_name[name][0]
            points = board.points_m[view.ids]
            points = flipped_points(board, points) if flipped else points
            numbers = np.full(len(points), index), np.full(len(points), len(moments))
            parts.append((*numbers, points, view.pixels))
        moments.append(moment)
        rotations.append(pose[0])
        translations.append(pose[1])
    if not moments:
        raise InputError("no board fits any camera: are the board's numbers and the lenses right?")
    seen_all = Observations(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return moments, BundleScene(cameras, np.array(rotations), np.array(translations)), seen_all


def _misfit(
    board: Board,
    by_name: Mapping[str, tuple[int, Camera]],
    seen: Mapping[str, BoardView],
    pose: Pose,
) -> tuple[float, dict[str, bool]]:
    """Summed error of a board's pose over cameras, and whether each camera's order is flipped.

    Errors are px at a focal length of 1000 px, each limited to 100.
    """
    total, flips = 0.0, {}
    for name, view in seen.items():
        camera = by_name[name][1]
        points = board.points_m[view.ids]
        options = {False: points}
        if board.is_symmetric:
            options[True] = flipped_points(board, points)
        errors = {}
        for flipped, flipped_or_not in options.items():
            pixels, _ = camera.project(flipped_or_not @ pose[0].T + pose[1])
            distance_px = np.linalg.norm(pixels - view.pixels, axis=1).mean()
            error = distance_px * 1000 / camera.matrix[0, 0]
            errors[flipped] = float(error) if np.isfinite(error) else np.inf
        best = min(errors, key=lambda flipped: errors[flipped])
        total += min(errors[best], 5 * BOARDS.far_px)
        flips[name] = best
    return total, flips


def _on_floor(floor: str, moments: list[str], scene: BundleScene) -> tuple[Camera, ...]:
    """The cameras in the world of the board on the floor. InputError where that board was not seen,
    or lies so that cameras would be under the floor.
    """
    if floor not in moments:
        raise InputError(
            f"the floor's board {floor!r} was not seen by any calibrated camera: name a moment at"
            " which it lies in view"
        )
    index = moments.index(floor)
    # The board's z points into the floor: up is -z, and y changes its sign too.
    world_from_old = np.diag([1.0, -1, -1]) @ scene.rotations[index].T
    shift = -world_from_old @ scene.translations[index]
    moved = tuple(camera.in_world(world_from_old, shift) for camera in scene.cameras)
    under = [camera.name for camera in moved if camera.center_m[2] < 0]
    if under:
        raise InputError(
            f"{', '.join(under)} would be under the floor: the board must lie on it, face up, at"
            f" the moment {floor!r}"
        )
    return moved


def camera_error(index: int, adjusted: Adjustment, seen: Observations, count: int) -> CameraError:
    """Accuracy of one camera."""
    name, covariance = adjusted.scene.cameras[index].name, adjusted.covariances[index][:6, :6]
    rows = seen.camera == index
    error = rms_px(adjusted.residuals_px[rows]) if rows.any() else np.nan
    if not covariance.any():
        return CameraError(name, count, error, np.nan, np.nan)
    # The centre is -R' t, and the block's last three parameters are a shift of t.
    position = float(np.sqrt(np.trace(covariance[3:, 3:])))
    turn = float(np.sqrt(np.trace(covariance[:3, :3])))
    return CameraError(name, count, error, 1000 * position, float(np.degrees(turn)))


def _advice(table: tuple[CameraError, ...]) -> tuple[str, ...]:
    """Remarks on implausible results."""
    remarks = []
    for line in table:
        others = [
            other.rms_px for other in table if other is not line and np.isfinite(other.rms_px)
        ]
        if others and line.rms_px > max(1.0, AGREEMENT.alike_gain * float(np.median(others))):
            remarks.append(
                f"camera {line.camera} disagrees with the others ({line.rms_px:.1f} px): wrong"
                " lens, mirrored picture or out of sync?"
            )
        if line.seen < 5:
            remarks.append(
                f"camera {line.camera} saw {line.seen} boards only: carry the board before it for"
                " longer"
            )
    return tuple(remarks)


def pose_difference(left: Camera, right: Camera) -> tuple[float, float]:
    """Difference of two camera poses: mm between the centres, and angle of rotation in degrees."""
    turn = rodrigues_from_matrix(left.rotation @ right.rotation.T)
    return 1000 * float(np.linalg.norm(left.center_m - right.center_m)), float(
        np.degrees(np.linalg.norm(turn))
    )
