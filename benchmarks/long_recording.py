"""Memory and time per frame over a long recording: `python -m benchmarks.long_recording fit|track
[--minutes 120] [--varied SEED]`.

A rendered clip of three seconds, whose end meets its beginning, is repeated in the videos
themselves (20 frames a second); with --varied it is a take of ../shared's recorded motions instead
(`benchmarks.varied_take`, 15 frames a second), kept in out/long. The whole is estimated as by the
command, without pictures. For every stage that goes through the frames: steps, milliseconds a step
and resident memory of all its processes in the second and the last tenth (the first also loads and
compiles). Afterwards the result's files are read and scored: minute by minute, to see whether
errors grow.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import imageio_ffmpeg
import psutil

from benchmarks.varied_take import varied_take
from silhouette_core.estimator import Settings
from silhouette_core.motion.joint_files import read_joints
from voxelpose.demo.room import make_recording
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit, track
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth
from voxelpose.results import Result

CLIP_FRAMES = 60
OUT = Path(__file__).resolve().parents[1] / "out" / "long"


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


def scratch_mib() -> float:
    """Size of the files without a name that this process holds, MiB; 0 where it cannot be told."""
    places = [*Path("/proc/self/fd").glob("*")]
    files = [place.stat() for place in places if place.exists()]
    return sum(file.st_size for file in files if not file.st_nlink) / 2**20


def processor_seconds() -> float:
    """Processor time of this process and of those it waited for, s."""
    times = psutil.Process().cpu_times()
    return times.user + times.system + times.children_user + times.children_system


@dataclass
class Watch:
    """Reporter that keeps time and memory of every stage.

    Attributes:
        stages: name, and (steps so far, s, MiB) every fiftieth step.
        peak_mib: largest resident memory.
        scratch_mib: most that was kept in scratch files.
    """

    stages: list[tuple[str, list[tuple[int, float, float]]]] = field(default_factory=list)
    peak_mib: float = 0.0
    scratch_mib: float = 0.0
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
        self.scratch_mib = max(self.scratch_mib, scratch_mib())
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


def looped(minutes: float, scratch: Path) -> tuple[Path, Path]:
    """The repeated clip, made anew, and the place of its result."""
    clip = make_recording(scratch / "clip", CLIP_FRAMES)
    repeat(clip, scratch / "long", max(1, round(minutes * 60 * 20 / CLIP_FRAMES)))
    # Only the first clip's truth is known: it is scored as far as it goes.
    shutil.copy(clip / "truth.json", scratch / "long")
    return scratch / "long", scratch / "out"


def score_rows(folder: Path, result: Path, fps: float) -> list[str]:
    """A line of Markdown for every minute of the result whose truth is known."""
    truth = read_truth(folder / "truth.json")
    estimate = read_joints(result / "joints.csv", len(truth))
    minute = round(60 * fps)
    lines = ["| minute | root_mm | mpjpe_mm | flips | lost |", "|---|---|---|---|---|"]
    for start in range(0, len(truth), minute):
        part = slice(start, start + minute)
        score = score_motion(truth[part], estimate[part])
        lines.append(
            f"| {start // minute + 1} | {score.root_mm:.1f} | {score.mpjpe_mm:.1f}"
            f" | {score.flips:.3f} | {score.lost:.3f} |"
        )
    score = score_motion(truth, estimate)
    joints = [
        f"{name} {mm:.0f}" for name, mm in zip(score.joints, score.joint_root_mm, strict=True)
    ]
    lines.append(f"| all | {score.root_mm:.1f} | {score.mpjpe_mm:.1f} | {score.flips:.3f} |")
    return [*lines, f"joints, root_mm: {', '.join(joints)}"]


def main() -> None:
    """Estimates the recording and prints the tables."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("command", choices=("fit", "track"))
    words.add_argument("--minutes", type=float, default=120.0)
    words.add_argument("--varied", type=int, metavar="SEED")
    given = words.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        if given.varied is None:
            folder, out = looped(given.minutes, Path(scratch))
        else:
            folder = varied_take(OUT / f"take_{given.varied}", given.varied, given.minutes)
            out = OUT / f"{given.command}_{given.varied}"
        watch = Watch()
        recording = Recording.open(folder)
        if given.command == "track":
            recording = Recording.open(folder, cameras=[recording.rig.names[-1]])
        estimate = track if given.command == "track" else fit
        before_s, begun_s = processor_seconds(), time.perf_counter()
        output = Output(out, pictures=False, overwrite=True)
        estimate(recording, output, Settings(), reporter=watch)
        spent_s = time.perf_counter() - begun_s
        worked_s = processor_seconds() - before_s
        result = Result.open(out)
        rows = sum(1 for _ in (out / "joints.csv").open()) - 1
        frames, poses = recording.frame_count, len(result.motion)
        print(
            f"{given.command}, {given.minutes:g} minutes, {frames} frames: {spent_s / 60:.1f} min,"
            f" {1000 * spent_s / frames:.0f} ms a frame ({1000 * worked_s / frames:.0f} of the"
            f" processors), at most {watch.peak_mib:.0f} MiB"
            f" of memory, {watch.scratch_mib:.1f} of scratch files;"
            f" {poses} poses, {rows} rows of joints.csv"
        )
        print("\n".join([*watch.table(), *score_rows(folder, out, recording.fps)]))


if __name__ == "__main__":
    main()
