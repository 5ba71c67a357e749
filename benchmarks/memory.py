"""Memory of `track` over a long video.

Usage: `python -m benchmarks.memory [--method paper] FRAMES ...`, for example 300 1500 6000. 108000
are two hours at the clip's 15 frames a second.

The silhouettes of a clip of two seconds are repeated in memory. Every length runs in its own
process, whose largest resident set is printed, in the end and at twenty times before.
"""

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
from silhouette_core.monocular.tree_estimator import TreeEstimator
from silhouette_core.progress import SilentReporter


def _peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


class Loop(SilhouetteSource):
    """The clip, repeated.

    Attributes:
        peaks: largest resident set so far, MiB, at twenty times.
    """

    def __init__(self, frame_count: int):
        camera, masks = clip()
        super().__init__(camera, masks[::2], 15.0, repeats=-(-2 * frame_count // len(masks)))
        self.peaks: list[float] = []

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, np.ndarray]]]:
        for frame, seconds, pictures in super().__iter__():
            if frame and frame % max(self.frame_count // 20, 1) == 0:
                self.peaks.append(_peak_mib())
            yield frame, seconds, pictures


def main(words: list[str]) -> None:
    """Measures every length in its own process, or a single one in this process."""
    method, lengths = (words[:2], words[2:]) if words[:1] == ["--method"] else ([], words)
    if len(lengths) != 1:
        for length in lengths:
            command = [sys.executable, "-m", "benchmarks.memory", *method, length]
            subprocess.run(command, check=True)
        return
    started = time.perf_counter()
    film = Loop(int(lengths[0]))
    estimator = TreeEstimator() if method else MonocularEstimator()
    motion = estimator.estimate(film, Settings(), SilentReporter()).motion
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
        f"        so far: {', '.join(f'{peak:.0f}' for peak in film.peaks)}",
        flush=True,
    )


if __name__ == "__main__":
    main(sys.argv[1:])
