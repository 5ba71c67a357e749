"""Pairs of cameras that saw the same boards: how they stand to each other, and what is wrong where
they do not agree.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib.adjust import ideal_poses
from calib.board import Board, BoardView
from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.rotation import nearest_rotation

FloatArray = NDArray[np.float64]
Pair = tuple[str, str]
Pose = tuple[FloatArray, FloatArray]  # rotation (3, 3) and translation (3,), m
Views = Mapping[str, Mapping[str, BoardView]]  # moment -> camera -> view

_TINY = 1e-6  # ideal coordinates: a thousandth of a pixel
_SAME = 0.1  # radians, and metres per metre: relative places this near each other are the same
_DOUBTFUL = 0.5  # share of a pair's boards that must agree
_ENOUGH = 4  # boards, from which on doubt is possible


class Candidate(NamedTuple):
    """A place that a board may have before a camera, m, its error in ideal units, and whether its
    corners are counted backwards.
    """

    rotation: FloatArray
    translation: FloatArray
    error: float
    turned: bool


Placed = Mapping[str, Mapping[str, list[Candidate]]]  # moment -> camera -> candidates


def place_boards(board: Board, lenses: Rig, views: Views) -> Placed:
    """Returns every view's candidates; views without any are left out."""
    placed = {
        moment: {name: board_poses(board, lenses[name], view) for name, view in seen.items()}
        for moment, seen in views.items()
    }
    return {
        moment: {name: poses for name, poses in seen.items() if poses}
        for moment, seen in placed.items()
    }


def board_poses(board: Board, camera: Camera, view: BoardView) -> list[Candidate]:
    """Returns candidate places of a board before a camera.

    Raises:
        InputError: The picture's size is not that of the lens calibration.
    """
    if view.size != camera.size:
        seen, known = (f"{w}x{h}" for w, h in (view.size, camera.size))
        raise InputError(
            f"camera {camera.name}: boards were recorded at {seen} but its lens was calibrated at"
            f" {known}: use one size"
        )
    points = board.points_m[view.ids]
    poses = [Candidate(*pose, False) for pose in ideal_poses(camera, points, view.pixels)]
    if board.turns_into_itself:
        poses += [
            Candidate(*pose, True)
            for pose in ideal_poses(camera, turned_points(board, points), view.pixels)
        ]
    return poses


def turned_points(board: Board, points_m: FloatArray) -> FloatArray:
    """Counts corners from the other end."""
    return np.array([board.columns - 1, board.rows - 1, 0]) * board.square_m - points_m


def shared_boards(names: tuple[str, ...], placed: Placed) -> dict[tuple[str, str], int]:
    """Counts the boards that each pair of cameras saw together."""
    counts = {(a, b): 0 for i, a in enumerate(names) for b in names[i + 1 :]}
    for seen in placed.values():
        for a, b in counts:
            counts[a, b] += a in seen and b in seen
    return counts


def chain(
    names: tuple[str, ...], placed: Placed, shared: Mapping[Pair, int]
) -> tuple[dict[str, Pose], dict[Pair, int]]:
    """Returns a first place for every camera, camera from first camera, along the pairs that share
    most boards.

    Returns: The places, and for each pair that was used how many of its boards agree on how the two
        stand to each other.

    Raises:
        InputError: Not all cameras can be reached.
    """
    places: dict[str, Pose] = {names[0]: (np.eye(3), np.zeros(3))}
    agreeing: dict[Pair, int] = {}
    while len(places) < len(names):
        edges = [
            (count, a, b)
            for (a, b), count in shared.items()
            if count and (a in places) != (b in places)
        ]
        if not edges:
            raise InputError(_disconnected(names, set(places), shared))
        _, a, b = max(edges)
        known, new = (a, b) if a in places else (b, a)
        rotation, translation, agreeing[a, b] = relative(known, new, placed)
        base = places[known]
        places[new] = rotation @ base[0], rotation @ base[1] + translation
    return places, agreeing


def _disconnected(names: tuple[str, ...], reached: set[str], shared: Mapping[Pair, int]) -> str:
    """Says which cameras have no board in common with which."""
    lost = [name for name in names if name not in reached]
    counts = ", ".join(f"{a}-{b} {count}" for (a, b), count in shared.items())
    together = ", ".join(name for name in names if name in reached)
    return (
        f"no board was seen by {together} and {', '.join(lost)} together (boards shared: {counts}):"
        " carry the board where both see it"
    )


def relative(known: str, new: str, placed: Placed) -> tuple[FloatArray, FloatArray, int]:
    """Returns new-from-known, the candidate on which most boards agree: rotation, translation and
    how many boards that is.

    A board's tilt is ambiguous when it is small, and a plain board may be counted from either end,
    so each gives several candidates; the right one comes up again with every board, wrong ones do
    not.
    """
    candidates: list[tuple[FloatArray, FloatArray, int, float]] = []
    for number, seen in enumerate(placed.values()):
        a, b = seen.get(known, []), seen.get(new, [])
        for ra, ta, error_a, turned_a in a:
            for rb, tb, error_b, turned_b in b:
                if turned_a and turned_b:
                    continue  # the same as neither
                rotation = rb @ ra.T
                worse = np.log1p(error_a / (a[0][2] + _TINY)) + np.log1p(
                    error_b / (b[0][2] + _TINY)
                )
                candidates.append((rotation, tb - rotation @ ta, number, worse))
    rotations = np.array([candidate[0] for candidate in candidates])
    translations = np.array([candidate[1] for candidate in candidates])
    boards = np.array([candidate[2] for candidate in candidates])
    best, agreed = np.inf, np.zeros(len(candidates), dtype=bool)
    for index in range(len(candidates)):
        angle = np.arccos(
            np.clip((np.einsum("nij,ij->n", rotations, rotations[index]) - 1) / 2, -1, 1)
        )
        apart = np.linalg.norm(translations - translations[index], axis=1) / (
            1 + np.linalg.norm(translations[index])
        )
        distance = np.minimum(angle + apart, 0.5)
        nearest = np.full(boards.max() + 1, 0.5)
        np.minimum.at(nearest, boards, distance)
        # Where boards leave the choice open, the tilt that fits its corners better.
        score = float(nearest.sum()) + 0.02 * candidates[index][3]
        if score < best:
            best, agreed = score, distance < _SAME
            agreed[index] = True
    place = (
        nearest_rotation(rotations[agreed].mean(axis=0)),
        np.median(translations[agreed], axis=0),
    )
    return *place, len(np.unique(boards[agreed]))


def refuse_mirrored(
    board: Board,
    lenses: Rig,
    views: Views,
    agreeing: Mapping[Pair, int],
    shared: Mapping[Pair, int],
) -> None:
    """Looks for a camera whose pictures are mirrored, where a pair disagrees about most of its
    boards.

    A plain board looks like a board in a mirror too; but its movements are then mirrored ones, and
    no two of them fit together.

    Raises: InputError: A camera agrees with another once its pictures are mirrored; both counts are
        told.
    """
    for (a, b), count in agreeing.items():
        together = shared[a, b]
        if together < _ENOUGH or count >= _DOUBTFUL * together:
            continue
        found = _agreement(board, lenses, views, a, b, mirrored=True)
        if found < max(_ENOUGH, _DOUBTFUL * together):
            continue
        # Mirroring the one or the other comes to the same; the other cameras say which.
        gains = {name: _gain(board, lenses, views, name, (a, b)) for name in (a, b)}
        culprit = max(gains, key=lambda name: gains[name])
        which = (
            f"camera {culprit}'s pictures are"
            if gains[a] != gains[b]
            else f"the pictures of camera {a} or of camera {b} are"
        )
        raise InputError(
            f"{which} mirrored: of {together} boards that {a} and {b} saw together they agree on"
            f" {count}, and on {found} once mirrored: switch off the camera's mirror (selfie)"
            " option, or flip its video"
        )


def _gain(board: Board, lenses: Rig, views: Views, name: str, but: Pair) -> int:
    """Returns on how many boards more a camera agrees with the others, once mirrored."""
    others = [other for other in lenses.names if other not in but]
    return sum(
        (1 if mirrored else -1) * _agreement(board, lenses, views, name, other, mirrored)
        for other in others
        for mirrored in (True, False)
    )


def _agreement(
    board: Board, lenses: Rig, views: Views, name: str, other: str, mirrored: bool
) -> int:
    """Counts the boards on which two cameras agree, the first one's pictures perhaps mirrored."""
    both = {moment: seen for moment, seen in views.items() if name in seen and other in seen}
    own = {
        moment: _mirrored(board, lenses[name], seen[name]) if mirrored else seen[name]
        for moment, seen in both.items()
    }
    placed = place_boards(
        board,
        lenses,
        {moment: {name: own[moment], other: seen[other]} for moment, seen in both.items()},
    )
    placed = {moment: seen for moment, seen in placed.items() if len(seen) == 2}
    return relative(other, name, placed)[2] if placed else 0


def _mirrored(board: Board, camera: Camera, view: BoardView) -> BoardView:
    """Returns what a view would be had its picture not been mirrored."""
    pixels = view.pixels * [-1, 1] + [2 * camera.matrix[0, 2], 0]
    if board.marker_m is not None:
        return BoardView(view.ids, pixels, view.size)
    # The detector counted as if the board were not mirrored, from the end at which the first inner
    # square is dark.
    grid = pixels.reshape(board.rows, board.columns, 2)
    grid = grid[:, ::-1] if board.columns % 2 == 0 else grid[::-1]
    return BoardView(view.ids, grid.reshape(-1, 2), view.size)
