"""FFmpeg, the program that imageio-ffmpeg brings along, and when it shows a video's pictures."""

import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError

QUIET = ("-v", "quiet", "-nostdin")
_STREAMS = frozenset(".ts .mts .m2ts .mpg .mpeg".split())  # they begin at any time of a clock
_UNKNOWN = -(2**62)  # ticks, below which FFmpeg says that it does not know


def picture_times(path: Path) -> tuple[int, NDArray[np.float64] | None]:
    """Number of the coded pictures that a video shows, and when it shows them, (n,) float64, s,
    increasing; None where it does not tell. Nothing is decoded. (0, None) without FFmpeg.
    """
    try:
        table = packets(path, "-copyts")
    except (InputError, OSError):
        return 0, None
    times_s = np.sort(table[:, 1])
    if not len(table) or np.isnan(times_s).any():
        return len(table), None
    times_s = times_s[times_s >= 0]  # an edit list cuts off the others
    if not len(times_s) or (np.diff(times_s) <= 0).any():
        return len(table), None
    # Without an edit list, pictures come late by as much as some are coded ahead.
    counts_from_first = path.suffix.lower() in _STREAMS or table[0, 0] == 0
    return len(times_s), times_s - times_s[0] * counts_from_first


def packets(path: Path, *words: str) -> NDArray[np.float64]:
    """When a video's coded pictures are to be decoded and shown, (n, 2), s, in the order of the
    file; NaN where it does not tell.

    Args:
        words: further options of FFmpeg's output.

    Raises:
        InputError: there is no FFmpeg for this machine.
    """
    source = ["-i", str(path.absolute()), "-map", "0:v:0", "-c", "copy", *words]
    unit, rows = 1.0, []
    for line in finished(*QUIET, *source, "-f", "framecrc", "-").stdout.splitlines():
        if line.startswith("#tb 0:"):
            top, _, bottom = line.removeprefix("#tb 0:").partition("/")
            unit = float(top) / float(bottom)
        elif line.startswith("0,"):
            rows.append([int(ticks) for ticks in line.split(",")[1:3]])
    ticks = np.array(rows, np.int64).reshape(-1, 2)
    return np.where(ticks > _UNKNOWN, ticks * unit, np.nan)


def finished(*words: str) -> subprocess.CompletedProcess[str]:
    """FFmpeg with these arguments, at its end.

    Raises:
        InputError: there is none for this machine.
    """
    return subprocess.run(
        [program(), *words], capture_output=True, check=False, encoding="utf-8", errors="replace"
    )


def program() -> str:
    """Path of FFmpeg.

    Raises:
        InputError: there is none for this machine.
    """
    import imageio_ffmpeg

    try:
        return imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise InputError(
            "this needs FFmpeg, which the package imageio-ffmpeg has none of for this machine:"
            " install it and set IMAGEIO_FFMPEG_EXE to its path"
        ) from error
