"""C3D: named points over time, for motion capture software, MATLAB and biomechanics tools."""

import errno
from pathlib import Path

import ezc3d
import numpy as np

from calib.errors import InputError
from silhouette_core.motion.conditioning import conditioning_words
from silhouette_core.motion.motion import Motion
from voxelpose.export.skeleton import every_frame, named_points

_MM_PER_M = 1000
_MAX_FRAMES = 65535  # the format's frame numbers have 16 bits
_MOST_LISTED = 255  # values along a parameter's dimension
_POINT_BYTES = 16  # one point in one frame: x, y, z and residual, as float32


def write_c3d(motion: Motion, path: Path) -> None:
    """Writes the points of `named_points`, of at least one pose, as C3D.

    Axis map: none; x, y, z are the upright frame's, as is usual in motion capture laboratories;
    millimetres. POINT:X_SCREEN and POINT:Y_SCREEN state the axes that point right and up on a
    screen: +X and +Z.

    The file holds every frame from the first to the last pose. Frames without a pose have the
    residual -1, C3D's mark of a point that was not seen, and no position. Frame 1 is frame 0 of the
    recording, as in TRC: TRIAL:ACTUAL_START_FIELD and :ACTUAL_END_FIELD have the first and the last
    number, and so has the header where its 16 bits hold them. POINT:CONDITIONING states filter and
    filling of gaps, POINT:FILLED the frames (the first 255) that were filled, or 0.

    Raises:
        InputError: the motion is too long for C3D.
        OSError: the disk is full.
    """
    motion = motion.upright()
    frames = every_frame(motion)
    if len(frames) > _MAX_FRAMES:
        raise InputError(
            f"C3D holds at most {_MAX_FRAMES} frames and this motion spans {len(frames)}: leave"
            " c3d out of --to"
        )
    names, positions = named_points(motion)
    points = np.full((4, len(names), len(frames)), np.nan)
    points[3] = 1.0
    posed = motion.frames - frames[0]
    points[:3, :, posed] = np.moveaxis(_MM_PER_M * positions, 2, 0).swapaxes(1, 2)
    residuals = np.full((1, len(names), len(frames)), -1.0)
    residuals[:, :, posed] = 0.0

    file = ezc3d.c3d()
    parameters = file["parameters"]["POINT"]
    parameters["UNITS"]["value"] = ["mm"]
    parameters["RATE"]["value"] = [motion.fps]
    parameters["LABELS"]["value"] = list(names)
    parameters["DESCRIPTIONS"]["value"] = ["point of a body fitted to silhouettes"] * len(names)
    file.add_parameter("POINT", "X_SCREEN", ["+X"])
    file.add_parameter("POINT", "Y_SCREEN", ["+Z"])
    # Parameters hold at most 255 characters.
    file.add_parameter("POINT", "CONDITIONING", [conditioning_words(motion)[:255]])
    filled = [float(frame) for frame in motion.frames[motion.filled] + 1]
    file.add_parameter("POINT", "FILLED", filled[:_MOST_LISTED] or [0.0])
    for name, number in (("START", frames[0] + 1), ("END", frames[-1] + 1)):
        # As two words of 16 bits, the lower one first; a list would become floating-point numbers.
        file.add_parameter("TRIAL", f"ACTUAL_{name}_FIELD", 0)
        words = np.array([number], "<u4").view("<i2").astype(int)
        file["parameters"]["TRIAL"][f"ACTUAL_{name}_FIELD"]["value"] = words
    if frames[-1] < _MAX_FRAMES:
        file["header"]["points"]["first_frame"] = int(frames[0])
    file["data"]["points"] = points
    file["data"]["meta_points"]["residuals"] = residuals
    file.write(str(path))
    # ezc3d does not report a failed write.
    if not path.is_file() or path.stat().st_size < _POINT_BYTES * len(names) * len(frames):
        raise OSError(errno.ENOSPC, "no space left", str(path))
