"""Where files belong in recording folders, by their paths in the folders that somebody chose."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Literal, NamedTuple

from calib.errors import InputError
from voxelpose.recording.camera_files import (
    CALIBRATION_SUFFIXES,
    SUBFOLDERS,
    looks_like_calibration,
)
from voxelpose.recording.chapters import chapters_among
from voxelpose.recording.frame_reader import STILLS, VIDEOS
from voxelpose.results import SUMMARY
from voxelpose.studio.projects import SINGLE_FILES, check_plain_name

_Files = Literal["calibration", "subject.toml", "timestamps.csv"]
Chosen = Literal["", "video", "background", "masks", "boards", "board_walk", _Files]
"""A place for which somebody chooses files; "": each goes where its name belongs."""
LOOSE = {
    "video": VIDEOS,
    "background": VIDEOS | STILLS,
    "masks": VIDEOS,
    "boards": VIDEOS,
    "board_walk": VIDEOS | STILLS,
    "regions": STILLS,
    "unknown": STILLS,
}
"""Files that are each a camera's, by the place of cameras' pictures. All but videos of the take lie
in a folder of that name; pictures of a camera, or chapters of its film, in a folder of its name."""
_CALIBRATION = "calibration"
_IN_FOLDER = {"intri.yml", "extri.yml", "cameras.txt", "images.txt"}  # EasyMocap's, COLMAP's
_CAMERAS = "video", "masks"  # places of which a take has one at least


class Slot(NamedTuple):
    """What a recording has once: a camera's pictures in a place, or another file."""

    place: str
    camera: str = ""


def slot_of(path: str) -> Slot:
    """What a file is by its path in a recording folder. InputError where nothing can lie there."""
    *folders, name = path.split("/")
    for part in (*folders, name):
        check_plain_name(part)
    suffix = Path(name).suffix.lower()
    if not folders and name in SINGLE_FILES:
        return Slot(name)
    ending = name.removeprefix(_CALIBRATION) if not folders else suffix
    if folders in ([], [_CALIBRATION]) and ending in CALIBRATION_SUFFIXES:
        return Slot(_CALIBRATION)
    place = folders.pop(0) if folders and folders[0] in LOOSE.keys() - {"video"} else "video"
    camera = folders[0] if folders else Path(name).stem
    kinds = VIDEOS | STILLS if folders else LOOSE[place]
    if len(folders) > 1 or suffix not in kinds:
        raise _unfit(name, kinds)
    if camera.casefold() in SUBFOLDERS:
        raise InputError(f"no camera can be called {camera}: rename it")
    return Slot(place, camera)


def _unfit(name: str, kinds: Iterable[str]) -> InputError:
    return InputError(f"{name} is none of {', '.join(sorted(kinds))}: convert it first")


def holder_of(path: str, slot: Slot) -> str:
    """What holds a slot when a file is there: the file, or the folder that it shares."""
    folder = PurePosixPath(path).parent
    return str(folder) if folder.name in (slot.camera or None, _CALIBRATION) else path


@dataclass
class Take:
    """Files of one recording."""

    name: str  # of its folder; "" where it has none
    files: dict[str, int] = field(default_factory=dict)  # by where they belong: their numbers
    holders: dict[Slot, str] = field(default_factory=dict)

    def add(self, target: str, number: int) -> None:
        """Adds a file. InputError where another has its place."""
        slot = slot_of(target)
        holder = holder_of(target, slot)
        if target in self.files or self.holders.setdefault(slot, holder) != holder:
            raise InputError(f"another file is {self.holders[slot]} already: add it by itself")
        self.files[target] = number


def takes_among(
    paths: Sequence[str], chosen: Chosen = "", camera: str = ""
) -> tuple[list[Take], list[str]]:
    """Takes among files of these paths, and lines on those that belong nowhere.

    A folder in which cameras' files lie is a take; what lies above several takes is of each.

    Args:
        chosen: the place for which they were chosen; it counts in folders that have no folders of
            a recording.
        camera: whose pictures those without a folder are.
    """
    lines: list[str] = []
    located = [*_located(paths, lines)]
    whole = {root for root, inside, _ in located if inside[0] in SUBFOLDERS}
    targets = defaultdict(list)  # numbers of files, and where they belong, by the folder of a take
    for root, inside, number in located:
        try:
            target = _target(inside, "" if root in whole else chosen, camera)
            targets[root].append((slot_of(target).place in _CAMERAS, target, number))
        except InputError as error:
            lines.append(f"{paths[number]}: {error}")
    roots = [root for root, files in targets.items() if any(of_take for of_take, *_ in files)]
    if len(roots) < 2:
        roots = [min(targets, key=len, default=())]
    names = ["".join(root[-1:]) for root in roots]
    takes = {
        root: Take(name if names.count(name) == 1 else "_".join(root))
        for root, name in zip(roots, names, strict=True)
    }
    for root in sorted(targets, key=lambda root: root not in takes):
        below = [takes[each] for each in roots if len(roots) == 1 or each[: len(root)] == root]
        for _, target, number in targets[root]:
            try:
                if not below:
                    raise InputError("it lies beside several recordings: add it to one of them")
                for take in below:
                    take.add(target, number)
            except InputError as error:
                lines.append(f"{paths[number]}: {error}")
    for take in takes.values():
        take.files = dict(sorted(take.files.items()))
    return [take for take in takes.values() if take.files], lines


def _located(
    paths: Sequence[str], lines: list[str]
) -> Iterator[tuple[tuple[str, ...], tuple[str, ...], int]]:
    """Files as the folder that seems to be their recording's, and the path in it, with no folders
    but those of recordings; what is called calibration before what may be one.
    """
    beside = defaultdict(list)
    for path in paths:
        beside[path.rpartition("/")[0]].append(Path(path.rpartition("/")[2]))
    results = tuple(f"{folder}/" for folder, names in beside.items() if Path(SUMMARY) in names)
    for number in sorted(
        range(len(paths)), key=lambda each: Path(paths[each]).stem != _CALIBRATION
    ):
        folder, _, name = paths[number].rpartition("/")
        folders = tuple(folder.split("/")) if folder else ()
        if f"{folder}/".startswith(results):
            lines.append(f"{paths[number]}: it is of a result, not of a recording")
            continue
        special = [index for index, each in enumerate(folders) if each.casefold() in SUBFOLDERS]
        start = special[0] if special else 0
        place = [each.casefold() for each in folders[start : start + 1] if special]
        deeper = folders[start + len(place) :]
        root, above = (folders[:start],) * 2 if place else (folders, folders[:-1])
        suffix, files = Path(name).suffix.lower(), beside[folder]
        if deeper and place != [_CALIBRATION]:
            single = suffix in VIDEOS and sum(file.suffix.lower() in VIDEOS for file in files) == 1
            chapters = suffix in VIDEOS and len(folders) > 1 and chapters_among(files)
            if suffix in STILLS or chapters:
                place, root = [*place, deeper[-1]], above
            elif single and "cam" in deeper[-1].casefold():
                name, root = f"{deeper[-1]}{suffix}", above
        yield root, (*place, name), number


def _target(inside: tuple[str, ...], chosen: Chosen, camera: str) -> str:
    """Where a file belongs in a recording folder. InputError where it belongs nowhere."""
    *folders, name = inside
    suffix = Path(name).suffix.lower()
    if folders and folders[0] in SUBFOLDERS:
        return "/".join(inside)
    if camera and suffix in STILLS and not folders:
        folders = [camera]
    if chosen in LOOSE and chosen != "video":
        return "/".join((chosen, *folders, name))
    if chosen in (*SINGLE_FILES, _CALIBRATION):
        kinds = CALIBRATION_SUFFIXES if chosen == _CALIBRATION else (Path(chosen).suffix,)
        if suffix not in kinds:
            raise _unfit(name, kinds)
        if chosen != _CALIBRATION:
            return chosen
    if name in _IN_FOLDER:
        return f"{_CALIBRATION}/{name}"
    if chosen == _CALIBRATION or looks_like_calibration(name):
        return f"{_CALIBRATION}{suffix}"
    return "/".join((*folders, name))
