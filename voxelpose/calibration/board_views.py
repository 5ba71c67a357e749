"""Boards in stills and videos: cameras in folders, detection of the board, selection of views."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from calib.board import Board, BoardView, Effort, Refusal
from calib.camera import Camera
from calib.checks import FloatArray
from calib.errors import InputError
from silhouette_core.progress import Reporter
from voxelpose.recording.folder import pictures_by_camera
from voxelpose.recording.frame_reader import STILLS, Frame, FrameReader, read_still
from voxelpose.tuning import BOARD_SEARCH

_MAX_EXAMINED = 400  # frames of a video in which the board is searched
_PATIENT_STEP = 20  # one frame in this many is searched with more effort
_KEPT_FAILURES = 5  # pictures without the board in which another board is searched
NOT_NEW = "shows the board much as another frame does"


@dataclass(frozen=True)
class CameraPictures:
    """Pictures of one camera: stills, or a video.

    Attributes:
        stills: Paths of stills.
        video: Reader of a video, or None.
    """

    stills: tuple[Path, ...] = ()
    video: FrameReader | None = None

    def __len__(self) -> int:
        """Counts the pictures."""
        return self.video.frame_count if self.video else len(self.stills)

    def examined(self) -> Iterator[tuple[str, Frame]]:
        """Yields names and pictures: all stills, or every n-th frame of a video."""
        if self.video is None:
            for still in self.stills:
                yield still.name, read_still(still)
            return
        step = stride(self.video.frame_count)
        for number, frame in enumerate(self.video):
            if number % step == 0:
                yield f"frame {number}", frame


def stride(frame_count: int) -> int:
    """Step between the examined frames of a video."""
    return -(-frame_count // _MAX_EXAMINED)


def check_lens_size(lens: Camera, reader: FrameReader) -> None:
    """Refuses pictures of another size than a camera's lens was calibrated at.

    Raises:
        InputError: the sizes differ.
    """
    if reader.size != lens.size:
        seen, known = (f"{width}x{height}" for width, height in (reader.size, lens.size))
        raise InputError(
            f"camera {lens.name} recorded at {seen}, its lens was calibrated at {known}: use one"
            " size"
        )


def cameras_in(paths: Sequence[Path]) -> dict[str, CameraPictures]:
    """Finds the cameras among files and folders.

    A video is a camera named after its file; stills are a camera named after their folder; a folder
    of videos and of folders of stills holds a camera for each.

    Raises:
        InputError: A path is missing, there is no picture in it, or two cameras share a name.
    """
    cameras: dict[str, CameraPictures] = {}
    loose: dict[Path, list[Path]] = {}
    for path in paths:
        if not path.exists():
            raise InputError(
                f"{path} is missing: give a folder of pictures or a video for each camera"
            )
        stills = [path] if path.suffix.lower() in STILLS else []
        if path.is_dir():
            stills = [file for file in sorted(path.iterdir()) if file.suffix.lower() in STILLS]
        if stills:
            loose.setdefault(stills[0].resolve().parent, []).extend(stills)
            continue
        inside = pictures_by_camera(path) if path.is_dir() else {path.stem: path}
        if not inside:
            raise InputError(
                f"{path} holds no pictures: give a folder of stills or videos of the board, or a"
                " folder with one of these per camera"
            )
        for name, pictures in inside.items():
            _add(cameras, name, _pictures(pictures))
    for folder, stills in loose.items():
        _add(cameras, folder.name, CameraPictures(tuple(stills)))
    return cameras


def _pictures(path: Path) -> CameraPictures:
    readers = FrameReader.open(path)
    return CameraPictures(readers.stills) if readers.stills else CameraPictures(video=readers)


def _add(cameras: dict[str, CameraPictures], name: str, pictures: CameraPictures) -> None:
    if name in cameras:
        raise InputError(
            f"two sets of pictures are named {name}: name each folder or video after its camera"
        )
    cameras[name] = pictures


def find_views(
    board: Board, pictures: CameraPictures, max_views: int, reporter: Reporter
) -> dict[str, BoardView | Refusal]:
    """Detects the board in one camera's pictures, of a video in at most `max_views` frames: by name
    a view, or the reason why there is none.

    Raises:
        InputError: A picture cannot be read, or none shows the board; another board that they show
            is described.
    """
    views: dict[str, BoardView | Refusal] = {}
    find = BoardFinder(board, stills=pictures.video is None)
    for name, picture in pictures.examined():
        views[name] = find(picture)
        reporter.advance()
    if not any(isinstance(view, BoardView) for view in views.values()):
        raise InputError(f"the board was found in none of {len(views)} pictures: {find.failure()}")
    if pictures.video is None:
        return views
    seen = {name: view for name, view in views.items() if isinstance(view, BoardView)}
    kept = select_views(board, seen, max_views)
    return {
        name: Refusal(NOT_NEW) if name in seen and name not in kept else view
        for name, view in views.items()
    }


class BoardFinder:
    """Detects the board in one camera's pictures, with as much effort as the camera needs."""

    def __init__(self, board: Board, stills: bool) -> None:
        """Begins quickly with a video, thoroughly with stills."""
        self.board = board
        self.effort: Effort = "thorough" if stills else "quick"
        self.count = 0
        self.reasons: Counter[str] = Counter()
        self.refused: list[Frame] = []

    def __call__(self, picture: Frame, important: bool = False) -> BoardView | Refusal:
        """Detects the board, with all effort in an important picture."""
        detection = self.board.find(picture, self.effort)
        if (
            isinstance(detection, Refusal)
            and self.effort == "quick"
            and self.count % _PATIENT_STEP == 0
        ):
            detection = self.board.find(picture, "patient")
            if isinstance(detection, BoardView):
                self.effort = "patient"  # the quick search misses small boards
        if isinstance(detection, Refusal) and important:
            detection = self.board.find(picture, "thorough")
        self.count += 1
        if isinstance(detection, Refusal):
            self.reasons[detection.reason] += 1
            if len(self.refused) < _KEPT_FAILURES:
                self.refused.append(picture)
        return detection

    def failure(self) -> str:
        """Reason of failure: a defect of a detected board, else another board in the pictures."""
        for reason, _ in self.reasons.most_common():
            if not reason.startswith("no board"):
                return reason
        return next(
            (
                description
                for picture in self.refused
                if (description := self.board.other_board(picture))
            ),
            next(iter(self.reasons), "there are no pictures of that time"),
        )


def select_views(board: Board, views: Mapping[str, BoardView], max_views: int) -> set[str]:
    """Selects frames of a video with a still board at different positions, sizes and tilts.

    Args:
        views: Views by frame, in order of time.
        max_views: Maximum number of frames.

    Returns:
        Names of the selected frames: each differs most from those selected before it.
    """
    names = list(views)
    if len(names) <= 1:
        return set(names)
    outlines = np.array([_outline(board, view) for view in views.values()])
    moved = np.linalg.norm(np.diff(outlines, axis=0), axis=1)
    speed = np.minimum(np.append(moved, np.inf), np.append(np.inf, moved))
    fastest = max(BOARD_SEARCH.fast * float(np.median(speed)), BOARD_SEARCH.new_view / 4)
    still = np.flatnonzero(speed <= fastest)
    chosen = [int(still[np.argmin(speed[still])])]
    distance = np.linalg.norm(outlines[still] - outlines[chosen[0]], axis=1)
    while len(chosen) < min(max_views, len(still)) and distance.max() > BOARD_SEARCH.new_view:
        best = int(np.argmax(distance))
        chosen.append(int(still[best]))
        distance = np.minimum(
            distance, np.linalg.norm(outlines[still] - outlines[chosen[-1]], axis=1)
        )
    return {names[index] for index in chosen}


def _outline(board: Board, view: BoardView) -> FloatArray:
    """Image coordinates (8,) of a board's four corners, in widths of the picture."""
    ends = board.points_m[[0, board.columns - 1, -1, -board.columns], :2]
    homography, _ = cv2.findHomography(board.points_m[view.ids, :2], view.pixels)
    if homography is None:
        return np.tile(view.pixels.mean(axis=0) / view.size[0], 4)
    return np.clip(cv2.perspectiveTransform(ends[None], homography).ravel() / view.size[0], -1, 2)
