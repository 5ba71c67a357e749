"""What the pose network sees of the people in a recording, camera by camera and frame by frame."""

import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Protocol

import numba
import numpy as np

from calib.checks import BoolArray, Float32Array
from calib.storage.temporary import ScratchFile
from silhouette_core.estimator import Frame, FrameSource, Settings
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.image.person_windows import PeopleWindows
from silhouette_core.image.pose_network import FILE, Crop, PersonSeen, PoseNetwork
from silhouette_core.network_files import NetworkUse, installed_network
from silhouette_core.progress import Reporter

_SHAPES = (4,), (1,), (33, 2), (33,), (2, 2)  # of what is stored of a person, float32


class People(Protocol):
    """People in frames of some cameras."""

    def look(self, step: int, frames: Mapping[str, Frame]) -> None:
        """Looks at the frames of a time step, (H, W, 3) uint8, BGR, by camera name."""

    def of(self, name: str, step: int) -> Mapping[int, PersonSeen]:
        """People in a frame of a camera, by number; nobody where it was not looked at."""
        ...


class SeenPeople:
    """People seen in T frames of C cameras; what is seen lies on disk.

    Attributes:
        windows: by camera name, what follows people there.
    """

    def __init__(self, names: Sequence[str], network: Path) -> None:
        """Begins to look.

        Args:
            names: of the cameras.
            network: the network's file.
        """
        self.windows = {name: PeopleWindows(PoseNetwork(network)) for name in names}
        self._file = ScratchFile()
        self._places: dict[tuple[str, int, int], tuple[int, int]] = {}
        self._numbers: dict[tuple[str, int], list[int]] = {}
        self._last: dict[str, int] = {}  # step at which each camera's frame was looked at last

    def look(self, step: int, frames: Mapping[str, Frame]) -> None:
        """Looks at the frames of a time step, (H, W, 3) uint8, BGR, by camera name; at each once,
        and at those of its own cameras alone.

        Most is seen where steps follow on each other.
        """

        def look(name: str) -> None:
            skipped = self._last.get(name) != step - 1
            people = self.windows[name].see(frames[name], skipped)
            self._last[name] = step
            self._numbers[name, step] = []
            for number, person in people.items():
                self.put(name, step, number, person)

        names = [name for name in self.windows if name in frames]
        names = [name for name in names if (name, step) not in self._numbers]
        with ThreadPoolExecutor(max(min(numba.get_num_threads(), len(names)), 1)) as pool:
            list(pool.map(look, names))

    def put(self, name: str, step: int, number: int, person: PersonSeen) -> None:
        """Stores what is seen of a person in a frame of a camera."""
        crop = person.crop
        arrays = (
            np.array([crop.x_px, crop.y_px, crop.side_px, crop.turn_rad]),
            np.array([person.presence]),
            *(person.points_px, person.visibility, person.circle_px),
        )
        head = b"".join(array.astype(np.float32).tobytes() for array in arrays)
        content = head + zlib.compress(person.logits.tobytes(), 1)
        self._places[name, step, number] = self._file.append(content), len(content)
        self._numbers.setdefault((name, step), []).append(number)

    def of(self, name: str, step: int) -> dict[int, PersonSeen]:
        """People in a frame of a camera, by number."""
        numbers = self._numbers.get((name, step), [])
        return {number: self._read(*self._places[name, step, number]) for number in numbers}

    def count(self, name: str, step: int) -> int:
        """Number of people in a frame of a camera."""
        return len(self._numbers.get((name, step), []))

    def _read(self, start: int, size: int) -> PersonSeen:
        content, arrays, first = self._file.read_at(start, size), [], 0
        for shape in _SHAPES:
            count = int(np.prod(shape))
            array = np.frombuffer(content, np.float32, count, first).astype(float)
            arrays.append(array.reshape(shape))
            first += 4 * count
        crop, presence, points_px, visibility, circle_px = arrays
        logits = np.frombuffer(zlib.decompress(content[first:]), np.int8).reshape(256, 256)
        place = Crop(*crop.tolist())
        return PersonSeen(place, float(presence[0]), logits, points_px, visibility, circle_px)


def people_looked_for(
    source: FrameSource, settings: Settings, reporter: Reporter
) -> SeenPeople | None:
    """People of a recording at whom nobody has looked yet; None without the network, of given
    silhouettes, and where frames do not wait for later ones, of cameras with an empty view: their
    silhouettes do without evidence then. Raises InputError where what is installed is not the
    network.

    Args:
        source: the frames.
        settings: of the estimation.
        reporter: told where a network would help.
    """
    if source.silhouettes_given or settings.background == "paper":
        return None
    backgrounds = source.backgrounds()
    missing = [name for name in source.rig.names if name not in backgrounds]
    network = network_for(missing, settings.network, reporter)
    names = source.rig.names if settings.smooth else missing
    return SeenPeople(names, network) if network is not None and names else None


def network_for(missing: Sequence[str], use: NetworkUse, reporter: Reporter) -> Path | None:
    """The network's file; None without it, which the reporter is told where it would help. Raises
    InputError where what is installed is not the network.

    Args:
        missing: cameras without an empty view.
        use: whether it is used where it is installed.
        reporter: told of it.
    """
    network = installed_network(use)
    if network is None and missing and use == "auto":
        reporter.note(
            f"{', '.join(missing)}: no empty view, and no pose network to find people more surely:"
            " `voxelpose network install` (6 MB, Apache-2.0) gets it"
        )
    return network


def people_seen(source: FrameSource, settings: Settings, reporter: Reporter) -> SeenPeople | None:
    """As `people_looked_for`; where frames wait for later ones, all are looked at, in order."""
    people = people_looked_for(source, settings, reporter)
    if people is not None and settings.smooth:
        reporter.stage("people", source.frame_count)
        for step, (_, _, frames) in enumerate(source):
            people.look(step, frames)
            reporter.advance()
    return people


def people_odds(
    people: Mapping[int, PersonSeen], scale: float, size: tuple[int, int]
) -> Float32Array:
    """Odds of a person (h, w) float32, nats, in an image: 0 where nobody is seen in the picture.

    Args:
        people: who is seen in the picture.
        scale: of the image, relative to the picture.
        size: width and height of the image.
    """
    if not people:
        return np.zeros(size[::-1], np.float32)
    (reliance,) = fitted_weights(FILE)["mask"]
    return reliance * np.max([person.odds(size, scale) for person in people.values()], axis=0)


def people_masks(
    people: Mapping[int, PersonSeen], scale: float, size: tuple[int, int]
) -> list[BoolArray]:
    """Where each of some people is seen, (h, w) bool: of several, who is likeliest in a pixel.

    Args:
        people: who is seen in the picture.
        scale: of the images, relative to the picture.
        size: width and height of the images.
    """
    if not people:
        return []
    odds = np.stack([person.odds(size, scale) for person in people.values()])
    likeliest = odds.argmax(axis=0)
    return [(person_odds > 0) & (likeliest == k) for k, person_odds in enumerate(odds)]
