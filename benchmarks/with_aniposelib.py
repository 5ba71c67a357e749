"""Calibrates cameras by aniposelib; run by benchmarks.calibration in an environment of its own.

aniposelib wants opencv-contrib-python, which conflicts with opencv-python-headless, and states
no ranges: hence another process, and .npz files between the two. Nothing of this project is
imported here.
"""

import contextlib
import io
import sys
import time
import warnings

import numpy as np
from aniposelib.boards import Checkerboard
from aniposelib.cameras import Camera, CameraGroup


def main(input_file: str, output_file: str) -> None:
    """Reads corners and lenses, writes cameras and seconds."""
    warnings.simplefilter("ignore")
    data = np.load(input_file)
    cameras = [
        Camera(
            matrix=data["matrices"][index],
            dist=data["distortions"][index],
            size=[int(n) for n in data["sizes"][index]],
            name=str(index),
        )
        for index in range(len(data["matrices"]))
    ]
    group = CameraGroup(cameras)
    columns, rows = (int(n) for n in data["board"])
    board = Checkerboard(columns, rows, square_length=float(data["square_m"]))
    all_rows = []
    for corners in data["corners"]:  # (moments, corners, 2), NaN where the camera saw no board
        lines = [
            {"framenum": (0, moment), "corners": pixels.reshape(-1, 1, 2), "ids": board.ids}
            for moment, pixels in enumerate(corners)
            if np.isfinite(pixels).all()
        ]
        all_rows.append(board.fill_points_rows(lines))
    np.random.seed(0)  # noqa: NPY002  # it draws its samples from the global generator
    lenses_known = bool(data["lenses_known"])
    started = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()):
        group.calibrate_rows(
            all_rows,
            board,
            init_intrinsics=not lenses_known,
            only_extrinsics=lenses_known,
            verbose=False,
        )
    seconds = time.perf_counter() - started
    np.savez(
        output_file,
        matrices=np.array([camera.get_camera_matrix() for camera in cameras]),
        distortions=np.array([np.ravel(camera.get_distortions()) for camera in cameras]),
        turns=np.array([np.ravel(camera.get_rotation()) for camera in cameras]),
        shifts=np.array([np.ravel(camera.get_translation()) for camera in cameras]),
        seconds=seconds,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
