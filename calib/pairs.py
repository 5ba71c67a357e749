"""Relative poses of pairs of cameras that saw the same boards."""

from collections.abc import Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from calib.adjust import ideal_poses
from calib.board import Board, BoardView
from calib.camera import Camera, FloatArray, Rig
from calib.errors import InputError
from calib.rotation import nearest_rotation
from calib.tuning import BOARDS

Pair = tuple[str, str]
Pose = tuple[FloatArray, FloatArray]  # rotation (3, 3) and translation (3,), m
Views = Mapping[str, Mapping[str, BoardView]]  # moment -> camera -> view

_MIN_BOARDS = 4  # below, a pair is not tested for mirroring


class PoseCandidate(NamedTuple):
    """A possible pose of a board relative to a camera."""

    rotation: FloatArray  #: (3, 3) float64, camera from board.
    translation: FloatArray  #: (3,) float64, m.
    error: float  #: Root mean square error in ideal coordinates.
    flipped: bool  #: Whether the corners are numbered from the other end.


Candidates = Mapping[str, Mapping[str, list[PoseCandidate]]]  # moment -> camera -> candidates


def board_candidates(board: Board, lenses: Rig, views: Views) -> Candidates:
    """Pose candidates of every view; views without any are omitted."""
    candidates = {
        moment: {name: board_poses(board, lenses[name], view) for name, view in seen.items()}
        for moment, seen in views.items()
    }
    return {
        moment: {name: poses for name, poses in seen.items() if poses}
        for moment, seen in candidates.items()
    }


def board_poses(board: Board, camera: Camera, view: BoardView) -> list[PoseCandidate]:
    """Pose candidates of a board relative to a camera. InputError where the picture's size is not
    that of the lens calibration.
    """
    check_lens_size(camera, view.size)
    points = board.points_m[view.ids]
    poses = [PoseCandidate(*pose, False) for pose in ideal_poses(camera, points, view.pixels)]
    if board.is_symmetric:
        poses += [
            PoseCandidate(*pose, True)
            for pose in ideal_poses(camera, flipped_points(board, points), view.pixels)
        ]
    return poses


def check_lens_size(lens: Camera, size: tuple[int, int]) -> None:
    """Refuses pictures (width, height) px of another size than a camera's lens was calibrated at.
    InputError where the sizes differ.
    """
    if size != lens.size:
        seen, known = (f"{width}x{height}" for width, height in (size, lens.size))
        raise InputError(
            f"camera {lens.name} recorded at {seen}, its lens was calibrated at {known}: use one"
            " size"
        )


def flipped_points(board: Board, points_m: FloatArray) -> FloatArray:
    """Corners (N, 3), m, numbered from the other end."""
    return np.array([board.columns - 1, board.rows - 1, 0]) * board.square_m - points_m


def shared_boards(
    names: tuple[str, ...], views: Mapping[str, Mapping[str, object]]
) -> dict[Pair, int]:
    """Number of boards, or points, that each pair of cameras saw, from what each camera saw."""
    return {
        pair: sum(seen.keys() >= set(pair) for seen in views.values())
        for pair in combinations(names, 2)
    }


def chain_poses(
    names: tuple[str, ...], candidates: Candidates, shared: Mapping[Pair, int]
) -> tuple[dict[str, Pose], dict[Pair, int]]:
    """Initial poses of all cameras, along the pairs that share most boards. InputError where the
    cameras are not connected.

    Returns:
        Poses by camera name, camera from first camera, and for each pair used the number of its
        boards that agree on its relative pose.
    """
    poses: dict[str, Pose] = {names[0]: (np.eye(3), np.zeros(3))}
    agreeing: dict[Pair, int] = {}
    while len(poses) < len(names):
        edges = [
            (count, a, b)
            for (a, b), count in shared.items()
            if count and (a in poses) != (b in poses)
        ]
        if not edges:
            raise InputError(_disconnected(names, set(poses), shared))
        _, a, b = max(edges)
        known, new = (a, b) if a in poses else (b, a)
        rotation, translation, agreeing[a, b] = relative(known, new, candidates)
        base = poses[known]
        poses[new] = rotation @ base[0], rotation @ base[1] + translation
    return poses, agreeing


def _disconnected(names: tuple[str, ...], reached: set[str], shared: Mapping[Pair, int]) -> str:
    """Message that names the cameras without shared boards, with counts."""
    lost = [name for name in names if name not in reached]
    counts = ", ".join(f"{a}-{b} {count}" for (a, b), count in shared.items())
    together = ", ".join(name for name in names if name in reached)
    return (
        f"no board was seen by {together} and {', '.join(lost)} together (boards shared: {counts}):"
        " carry the board where both see it"
    )


def relative(known: str, new: str, board_poses: Candidates) -> tuple[FloatArray, FloatArray, int]:
    """Relative pose of two cameras on which most boards agree: rotation and translation, new from
    known, and the number of boards that agree.

    The tilt of a small board is ambiguous, and a symmetric board may be numbered from either end,
    so each board gives several candidates; the right one recurs with every board.
    """
    candidates: list[tuple[FloatArray, FloatArray, int, float]] = []
    tiny = 1e-6  # ideal coordinates: a thousandth of a pixel
    for number, seen in enumerate(board_poses.values()):
        a, b = seen.get(known, []), seen.get(new, [])
        for ra, ta, error_a, flipped_a in a:
            for rb, tb, error_b, flipped_b in b:
                if flipped_a and flipped_b:
                    continue  # equivalent to neither being flipped
                rotation = rb @ ra.T
                ratios = error_a / (a[0].error + tiny), error_b / (b[0].error + tiny)
                penalty = float(np.log1p(ratios).sum())
                candidates.append((rotation, tb - rotation @ ta, number, penalty))
    rotations, translations, boards, penalties = map(np.array, zip(*candidates, strict=True))
    best, agrees = np.inf, np.zeros(len(candidates), dtype=bool)
    for index in range(len(candidates)):
        cosine = (np.einsum("nij,ij->n", rotations, rotations[index]) - 1) / 2
        apart = np.linalg.norm(translations - translations[index], axis=1)
        apart /= 1 + np.linalg.norm(translations[index])
        distance = np.minimum(np.arccos(np.clip(cosine, -1, 1)) + apart, 0.5)
        nearest = np.full(boards.max() + 1, 0.5)
        np.minimum.at(nearest, boards, distance)
        # Of candidates with equal support, the tilt with the smaller reprojection error.
        score = float(nearest.sum()) + 0.02 * penalties[index]
        if score < best:
            best, agrees = score, distance < BOARDS.same_pose
            agrees[index] = True
    rotation = nearest_rotation(rotations[agrees].mean(axis=0))
    shift = np.median(translations[agrees], axis=0)
    return rotation, shift, len(np.unique(boards[agrees]))


def refuse_mirrored(
    board: Board,
    lenses: Rig,
    views: Views,
    agreeing: Mapping[Pair, int],
    shared: Mapping[Pair, int],
) -> None:
    """Detects cameras with mirrored images, among pairs that disagree about most boards. InputError
    where a camera agrees with another once its images are mirrored; the message has both counts.

    A mirrored plain board is still a valid board, but its motion is mirrored too, so that the
    relative poses from different boards disagree.
    """
    for (a, b), count in agreeing.items():
        together = shared[a, b]
        if together < _MIN_BOARDS or count >= together / 2:
            continue
        mirrored_count = _agreement(board, lenses, views, a, b, mirrored=True)
        if mirrored_count < max(_MIN_BOARDS, together / 2):
            continue
        # Mirroring either of the two has the same effect; the other cameras decide.
        gains = {name: _gain(board, lenses, views, name, (a, b)) for name in (a, b)}
        culprit = max(gains, key=lambda name: gains[name])
        which = (
            f"camera {culprit}'s pictures are"
            if gains[a] != gains[b]
            else f"the pictures of camera {a} or of camera {b} are"
        )
        raise InputError(
            f"{which} mirrored: of {together} boards that {a} and {b} saw together they agree on"
            f" {count}, and on {mirrored_count} once mirrored: switch off the camera's mirror"
            " (selfie) option, or flip its video"
        )


def _gain(board: Board, lenses: Rig, views: Views, name: str, excluded: Pair) -> int:
    """Number of boards gained in agreement with the other cameras by mirroring a camera."""
    return sum(
        sign * _agreement(board, lenses, views, name, other, sign > 0)
        for other in lenses.names
        if other not in excluded
        for sign in (1, -1)
    )


def _agreement(
    board: Board, lenses: Rig, views: Views, name: str, other: str, mirrored: bool
) -> int:
    """Number of boards on which two cameras agree, with or without mirroring the first."""
    both = {moment: seen for moment, seen in views.items() if name in seen and other in seen}
    first = {
        moment: _mirrored(board, lenses[name], seen[name]) if mirrored else seen[name]
        for moment, seen in both.items()
    }
    views = {moment: {name: first[moment], other: seen[other]} for moment, seen in both.items()}
    candidates = board_candidates(board, lenses, views)
    candidates = {moment: seen for moment, seen in candidates.items() if len(seen) == 2}
    return relative(other, name, candidates)[2] if candidates else 0


def _mirrored(board: Board, camera: Camera, view: BoardView) -> BoardView:
    """A view with the mirroring of its image undone."""
    pixels = view.pixels * [-1, 1] + [2 * camera.matrix[0, 2], 0]
    if board.marker_m is not None:
        return BoardView(view.ids, pixels, view.size)
    # The detector numbered the corners for an unmirrored board, from the end where the first inner
    # square is dark.
    grid = pixels.reshape(board.rows, board.columns, 2)
    grid = grid[:, ::-1] if board.columns % 2 == 0 else grid[::-1]
    return BoardView(view.ids, grid.reshape(-1, 2), view.size)
