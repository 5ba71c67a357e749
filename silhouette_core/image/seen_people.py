"""What the pose network sees of the people in a recording, camera by camera and frame by frame."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import numpy as np
from numpy.typing import NDArray

from silhouette_core.estimator import Frame, FrameSource, Settings
from silhouette_core.fitted_weights import fitted_weights
from silhouette_core.image.person_windows import PeopleWindows
from silhouette_core.image.pose_network import FILE, Crop, PersonSeen, PoseNetwork
from silhouette_core.network_files import installed_network
from silhouette_core.progress import Reporter
from silhouette_core.scratch_file import ScratchFile

_SHAPES = (4,), (1,), (33, 2), (33,), (2, 2)  # of what is stored of a person, float32


class SeenPeople:
    """People seen in T frames of C cameras; what is seen lies on disk."""

    def __init__(self, names: Sequence[str], network: Path) -> None:
        """Begins to look.

        Args:
            names: of the cameras.
            network: the network's file.
        """
        self._windows = {name: PeopleWindows(PoseNetwork(network)) for name in names}
        self._widths: dict[str, int] = {}
        self._file = ScratchFile()
        self._places: dict[tuple[str, int, int], tuple[int, int]] = {}
        self._numbers: dict[tuple[str, int], list[int]] = {}

    def look(self, step: int, frames: Mapping[str, Frame]) -> None:
        """Looks at the frames of a time step, (H, W, 3) uint8, BGR, by camera name; at each once.

        Most is seen where steps follow on each other.
        """

        def look(name: str) -> None:
            skipped = (name, step - 1) not in self._numbers
            people = self._windows[name].see(frames[name], skipped)
            self._widths[name] = frames[name].shape[1]
            self._numbers[name, step] = []
            for number, person in people.items():
                self.put(name, step, number, person)

        names = [name for name in frames if (name, step) not in self._numbers]
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

    def nearest(self, name: str, step: int, mask: NDArray[np.bool_]) -> PersonSeen | None:
        """Who shares most with a silhouette (h, w) bool in a frame of a camera; None: nobody."""
        best, most = None, 0
        for person in self.of(name, step).values():
            scale = mask.shape[1] / self._widths[name]
            shared = int((mask & (person.odds(mask.shape[::-1], scale) > 0)).sum())
            if shared > most:
                best, most = person, shared
        return best

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


def people_seen(source: FrameSource, settings: Settings, reporter: Reporter) -> SeenPeople | None:
    """People seen in a recording; None without the network, of given silhouettes, and where frames
    do not wait for later ones.

    Args:
        source: the frames.
        settings: of the estimation.
        reporter: told the progress, and where a network would help.

    Raises:
        InputError: what is installed is not the network.
    """
    network = installed_network(settings.network)
    if source.silhouettes_given or not settings.smooth or settings.background == "paper":
        return None
    if network is None:
        missing = set(source.rig.names) - set(source.backgrounds())
        if missing and settings.network == "auto":
            reporter.note(
                f"{', '.join(sorted(missing))}: no empty view, and no pose network to find people"
                " more surely: `voxelpose network install` (6 MB, Apache-2.0) gets it"
            )
        return None
    people = SeenPeople(source.rig.names, network)
    reporter.stage("people", source.frame_count)
    for step, (_, _, frames) in enumerate(source):
        people.look(step, frames)
        reporter.advance()
    return people


def people_odds(
    people: dict[int, PersonSeen], scale: float, size: tuple[int, int]
) -> NDArray[np.float32]:
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
