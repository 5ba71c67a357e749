"""One camera as fast as it goes, picture to pose, nothing later known: `python -m benchmarks.causal
RECORDING [--frames 300] [--fps 30]`, with the proposal that comes with the program.

The pictures of the recording's first camera are held in memory and shown forth and back, first as
fast as they are taken, then at the rate of a camera. Printed are frames per second, and the time
from a picture to its pose. As a case of `make bench` the same is done with pictures that are
painted here, against the paper's search of one frame, its nodes as images, compiled, in one run.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.cases import Case, Timed, case
from benchmarks.filter import against_dense, clip
from calib.camera import Camera, Rig
from silhouette_core.estimator import Settings
from silhouette_core.monocular.monocular_estimator import MonocularEstimator
from silhouette_core.progress import SilentReporter
from voxelpose.recording.folder import Recording

_WARM = 60  # frames before any counts: kernels are loaded, colours and distance found
_COUNTED = 120
_SECOND = 30  # frames


@dataclass
class Pictures:
    """Pictures in memory as a source of frames, shown forth and back.

    Attributes:
        camera: that took them.
        pictures: each (H, W, 3) uint8, BGR.
        empty: pictures without a person; none: the empty view is not known.
        frame_count: number of frames shown.
        paced: whether each is shown when its time has come, or as soon as it is asked for.
        fps: frames per second.
        shown_s: when each was shown.
    """

    camera: Camera
    pictures: Sequence[NDArray[np.uint8]]
    empty: Sequence[NDArray[np.uint8]]
    frame_count: int
    paced: bool = False
    fps: float = 30.0
    silhouettes_given: bool = False
    shown_s: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rig = Rig((self.camera,))

    def backgrounds(self) -> dict[str, Sequence[NDArray[np.uint8]]]:
        return {self.camera.name: self.empty} if self.empty else {}

    def regions(self) -> dict[str, NDArray[np.bool_]]:
        return {}

    def unknown(self) -> dict[str, NDArray[np.bool_]]:
        return {}

    def at(self, steps: Sequence[int]) -> Iterator[dict[str, NDArray[np.uint8]]]:
        turn = 2 * len(self.pictures) - 2
        for step in steps:
            place = step % turn
            place = place if place < len(self.pictures) else turn - place
            yield {self.camera.name: self.pictures[place]}

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, NDArray[np.uint8]]]]:
        started = 0.0
        for number, frames in enumerate(self.at(range(self.frame_count))):
            if number == _WARM:
                started = time.perf_counter()
            if self.paced and number >= _WARM:
                time.sleep(max(started + (number - _WARM) / self.fps - time.perf_counter(), 0))
            self.shown_s.append(time.perf_counter())
            yield number, number / self.fps, frames


class PoseTimes(SilentReporter):
    """Notes when each frame has its pose."""

    def __init__(self) -> None:
        self.done_s: list[float] = []

    def advance(self, steps: int = 1) -> None:
        self.done_s.append(time.perf_counter())


def times(source: Pictures, stature_m: float) -> tuple[NDArray, NDArray]:
    """Tracks; returns intervals between poses and times from picture to pose, ms."""
    reporter = PoseTimes()
    settings = Settings(stature_m=stature_m, smooth=False, options={"start": "any"})
    MonocularEstimator().estimate(source, settings, reporter)
    done, shown = (np.array(each) for each in (reporter.done_s, source.shown_s))
    return 1000 * np.diff(done[_WARM:]), 1000 * (done - shown)[_WARM:]


def quickest(between_ms: NDArray[np.floating]) -> float:
    """Least mean interval of so many frames in a row, ms: what a quiet machine would take."""
    return float(np.convolve(between_ms, np.full(_SECOND, 1 / _SECOND), "valid").min())


@cache
def painted() -> tuple[Camera, list[NDArray[np.uint8]], list[NDArray[np.uint8]]]:
    """A camera, pictures of somebody who walks before a wall, and some of the wall alone."""
    camera, masks = clip()
    random = np.random.default_rng(0)
    wall = random.integers(90, 190, (*masks[0].shape, 1)).astype(float) + np.array([0, 8, 20])
    noise = lambda: random.normal(0, 3, wall.shape)  # noqa: E731

    def taken(picture: NDArray[np.floating]) -> NDArray[np.uint8]:
        return np.clip(picture + noise(), 0, 255).astype(np.uint8)

    person = np.array([60.0, 40.0, 150.0])
    shown = [taken(np.where(mask[..., None], person, wall)) for mask in masks]
    return camera, shown, [taken(wall) for _ in range(20)]


@dataclass(frozen=True)
class Stream(Timed):
    """The interval between the poses of a stream of pictures, in its quickest second."""

    def seconds(self) -> float:
        camera, pictures, empty = painted()
        source = Pictures(camera, pictures, empty, _WARM + _COUNTED)
        return quickest(times(source, 1.75)[0]) / 1000


@case("track causally, picture to pose")
def causal() -> Case:
    dense = against_dense()
    return Case(
        Stream(lambda _: None),
        Timed(lambda _: dense.reference.run(None), repeats=3),
        "a frame of the paper's tree alone, its nodes as images, compiled",
        rounds=1,
        goal="33 ms",
    )


def main() -> None:
    """Measures a recording."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("recording", type=Path)
    words.add_argument("--frames", type=int, default=300)
    words.add_argument("--fps", type=float, default=30.0)
    words.add_argument("--stature", type=float, default=1.75)
    given = words.parse_args()
    recording = Recording.open(given.recording)
    camera = recording.rig.cameras[0]
    pictures = [frames[camera.name].copy() for _, _, frames in recording]
    empty = [frame.copy() for frame in recording.backgrounds().get(camera.name, ())]
    for paced in (False, True):
        source = Pictures(camera, pictures, empty, _WARM + given.frames, paced, given.fps)
        between, latency = times(source, given.stature)
        how = f"shown at {given.fps:g} a second" if paced else "as fast as they are taken"
        print(
            f"{how}: {1000 / between.mean():.1f} frames a second, {1000 / quickest(between):.1f} in"
            f" the quickest {_SECOND} frames; between poses {np.median(between):.1f} ms (95 %:"
            f" {np.quantile(between, 0.95):.1f})"
        )
        if paced:
            print(
                f"picture to pose {np.median(latency):.0f} ms"
                f" (95 %: {np.quantile(latency, 0.95):.0f}, at the end {latency[-30:].mean():.0f})"
            )


if __name__ == "__main__":
    main()
