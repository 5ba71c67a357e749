"""Memory of `track` over a long video.

Usage: `python -m benchmarks.memory FRAMES ...`, for example 300 1500 6000.

The silhouettes of a clip of two seconds are repeated in memory. Every length runs in its own
process, whose largest resident set is printed, in the end and every 150 frames.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np

from benchmarks.filter import clip
from benchmarks.silhouette_source import SilhouetteSource
from silhouette_core.estimator import Settings
from silhouette_core.monocular.monocular_estimator import MonocularEstimator
from silhouette_core.progress import SilentReporter

_EVERY = 150


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


class Loop(SilhouetteSource):
    """The clip, repeated.

    Attributes:
        peaks: largest resident set so far, MiB, every 150 frames.
    """

    def __init__(self, frame_count: int):
        camera, masks = clip()
        super().__init__(camera, masks, repeats=-(-frame_count // len(masks)))
        self.peaks: list[float] = []

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, np.ndarray]]]:
        for frame, seconds, pictures in super().__iter__():
            if frame % _EVERY == 0 and frame:
                self.peaks.append(_peak_mib())
            yield frame, seconds, pictures


def main(lengths: list[str]) -> None:
    """Measures every length in its own process, or a single one in this process."""
    if len(lengths) != 1:
        for length in lengths:
            subprocess.run([sys.executable, "-m", "benchmarks.memory", length], check=True)
        return
    started = time.perf_counter()
    film = Loop(int(lengths[0]))
    motion = MonocularEstimator().estimate(film, Settings(), SilentReporter()).motion
    seconds = time.perf_counter() - started
    arrays = [
        motion.root_m,
        motion.root_quaternion,
        motion.angles_rad,
        motion.frames,
        motion.time_s,
        *motion.quality.values(),
    ]
    kept = sum(np.asarray(array).nbytes for array in arrays) / 2**20
    print(
        f"{lengths[0]:>7} frames: at most {_peak_mib():.0f} MiB resident, the motion's arrays"
        f" {kept:.1f} MiB, {1000 * seconds / len(motion):.0f} ms a frame\n"
        f"        so far, every {_EVERY} frames:"
        f" {', '.join(f'{peak:.0f}' for peak in film.peaks)}",
        flush=True,
    )


if __name__ == "__main__":
    main(sys.argv[1:])
