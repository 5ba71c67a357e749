"""Memory of `track` over a long video: `python -m benchmarks.memory [--refine] FRAMES ...`, for example 300 1500 6000.

A clip of a second and a half is repeated, silhouettes as they are, nothing on disk. Every length runs in a process of its own, of which
the largest resident set is printed. Without --refine the library's poses are left as they are, which is about ten times faster.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time
from collections.abc import Iterator

import numpy as np

from benchmarks.filter import clip, library_file
from calib.camera import Rig
from silhouette_core.estimator import Settings, Silent
from silhouette_core.filter.estimator import MonocularEstimator


class Loop:
    """The clip, again and again."""

    fps, silhouettes_given = 30.0, True

    def __init__(self, frame_count: int):
        self.camera, self.masks = clip()
        self.rig, self.frame_count = Rig((self.camera,)), frame_count

    def backgrounds(self) -> dict:
        return {}

    def regions(self) -> dict:
        return {}

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, np.ndarray]]]:
        for frame in range(self.frame_count):
            mask = self.masks[frame % len(self.masks)]
            yield frame, frame / self.fps, {self.camera.name: np.repeat(mask[..., None].astype(np.uint8) * 255, 3, axis=2)}


def main(words: list[str]) -> None:
    """Measures every length in another process, or the only one in this."""
    refine, lengths = "--refine" in words, [word for word in words if word != "--refine"]
    if len(lengths) != 1:
        for length in lengths:
            subprocess.run([sys.executable, "-m", "benchmarks.memory", length, *(["--refine"] if refine else [])], check=True)
        return
    settings, started = Settings(options={"library": str(library_file()), "refine": refine}), time.perf_counter()
    motion = MonocularEstimator().estimate(Loop(int(lengths[0])), settings, Silent()).motion
    seconds = time.perf_counter() - started
    arrays = [motion.root_m, motion.root_quaternion, motion.angles_rad, motion.frames, motion.time_s, *motion.quality.values()]
    kept = sum(np.asarray(array).nbytes for array in arrays) / 2**20
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{lengths[0]:>7} frames, {'refined' if refine else 'not refined'}: at most {peak:.0f} MiB resident, the motion's arrays "
        f"{kept:.1f} MiB, {1000 * seconds / len(motion):.0f} ms a frame",
        flush=True,
    )


if __name__ == "__main__":
    main(sys.argv[1:])
