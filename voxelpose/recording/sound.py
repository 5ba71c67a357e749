"""Loudness of a video's sound over time, read by FFmpeg, which imageio-ffmpeg brings along."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from calib.errors import InputError
from calib.signals import Signal
from voxelpose.recording.ffmpeg import QUIET, packets, program, video_address, words_on
from voxelpose.tuning import SYNCHRONISATION

STEP_S = 1 / 1000
"""Time between values of the loudness, s."""
_RATE_HZ = 16000
_PER_STEP = round(_RATE_HZ * STEP_S)
_CHUNK = 4 * _PER_STEP * 1000  # bytes
_LOWEST_HZ = 300  # hum, wind and steps are below


def has_sound(path: Path) -> bool:
    """Whether a file is a video with sound."""
    return path.is_file() and "Audio:" in words_on(path)


def onsets(path: Path, camera: str, seconds: float) -> Signal:
    """How suddenly it becomes loud, (T, 1), each millisecond: a clap is a peak, noise is zero.
    InputError where the video has no sound that can be read.

    Args:
        seconds: length of the part, from the beginning, that is used.

    Returns:
        The signal, in the time in which the first picture was taken at 0.
    """
    energy = np.concatenate([np.zeros(0), *_energies(path, seconds)])
    if len(energy) < 1 / STEP_S:
        raise InputError(
            f"{path} has no sound that can be read: record with sound, or choose another way with"
            " --by"
        )
    quiet = 1e-10  # energy of nothing, of full scale
    around = round(SYNCHRONISATION.around_s / STEP_S)
    level = np.log(uniform_filter1d(energy, round(around / 4)) + quiet)
    smooth = np.log(uniform_filter1d(energy, around) + quiet)
    floor = minimum_filter1d(smooth, round(1 / STEP_S))
    above = np.maximum(level - floor - SYNCHRONISATION.sudden, 0)
    rise = np.maximum(np.diff(above, prepend=above[0]), 0)
    time_s = np.asarray(
        (np.arange(len(rise)) + 0.5) * STEP_S - _first_picture_s(path), dtype=np.float64
    )
    return Signal(camera, time_s, rise[:, None])


def _energies(path: Path, seconds: float) -> Iterator[NDArray[np.float64]]:
    """Yields the mean energy of every millisecond since the file's beginning, (N,) each."""
    # Silence is put where the sound begins later than the pictures, or has gaps.
    filters = f"aresample={_RATE_HZ}:async=1:first_pts=0,highpass=f={_LOWEST_HZ}"
    words = ["-t", f"{seconds:.3f}", "-i", video_address(path), "-map", "0:a:0", "-af", filters]
    command = [*QUIET, *words, "-ac", "1", "-f", "f32le", "-"]
    with subprocess.Popen([program(), *command], stdout=subprocess.PIPE) as process:
        while process.stdout and (chunk := process.stdout.read(_CHUNK)):
            samples = np.frombuffer(chunk[: len(chunk) // 4 * 4], "<f4").astype(np.float64)
            whole = samples[: len(samples) // _PER_STEP * _PER_STEP]
            yield np.nan_to_num(whole.reshape(-1, _PER_STEP) ** 2).mean(axis=1)


def _first_picture_s(path: Path) -> float:
    """Time of the first picture, s, in the file's time, in which the sound may begin before it."""
    first_s = packets(path, "-frames:v", "1")[:1, 1]
    return float(np.nan_to_num(first_s).max(initial=0.0))
