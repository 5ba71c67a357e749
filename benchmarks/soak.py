"""A live session over many frames: `python -m benchmarks.soak RECORDING [--cameras cam_0 cam_2]
[--fps 60] [--frames 108000]`, an hour at 30 a second by default.

The recording is played forth and back, faster than it was taken, until so many frames have been
estimated. Printed are, ten times on the way, the resident memory of each of the session's
processes, dropped moments and recent durations: a camera that falls behind the others lengthens
"capture". Linux only: memory is read from /proc.
"""

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from benchmarks.live import Receiver, family, forth_and_back, session_of
from silhouette_core.estimator import Settings
from voxelpose.live.live_input import open_input


def resident_mib() -> list[int]:
    """Resident memory, MiB, of this process and of those it has begun, in the order of begin."""
    sizes = []
    for process in family():
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
        sizes += [int(line.split()[1]) // 1024 for line in lines if line.startswith("VmRSS")]
    return sizes


def main() -> None:
    """Runs the session."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("recording", type=Path)
    words.add_argument("--cameras", nargs="+")
    words.add_argument("--fps", type=float, default=60.0)
    words.add_argument("--frames", type=int, default=108_000)
    given = words.parse_args()
    live = open_input(given.recording, [], given.cameras)
    settings = Settings(stature_m=live.recording.subject.stature_m, smooth=False)
    with tempfile.TemporaryDirectory() as folder:
        played, _ = forth_and_back(live, Path(folder))
        receiver = Receiver()
        with session_of(replace(played, fps=given.fps), settings, receiver) as session:
            begun_s, told = time.monotonic(), 0
            while session.times.frames < given.frames:
                if session.wait(0.5):
                    raise SystemExit("the session ended")
                receiver.messages.clear()  # it is not the receiver's memory that is measured
                state, passed_s = session.state, time.monotonic() - begun_s
                if state.frames < told * given.frames / 10:
                    continue
                told += 1
                spent = " ".join(f"{k} {1000 * v:.0f}" for k, v in session.times.medians().items())
                print(
                    f"{passed_s:.0f} s: {state.frames} frames, {state.dropped} dropped,"
                    f" {state.phase}; MiB {resident_mib()}; recent ms: {spent}",
                    flush=True,
                )
        receiver.close()


if __name__ == "__main__":
    main()
