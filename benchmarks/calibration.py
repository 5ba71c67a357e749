"""Accuracy of calibration from the same corners by this project, OpenCV and aniposelib:
`python -m benchmarks.calibration`.

Synthetic corners need nothing; the real ones are those of the shared recordings board_images and
standing4 (see CONTRIBUTING.md). aniposelib is installed into an environment of its own, in the
user's cache folder, on the first run.
"""

import argparse
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import platformdirs
from numpy.typing import NDArray

from benchmarks.accuracy import SHARED
from benchmarks.board_scene import (
    CHECKERBOARD,
    align_rigs,
    board_views,
    lens_views,
    room,
    without_poses,
)
from calib.board import Board, BoardView
from calib.camera import Camera, Rig
from calib.extrinsics import calibrate_extrinsics, pose_difference
from calib.files import read_rig
from calib.intrinsics import calibrate_intrinsics
from calib.rotation import matrix_from_rodrigues

NOISE_PX = 0.3
MOMENTS = 60
Views = Mapping[str, Mapping[str, BoardView]]


@dataclass(frozen=True, eq=False)
class Task:
    """Input of a calibration.

    Attributes:
        board: The board.
        lenses: Cameras; only their image sizes are valid unless `lenses_known`.
        views: Detected corners: moment -> camera -> view.
        lenses_known: Whether the lenses are calibrated.
    """

    board: Board
    lenses: Rig
    views: Views
    lenses_known: bool


def by_us(task: Task) -> Rig:
    """Lenses separately unless known, then poses, then both together."""
    lenses = task.lenses
    if not task.lenses_known:
        calibrated = []
        for camera in lenses:
            own = {
                moment: seen[camera.name]
                for moment, seen in task.views.items()
                if camera.name in seen
            }
            lens = calibrate_intrinsics(task.board, own, camera=camera.name)
            calibrated.append(
                replace(camera, matrix=lens.camera.matrix, distortion=lens.camera.distortion)
            )
        lenses = Rig(tuple(calibrated))
    return calibrate_extrinsics(
        task.board, without_poses(lenses), task.views, refine_lenses=not task.lenses_known
    ).rig


def by_opencv(task: Task) -> Rig:
    """cv2.calibrateMultiview."""
    count, names = len(task.lenses), task.lenses.names
    points = [task.board.points_m.astype(np.float32)] * len(task.views)
    empty = np.zeros((0, 2), np.float32)
    pixels = [
        [np.float32(seen[name].pixels) if name in seen else empty for seen in task.views.values()]
        for name in names
    ]
    detected = np.array(
        [[name in seen for seen in task.views.values()] for name in names], np.uint8
    )
    guess, lenses = 0, (None, None)
    if task.lenses_known:
        guess = cv2.CALIB_USE_INTRINSIC_GUESS
        lenses = (
            [camera.matrix.copy() for camera in task.lenses],
            [_five(camera.distortion)[None] for camera in task.lenses],
        )
    _, matrices, distortions, turns, shifts = cv2.calibrateMultiview(
        points,
        pixels,
        [camera.size for camera in task.lenses],
        detected,
        np.zeros(count, np.uint8),
        *lenses,
        None,
        None,
        flagsForIntrinsics=np.full(count, guess, np.int32),
        flags=guess,
    )
    return _rig(task.lenses, matrices, distortions, turns, shifts)


def by_aniposelib(task: Task) -> Rig:
    """aniposelib's calibrate_rows with its defaults, in an environment of its own."""
    python = _environment()
    corners = np.full(
        (len(task.lenses), len(task.views), task.board.columns * task.board.rows, 2), np.nan
    )
    for moment, seen in enumerate(task.views.values()):
        for index, name in enumerate(task.lenses.names):
            if name in seen:
                corners[index, moment] = seen[name].pixels
    with tempfile.TemporaryDirectory() as folder:
        input_file, output_file = Path(folder) / "given.npz", Path(folder) / "found.npz"
        np.savez(
            input_file,
            corners=corners,
            matrices=np.array([camera.matrix for camera in task.lenses]),
            distortions=np.array([_five(camera.distortion) for camera in task.lenses]),
            sizes=np.array([camera.size for camera in task.lenses]),
            board=np.array([task.board.columns, task.board.rows]),
            square_m=task.board.square_m,
            lenses_known=task.lenses_known,
        )
        process = subprocess.run(
            [python, Path(__file__).with_name("with_aniposelib.py"), input_file, output_file],
            capture_output=True,
            text=True,
        )
        if process.returncode:
            raise RuntimeError(process.stderr.strip().splitlines()[-1])
        result = np.load(output_file)
        return _rig(
            task.lenses,
            result["matrices"],
            result["distortions"],
            result["turns"],
            result["shifts"],
        )


def _environment() -> Path:
    """Interpreter of aniposelib's environment, which is created if missing."""
    folder = Path(platformdirs.user_cache_dir("voxelpose")) / "aniposelib"
    python = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    if not (folder / "ready").exists():
        print(f"installing aniposelib into {folder}", file=sys.stderr)
        venv.create(folder, clear=True, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "aniposelib>=0.8"], check=True)
        (folder / "ready").touch()
    return python


def _five(distortion: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.append(distortion, np.zeros(5 - len(distortion)))


def _rig(like: Rig, matrices, distortions, turns, shifts) -> Rig:
    """Rig from another library's result."""
    cameras = []
    for camera, matrix, distortion, turn, shift in zip(
        like, matrices, distortions, turns, shifts, strict=True
    ):
        matrix = np.asarray(matrix, dtype=np.float64)
        pose = {"rotation": matrix_from_rodrigues(np.ravel(turn)), "translation": np.ravel(shift)}
        cameras.append(replace(camera, matrix=matrix, distortion=np.ravel(distortion), **pose))
    return Rig(tuple(cameras))


METHODS = {"ours": by_us, "cv2.calibrateMultiview": by_opencv, "aniposelib": by_aniposelib}


def off_centre(rig: Rig, seed: int) -> Rig:
    """The rig with optical centres off the middle of the image, as in real lenses."""
    rng = np.random.default_rng(seed)
    cameras = []
    for camera in rig:
        matrix = camera.matrix.copy()
        matrix[:2, 2] += rng.normal(0, 12, 2)
        cameras.append(replace(camera, matrix=matrix))
    return Rig(tuple(cameras))


def synthetic(methods: Mapping[str, Callable[[Task], Rig]], rooms: int) -> None:
    """Four cameras 4 m from the middle of a room, a board of 8 x 5 corners moved through it."""
    print(
        f"{rooms} room(s) of 4 cameras, {MOMENTS} boards, {NOISE_PX} px noise: mean (and worst)"
        " error of a camera"
    )
    for lenses_known in (True, False):
        print(f"lenses {'known' if lenses_known else 'from the same corners'}:")
        for name, method in methods.items():
            lines, seconds = [], 0.0
            for seed in range(rooms):
                truth = off_centre(room(4, seed=seed), seed)
                task = Task(
                    CHECKERBOARD,
                    truth,
                    board_views(truth, CHECKERBOARD, MOMENTS, NOISE_PX, seed),
                    lenses_known,
                )
                started = time.perf_counter()
                estimate = align_rigs(method(task), truth)
                seconds += time.perf_counter() - started
                for camera in truth:
                    focal = abs(estimate[camera.name].matrix[0, 0] / camera.matrix[0, 0] - 1)
                    lines.append((*pose_difference(estimate[camera.name], camera), 100 * focal))
            mean, worst = np.mean(lines, axis=0), np.max(lines, axis=0)
            focal = "" if lenses_known else f", focal length {mean[2]:.2f} ({worst[2]:.2f}) %"
            print(
                f"  {name:<26} position {mean[0]:.2f} ({worst[0]:.2f}) mm, rotation {mean[1]:.3f}"
                f" ({worst[1]:.3f}) deg{focal}, {seconds / rooms:.1f} s",
                flush=True,
            )


def near_boards(rooms: int) -> None:
    """Lenses alone, from boards in front of the camera, against cv2.calibrateCamera with the same
    model.
    """
    print(
        f"a lens from 20 boards held before it, {NOISE_PX} px noise, {rooms} camera(s): mean error"
        " of the focal length"
    )
    errors = []
    for seed in range(rooms):
        camera = room(1, seed=seed).cameras[0]
        camera = replace(camera, rotation=np.eye(3), translation=np.zeros(3))
        views = lens_views(camera, 20, NOISE_PX, seed=seed)
        ours = calibrate_intrinsics(CHECKERBOARD, views).camera.matrix[0, 0]
        theirs = _calibrate_camera(CHECKERBOARD, list(views.values()), camera)[1]
        errors.append([100 * abs(focal / camera.matrix[0, 0] - 1) for focal in (ours, theirs)])
    print(
        f"  ours {np.mean(errors, axis=0)[0]:.3f} %, cv2.calibrateCamera"
        f" {np.mean(errors, axis=0)[1]:.3f} %"
    )


def _calibrate_camera(board: Board, views: list[BoardView], camera: Camera) -> tuple[float, float]:
    """OpenCV's reprojection error, px, and focal length."""
    points = [board.points_m[view.ids].astype(np.float32) for view in views]
    pixels = [view.pixels.astype(np.float32) for view in views]
    rms, matrix, *_ = cv2.calibrateCamera(
        points, pixels, camera.size, None, None, flags=cv2.CALIB_FIX_K3
    )
    return rms, float(matrix[0, 0])


def board_images(folder: Path) -> None:
    """Lenses from real stills."""
    print("board_images: reprojection error, px (focal length)")
    board = Board(7, 4, 0.06)
    for camera_folder in sorted(folder.glob("cam_*")):
        views = {
            path.name: board.find(cv2.imread(str(path)))
            for path in sorted(camera_folder.glob("*.jpg"))
        }
        ours = calibrate_intrinsics(board, views, camera=camera_folder.name)
        good = [view for view in views.values() if isinstance(view, BoardView)]
        camera = ours.camera
        rms, focal = _calibrate_camera(board, good, camera)
        print(
            f"  {camera.name}: ours {ours.rms_px:.3f} ({camera.matrix[0, 0]:.0f}),"
            f" cv2.calibrateCamera {rms:.3f} ({focal:.0f})",
            flush=True,
        )


def standing4(folder: Path, methods: Mapping[str, Callable[[Task], Rig]]) -> None:
    """One real board seen by four cameras. Its order of corners is ambiguous, and is corrected for
    the other programs.
    """
    known = read_rig(folder / "calibration.toml")
    board = Board(8, 6, 0.115)
    seen = {}
    for camera in known:
        listed = (
            np.load(folder / f"{camera.name}_board_corners_8x6.npy", allow_pickle=False)
            .reshape(-1, 2)
            .astype(float)
        )
        reprojected = camera.project(board.points_m)[0]
        ordered = min(
            (listed, listed[::-1]), key=lambda pixels: np.linalg.norm(pixels - reprojected)
        )
        seen[camera.name] = BoardView(np.arange(48), ordered, camera.size)
    print("standing4, one board: reprojection error, px")
    print(f"  {'its calibration.toml':<26} {_reprojection(known, board, seen):.3f}")
    for name, method in methods.items():
        try:
            rig = method(Task(board, known, {"board": seen}, True))
            print(f"  {name:<26} {_reprojection(rig, board, seen):.3f}")
        except (RuntimeError, cv2.error) as error:
            print(f"  {name:<26} cannot: {str(error).splitlines()[0]}")


def _reprojection(rig: Rig, board: Board, seen: Mapping[str, BoardView]) -> float:
    """Root mean square reprojection error, px, of one board at its optimal pose."""
    corners_m = calibrate_board(rig, board, seen)
    errors = [camera.project(corners_m)[0] - seen[camera.name].pixels for camera in rig]
    return float(np.sqrt((np.concatenate(errors) ** 2).sum(axis=1).mean()))


def calibrate_board(rig: Rig, board: Board, seen: Mapping[str, BoardView]) -> NDArray[np.float64]:
    """Corners (N, 3), m, of a board at the pose with the least error in fixed cameras."""
    from scipy.optimize import least_squares

    from calib.adjust import ideal_poses

    first = rig.cameras[0]
    rotation, translation, _ = ideal_poses(first, board.points_m, seen[first.name].pixels)[0]
    start = first.rotation.T @ rotation, first.rotation.T @ (translation - first.translation)

    def corners(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return board.points_m @ (matrix_from_rodrigues(x[:3]) @ start[0]).T + start[1] + x[3:]

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.concatenate(
            [(camera.project(corners(x))[0] - seen[camera.name].pixels).ravel() for camera in rig]
        )

    return corners(least_squares(residuals, np.zeros(6), x_scale="jac").x)


def main() -> None:
    """Prints everything."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--without-aniposelib", action="store_true", help="install nothing")
    parser.add_argument(
        "--rooms",
        type=int,
        default=1,
        help="how many made-up rooms; aniposelib takes minutes for each",
    )
    arguments = parser.parse_args()
    without_aniposelib = arguments.without_aniposelib
    methods = {
        name: method
        for name, method in METHODS.items()
        if not (without_aniposelib and name.startswith("aniposelib"))
    }
    near_boards(arguments.rooms)
    synthetic(methods, arguments.rooms)
    if (SHARED / "data" / "board_images").is_dir():
        board_images(SHARED / "data" / "board_images")
        standing4(SHARED / "data" / "standing4", methods)


if __name__ == "__main__":
    main()
