"""C3D: named points over time, for motion capture software, MATLAB and biomechanics tools."""

from __future__ import annotations

import errno
from pathlib import Path

import ezc3d
import numpy as np

from calib.errors import InputError
from silhouette_core.motion.motion import Motion
from voxelpose.export.skeleton import every_frame, named_points

_MM_PER_M = 1000.0
_MOST_FRAMES = 65535  # ezc3d and other readers see no more: the format counts them in 16 bits
_BYTES = 16  # of a point in one frame: x, y, z and residual, as float32


def write_c3d(motion: Motion, path: Path) -> None:
    """Writes the points of `named_points` as C3D.

    Axis map: none: x, y, z are the world's, z up, as motion capture laboratories have it;
        millimetres. POINT:X_SCREEN and Y_SCREEN say
    which axes lie across and up a screen: +X and +Z.

    Every frame from the first to the last pose has a place; lost ones hold the residual -1, which
    C3D means by "not seen", and no position. The first pose is the file's frame 1, whichever frame
    of the recording it is.

    Args:
        motion: at least one pose.
        path: the file.

    Raises:
        InputError: the motion is too long for C3D.
        OSError: the disk is full.
    """
    frames = every_frame(motion)
    if len(frames) > _MOST_FRAMES:
        raise InputError(
            f"C3D holds at most {_MOST_FRAMES} frames and this motion spans {len(frames)}: leave"
            " c3d out of --to"
        )
    names, positions = named_points(motion)
    points = np.full((4, len(names), len(frames)), np.nan)
    points[3] = 1.0
    seen = motion.frames - frames[0]
    points[:3, :, seen] = np.moveaxis(_MM_PER_M * positions, 2, 0).swapaxes(1, 2)
    residuals = np.full((1, len(names), len(frames)), -1.0)
    residuals[:, :, seen] = 0.0

    file = ezc3d.c3d()
    about = file["parameters"]["POINT"]
    about["UNITS"]["value"] = ["mm"]
    about["RATE"]["value"] = [motion.fps]
    about["LABELS"]["value"] = list(names)
    about["DESCRIPTIONS"]["value"] = ["point of a body fitted to silhouettes"] * len(names)
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = residuals
    file.write(str(path))
    # ezc3d does not notice when the system refuses what it writes.
    if not path.is_file() or path.stat().st_size < _BYTES * len(names) * len(frames):
        raise OSError(errno.ENOSPC, "no space left", str(path))
