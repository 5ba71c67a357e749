"""Silhouettes of real footage against outlines checked by hand.

    python -m benchmarks.footage [FOLDER ...] [--background both|given|none] [--network auto|off]
        [--sheets DIR]

Left out: the shared recordings (../shared/data, or $VOXELPOSE_SHARED/data) of which
datasets/footage has outlines. Any folder that `fit` or `track` opens will do; without outlines ten
frames spread over it are looked at. One line per camera: intersection over union of the silhouettes
with all checked people, median and least; what is missing of the people and what is found beside
them, relative to their area (medians); where one camera filmed, intersection over union of the
person whom `track` takes with the nearest checked person; the time that the background took; and
that of a frame's silhouette. A sheet of pictures per recording goes to DIR, or out/footage:
silhouettes tinted, with yellow outlines; checked outlines magenta, unknown places grey.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import get_args

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.checked_masks import FOOTAGE, CheckedFrame, read_checked
from benchmarks.contact_sheet import Tile, write_sheet
from benchmarks.overlap import overlap
from calib.camera import Camera
from calib.errors import InputError
from calib.moments import even_moments
from silhouette_core.estimator import Frame, Settings
from silhouette_core.image.seen_people import people_seen
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.jit import set_threads
from silhouette_core.monocular.person_finder import LONG_SIDE_PX, PersonFinder
from silhouette_core.network_files import NetworkUse
from silhouette_core.progress import SilentReporter
from voxelpose.recording.camera_files import pictures_by_camera
from voxelpose.recording.folder import Recording, calibration_path
from voxelpose.recording.frame_reader import VIDEOS

ROOT = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("VOXELPOSE_SHARED", ROOT.parent / "shared"))
_FRAMES = 10
_EMPTY_VIEW = "_background"
HEADER = (
    f"{'recording':<14}{'camera':<8}{'background':<11}{'frames':>6}{'IoU':>7}{'least':>7}"
    f"{'missing':>9}{'beside':>8}{'person':>8}{'least':>7}{'background s':>14}{'ms/frame':>10}"
)


class WithoutBackground(Recording):
    """A recording whose pictures of the empty view are left aside."""

    def backgrounds(self) -> dict:
        """None."""
        return {}


@dataclass(eq=False)
class Measured:
    """What was found for one camera.

    Attributes:
        background_s: time that the background took, of all cameras of the recording.
        ms: time per frame.
        overlaps: intersection over union with all checked people, per checked frame.
        missing: what is not found of them, relative to their area, per checked frame.
        beside: what is found beside them, likewise.
        of_person: the same of the person whom `track` takes.
        tiles: pictures.
    """

    background_s: float
    ms: list[float] = field(default_factory=list)
    overlaps: list[float] = field(default_factory=list)
    missing: list[float] = field(default_factory=list)
    beside: list[float] = field(default_factory=list)
    of_person: list[float] = field(default_factory=list)
    tiles: list[Tile] = field(default_factory=list)

    def line(self, recording: str, camera: str, background: str) -> str:
        """One line of the table."""
        return (
            f"{recording:<14}{camera:<8}{background:<11}{len(self.ms):>6}"
            f"{_median(self.overlaps):>7}{_least(self.overlaps):>7}"
            f"{_median(self.missing):>9}{_median(self.beside):>8}"
            f"{_median(self.of_person):>8}{_least(self.of_person):>7}"
            f"{self.background_s:>14.1f}{np.median(self.ms):>10.1f}"
        )

    def add(self, found: NDArray[np.bool_], people: NDArray[np.bool_]) -> None:
        """Compares a silhouette with the checked people."""
        area = people.sum()
        self.overlaps.append(overlap(found, people))
        self.missing.append(float((people & ~found).sum() / area))
        self.beside.append(float((found & ~people).sum() / area))


def _median(values: Sequence[float]) -> str:
    return f"{np.median(values):.3f}" if values else "-"


def _least(values: Sequence[float]) -> str:
    return f"{min(values):.3f}" if values else "-"


def usual_layout(folder: Path, scratch: Path) -> Path:
    """The folder itself; or, where it holds videos NAME_background beside NAME_…, one of links in
    which these are the backgrounds.
    """
    videos = [path for path in sorted(folder.iterdir()) if path.suffix.lower() in VIDEOS]
    names = [path.stem[: -len(_EMPTY_VIEW)] for path in videos if path.stem.endswith(_EMPTY_VIEW)]
    if not names:
        return folder
    links = scratch / folder.name
    (links / "background").mkdir(parents=True)
    for path in (path.resolve() for path in videos):
        name = next(name for name in names if path.stem.startswith(name))
        place = links / "background" if path.stem.endswith(_EMPTY_VIEW) else links
        (place / f"{name}{path.suffix}").symlink_to(path)
    calibration = calibration_path(folder)
    if calibration is not None:
        (links / calibration.name).symlink_to(calibration.resolve())
    return links


def opened(folder: Path) -> list[Recording]:
    """The recording; or, without calibration, one for each of its cameras."""
    if calibration_path(folder) is not None:
        return [Recording.open(folder)]
    return [
        Recording.open(folder, cameras=(name,), frames=(0, _readable(path)))
        for name, path in pictures_by_camera(folder).items()
    ]


def _readable(path: Path) -> int | None:
    """Number of frames of a video that can be read, where it announces more; None: as announced."""
    video = cv2.VideoCapture(str(path)) if path.is_file() else None
    if video is None:
        return None
    announced, count = int(video.get(cv2.CAP_PROP_FRAME_COUNT)), 0
    while video.grab():
        count += 1
    return count if count < announced else None


def variants(recording: Recording, background: str) -> Iterator[tuple[str, Recording]]:
    """The recording with and without its background, as far as it has and one asks for."""
    has = bool(recording.backgrounds())
    if has and background != "none":
        yield "given", recording
    if not has or background != "given":
        values = {each.name: getattr(recording, each.name) for each in fields(recording)}
        yield "none", WithoutBackground(**values)


def measure(
    recording: Recording,
    checked: Mapping[str, Mapping[int, CheckedFrame]],
    network: NetworkUse = "auto",
) -> dict[str, Measured]:
    """Silhouettes of the checked frames, or of some, by camera name."""
    started = time.perf_counter()
    people = people_seen(recording, Settings(network=network), SilentReporter())
    silhouettes = Silhouettes(recording, "auto", LONG_SIDE_PX, people=people)
    taken_s = time.perf_counter() - started
    spread = even_moments(recording.frame_count, _FRAMES, margin=0).tolist()
    numbers = {name: list(checked.get(name, spread)) for name in recording.rig.names}
    measured = {name: Measured(taken_s) for name in numbers}
    steps = sorted(set().union(*numbers.values()))
    for step, frames in zip(steps, recording.at(steps), strict=True):
        for camera in recording.rig:
            if step in numbers[camera.name]:
                entry = checked.get(camera.name, {}).get(step)
                _add(measured[camera.name], silhouettes, camera, step, frames, entry)
    if len(recording.rig) == 1:
        _follow(recording, silhouettes, checked, measured[recording.rig.names[0]])
    return measured


def _add(
    measured: Measured,
    silhouettes: Silhouettes,
    camera: Camera,
    number: int,
    frames: Mapping[str, Frame],
    entry: CheckedFrame | None,
) -> None:
    """Adds what is found in one frame of a camera."""
    frame = frames[camera.name]
    started = time.perf_counter()
    found = silhouettes.of({camera.name: frame}, step=number)[camera.name]
    measured.ms.append(1e3 * (time.perf_counter() - started))
    picture, people, unknown, words = silhouettes.scaled(camera.name, frame), None, None, ""
    if entry is not None:
        sizes = camera.size, found.shape[::-1]
        people = np.any(entry.masks_of_people(*sizes), axis=0)
        unknown = entry.unknown_mask(*sizes)
        measured.add(found & ~unknown, people & ~unknown)
        words = f" {measured.overlaps[-1]:.2f}"
    measured.tiles.append(Tile(picture, found, people, unknown, f"{number}{words}"))


def _follow(
    recording: Recording,
    silhouettes: Silhouettes,
    checked: Mapping[str, Mapping[int, CheckedFrame]],
    measured: Measured,
) -> None:
    """Adds the person whom `track` takes, who is followed from the first frame on."""
    camera = recording.rig.cameras[0]
    entries = checked.get(camera.name, {})
    finder = PersonFinder(camera, False)
    lens = UndistortedView.from_camera(camera, LONG_SIDE_PX)
    for step, (number, _, frames) in enumerate(recording):
        if number > max(entries, default=-1):
            return
        found = silhouettes.of(frames, step=step)[camera.name]
        person = finder.find(frames[camera.name], found)
        if number in entries:
            mask = np.zeros_like(found) if person is None else person.mask
            measured.of_person.append(_nearest(mask, entries[number], camera, lens))


def _nearest(
    found: NDArray[np.bool_], entry: CheckedFrame, camera: Camera, lens: UndistortedView
) -> float:
    """Intersection over union with the checked person with whom it is greatest."""
    sizes = camera.size, found.shape[::-1]
    known = ~lens.undistort(entry.unknown_mask(*sizes))
    people = [lens.undistort(mask) for mask in entry.masks_of_people(*sizes)]
    return max(overlap(found & known, person & known) for person in people)


def run(folder: Path, background: str, sheets: Path, network: NetworkUse = "auto") -> None:
    """Prints the lines of a recording, and writes its sheet."""
    checked, rows = read_checked(FOOTAGE / f"{folder.name}.json"), []
    with tempfile.TemporaryDirectory() as scratch:
        for recording in opened(usual_layout(folder, Path(scratch))):
            for kind, variant in variants(recording, background):
                for camera, measured in measure(variant, checked, network).items():
                    print(measured.line(folder.name, camera, kind), flush=True)
                    rows.append(measured.tiles)
    write_sheet(rows, sheets / f"{folder.name}.png")


def shared_folders() -> list[Path]:
    """Shared recordings of which there are checked outlines."""
    folders = [SHARED / "data" / path.stem for path in sorted(FOOTAGE.glob("*.json"))]
    return [folder for folder in folders if folder.is_dir()]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures recordings."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="*", type=Path, metavar="FOLDER")
    parser.add_argument("--background", choices=("both", "given", "none"), default="both")
    parser.add_argument("--network", choices=get_args(NetworkUse), default="auto")
    parser.add_argument("--sheets", type=Path, default=ROOT / "out" / "footage", metavar="DIR")
    given = parser.parse_args(arguments)
    folders = [folder.absolute() for folder in given.folders] or shared_folders()
    if not folders:
        print(f"skipped: no footage in {SHARED / 'data'}; give a FOLDER", file=sys.stderr)
        return 0
    print(f"{set_threads()} threads, OpenCV {cv2.getNumThreads()}\n{HEADER}", flush=True)
    failed = 0
    for folder in folders:
        try:
            run(folder, given.background, given.sheets, given.network)
        except InputError as error:
            failed = 1
            print(f"{folder.name}: {error}", file=sys.stderr)
    return failed


if __name__ == "__main__":
    sys.exit(main())
