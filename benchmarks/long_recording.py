"""Memory and time per frame over a long recording: `python -m benchmarks.long_recording fit|track
[--minutes 120]`.

A rendered clip of three seconds, whose end meets its beginning, is repeated in the videos
themselves (20 frames a second), and the whole is estimated as by the command, without pictures.
For every stage that goes through the frames: steps, milliseconds a step and resident memory of all
its processes in the second and the last tenth (the first also loads and compiles). Afterwards the
result's files are read.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import imageio_ffmpeg
import psutil

from silhouette_core.estimator import Settings
from voxelpose.demo.filming import make_recording
from voxelpose.evaluation import evaluate
from voxelpose.fitting import Output, fit, track
from voxelpose.recording.folder import Recording
from voxelpose.results import Result

CAMERA = "cam_2"
CLIP_FRAMES = 60


def repeat(clip: Path, folder: Path, times: int) -> None:
    """Writes a recording whose videos repeat those of another."""
    folder.mkdir()
    for name in ("calibration.toml", "subject.toml", "background"):
        (folder / name).symlink_to(clip / name)
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    for video in clip.glob("*.mp4"):
        words = ["-stream_loop", str(times - 1), "-i", str(video), "-c", "copy"]
        subprocess.run([ffmpeg, "-loglevel", "error", *words, folder / video.name], check=True)


def resident_mib() -> float:
    """Resident memory of this process and those it has begun, MiB."""
    own = psutil.Process()
    size = own.memory_info().rss
    for child in own.children(recursive=True):
        try:
            size += child.memory_info().rss
        except psutil.NoSuchProcess:
            continue
    return size / 2**20


@dataclass
class Watch:
    """Reporter that keeps time and memory of every stage.

    Attributes:
        stages: name, and (steps so far, s, MiB) every fiftieth step.
        peak_mib: largest resident memory.
    """

    stages: list[tuple[str, list[tuple[int, float, float]]]] = field(default_factory=list)
    peak_mib: float = 0.0
    _done: int = 0

    def stage(self, name: str, total: int | None = None) -> None:
        self.stages.append((name, []))
        self._done = 0
        self._look()
        print(f"{time.strftime('%H:%M:%S')} {name}", file=sys.stderr, flush=True)

    def advance(self, steps: int = 1) -> None:
        before, self._done = self._done, self._done + steps
        if before // 50 != self._done // 50:
            self._look()

    def note(self, text: str) -> None:
        print(f"note: {text}", file=sys.stderr, flush=True)

    def _look(self) -> None:
        mib = resident_mib()
        self.peak_mib = max(self.peak_mib, mib)
        self.stages[-1][1].append((self._done, time.perf_counter(), mib))

    def table(self) -> list[str]:
        """A line of Markdown for every stage of many steps."""
        lines = [
            "| stage | steps | ms a step: second tenth | last tenth | MiB: second tenth | last |",
            "|---|---|---|---|---|---|",
        ]
        for name, looks in self.stages:
            if len(looks) < 20:
                continue
            tenth = len(looks) // 10
            first, last = (
                1000 * (looks[b][1] - looks[a][1]) / (looks[b][0] - looks[a][0])
                for a, b in ((tenth, 2 * tenth), (-tenth - 1, -1))
            )
            begin = sum(look[2] for look in looks[tenth : 2 * tenth]) / tenth
            end = sum(look[2] for look in looks[-tenth:]) / tenth
            lines.append(
                f"| {name} | {looks[-1][0]} | {first:.1f} | {last:.1f} | {begin:.0f} | {end:.0f} |"
            )
        return lines


def main() -> None:
    """Estimates the recording and prints the table."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("command", choices=("fit", "track"))
    words.add_argument("--minutes", type=float, default=120.0)
    given = words.parse_args()
    times = max(1, round(given.minutes * 60 * 20 / CLIP_FRAMES))
    with tempfile.TemporaryDirectory() as scratch:
        clip = make_recording(Path(scratch) / "clip", CLIP_FRAMES)
        folder, out, watch = Path(scratch) / "long", Path(scratch) / "out", Watch()
        repeat(clip, folder, times)
        one = [CAMERA] if given.command == "track" else None
        recording = Recording.open(folder, cameras=one)
        estimate = track if given.command == "track" else fit
        begun_s = time.perf_counter()
        estimate(recording, Output(out, pictures=False), Settings(), reporter=watch)
        spent_s = time.perf_counter() - begun_s
        result = Result.open(out)
        rows = sum(1 for _ in (out / "joints.csv").open()) - 1
        frames, poses = recording.frame_count, len(result.motion)
        print(
            f"{given.command}, {given.minutes:g} minutes, {frames} frames:"
            f" {1000 * spent_s / frames:.0f} ms a frame, at most {watch.peak_mib:.0f} MiB;"
            f" {poses} poses, {rows} rows of joints.csv"
        )
        print("\n".join(watch.table()))
        score = evaluate(out, clip / "truth.json")
        print(f"the first clip: {score.root_mm:.1f} mm")


if __name__ == "__main__":
    main()
