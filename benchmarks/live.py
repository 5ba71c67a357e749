"""Live estimation with the stages of Okada and Stenger's Fig. 6(d): `python -m benchmarks.live
RECORDING [--camera NAME] [--people N] [--library LIB] [--fps 15 30] [--seconds 20] [--none]`.

With --none its empty view is left aside: the pose network tells who is there.

The recording's pictures are written as motion JPEG, as webcams deliver them, forth and back, so
that nobody jumps where they begin again, and played to a session. A receiver on this machine takes
its JSON messages. Printed are the durations of the stages, the time from a picture to its received
message, dropped frames, processor time and, where the recording has its truth, the error of the
joints: of several people that of each number, from whoever is nearest, and how often that changed.
"""

import argparse
import json
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from websockets.sync.server import serve

from benchmarks.follower import joints_of_people
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.estimator import Settings
from silhouette_core.network_files import installed_network
from silhouette_core.progress import SilentReporter
from voxelpose.live.camera_source import CameraSource
from voxelpose.live.live_input import LiveInput, make_estimator, open_input
from voxelpose.live.senders import Senders
from voxelpose.live.session import LiveSession

_QUALITY = 95
_STAGES = ("capture", "silhouettes", "waiting", "estimation", "send", "total")


class Receiver:
    """Takes JSON messages over a WebSocket.

    Attributes:
        messages: each with the Unix time at which it came.
        address: for `--send`.
    """

    def __init__(self) -> None:
        self.messages: list[tuple[float, dict]] = []
        self._server = serve(self._take, "127.0.0.1", 0)
        self.address = f"ws://127.0.0.1:{self._server.socket.getsockname()[1]}"
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def _take(self, connection) -> None:
        for line in connection:
            self.messages.append((time.time(), json.loads(line)))

    def close(self) -> None:
        self._server.shutdown()


def forth_and_back(live: LiveInput, folder: Path) -> tuple[LiveInput, int]:
    """The same input with its pictures as motion JPEG forth and back; and how many there are."""
    recording = live.recording
    shown = [frames for _, _, frames in recording]
    shown += shown[-2:0:-1]
    sources = {}
    for camera in recording.rig:
        path = folder / f"{camera.name}.avi"
        code = cv2.VideoWriter.fourcc(*"MJPG")
        writer = cv2.VideoWriter(str(path), cv2.CAP_OPENCV_MJPEG, code, live.fps, camera.size)
        writer.set(cv2.VIDEOWRITER_PROP_QUALITY, _QUALITY)
        for frames in shown:
            writer.write(frames[camera.name])
        writer.release()
        sources[camera.name] = CameraSource(camera.name, str(path))
    return replace(live, sources=sources), len(shown)


@contextmanager
def session_of(
    live: LiveInput, settings: Settings, receiver: Receiver, people: int = 1, none: bool = False
) -> Iterator[LiveSession]:
    """A session that sends to the receiver."""
    subject = replace(live.recording.subject, stature_m=settings.stature_m)
    session_settings = replace(live.settings(subject), loop=True, people=people)
    if none or not session_settings.empty:
        session_settings = replace(session_settings, empty={}, network=installed_network())
    senders = Senders([receiver.address])
    estimator = make_estimator(live, settings, SilentReporter(), people=people)
    session = LiveSession(session_settings, estimator)
    session.receivers.append(senders.send)
    try:
        session.start_cameras()
        if session.state.phase == "no background":
            session.learn_background()
        yield session
    finally:
        session.close()
        senders.close()


def errors_mm(
    messages: list[tuple[float, dict]], people_m: NDArray[np.float64], fps: float, shown: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Mean distance of the joints relative to the pelvis of each message with a body, and which of
    N people, whose joints are (N, T, 15, 3), has the nearest pelvis.
    """
    errors, nearest = [], []
    for _, message in messages:
        if message["body"] is None:
            continue
        frame = round(message["time_s"] * fps) % shown
        true = people_m[:, min(frame, shown - frame)]
        joints = message["body"]["joints"]
        found = np.array([joints[name]["position_m"] for name in LANDMARK_NAMES])
        nearest.append(int(np.linalg.norm(true[:, 0] - found[0], axis=1).argmin()))
        difference = (found - found[0]) - (true[nearest[-1]] - true[nearest[-1], 0])
        errors.append(1000 * np.linalg.norm(difference, axis=1).mean())
    return np.array(errors), np.array(nearest)


def print_errors(
    messages: list[tuple[float, dict]], truth_file: Path, fps: float, shown: int
) -> None:
    """Prints the errors of each number that the messages have."""
    truth = json.loads(truth_file.read_text())
    people_m = joints_of_people(truth)
    for person in sorted({message.get("person", 1) for _, message in messages}):
        own = [one for one in messages if one[1].get("person", 1) == person]
        error, nearest = errors_mm(own, people_m, fps, shown)
        lost = f"lost {1 - len(error) / max(len(own), 1):.2f}"
        changed = int((np.diff(nearest) != 0).sum())
        of_all = f"; is {1 + nearest[0]}, {changed} changes" if len(nearest) else ""
        print(
            f"person {person}: root_mm: mean {error.mean():.1f}, median {np.median(error):.1f};"
            f" {lost}{of_all}"
            if len(error)
            else f"person {person}: {lost}"
        )


def family() -> list[int]:
    """This process and those it has begun, in the order of begin; Linux only."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):  # it has ended in the meantime
            stat = (folder / "stat").read_text()
            parents[int(folder.name)] = int(stat.rsplit(")")[-1].split()[1])
    found = [os.getpid()]
    for process in found:
        found += sorted(child for child, parent in parents.items() if parent == process)
    return found


def processor_s() -> float:
    """Processor time so far of this process and of those it has begun, s."""
    ticks = 0
    for process in family():
        stat = Path(f"/proc/{process}/stat").read_text().rsplit(")")[-1].split()
        ticks += int(stat[11]) + int(stat[12])
    return ticks / os.sysconf("SC_CLK_TCK")


def measure(
    live: LiveInput, settings: Settings, shown: int, seconds: float, people: int, none: bool
) -> None:
    """Runs one session, and prints what it took."""
    receiver = Receiver()
    with session_of(live, settings, receiver, people, none) as session:
        began_s = time.monotonic()
        while session.times.frames == 0 or session.state.phase != "following":
            if session.wait(0.02) or time.monotonic() - began_s > 120:
                raise SystemExit("nobody was found")
        found_s = time.monotonic() - began_s
        session.wait(3.0)
        session.times.reset()
        dropped, first, begun_s = session.state.dropped, len(receiver.messages), processor_s()
        session.wait(seconds)
        worked_s = processor_s() - begun_s
        state, spent = session.state, session.times.summary()
        received = receiver.messages[first:]
    receiver.close()
    cameras = len(live.recording.rig)
    print(
        f"\n{cameras} camera{'s' if cameras > 1 else ''} at {live.fps:g} a second: {state.frames}"
        f" frames in {seconds:g} s, {state.dropped - dropped} dropped;"
        f" {1000 * worked_s / max(state.frames, 1):.0f} ms of processor time each; first pose after"
        f" {found_s:.1f} s\n\n| ms | min | max | mean | median | 95 % | 99 % |\n|" + "---|" * 7
    )
    for stage in _STAGES:
        print(f"| {stage} | " + " | ".join(f"{1000 * value:.1f}" for value in spent[stage]) + " |")
    late = 1000 * np.array([t - message["captured_unix_s"] for t, message in received])
    values = late.min(), late.max(), late.mean(), *np.quantile(late, (0.5, 0.95, 0.99))
    print("| picture to received message | " + " | ".join(f"{v:.1f}" for v in values) + " |")
    truth_file = live.recording.folder / "truth.json"
    if truth_file.exists():
        print_errors(received, truth_file, live.fps, shown)


def main() -> None:
    """Measures a recording at several rates."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("recording", type=Path)
    words.add_argument("--camera")
    words.add_argument("--people", type=int, default=1)
    words.add_argument("--library", default="")
    words.add_argument("--stature", type=float)
    words.add_argument("--fps", type=float, nargs="+", default=[15.0, 30.0])
    words.add_argument("--seconds", type=float, default=20.0)
    words.add_argument("--none", action="store_true")
    given = words.parse_args()
    live = open_input(given.recording, [], None if given.camera is None else [given.camera])
    options: dict[str, bool | int | float | str] = {"start": "any"}
    if given.library:
        options["library"] = given.library
    settings = Settings(
        stature_m=given.stature or live.recording.subject.stature_m,
        smooth=False,
        options=options if len(live.recording.rig) == 1 else {},
    )
    with tempfile.TemporaryDirectory() as folder:
        played, shown = forth_and_back(live, Path(folder))
        for fps in given.fps:
            measure(
                replace(played, fps=fps), settings, shown, given.seconds, given.people, given.none
            )


if __name__ == "__main__":
    main()
