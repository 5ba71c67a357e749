"""Files of a recording's cameras, and words on those that are not read, or have other names."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

from calib.errors import InputError
from calib.storage.documents import visible_entries
from voxelpose.recording.chapters import chapters_in
from voxelpose.recording.frame_reader import STILLS, VIDEOS

CALIBRATION_SUFFIXES = tuple(".toml .yml .yaml .json .xml .txt .qca.txt .xcp .mat".split())
"""Of a recording's `calibration`; what it is is told by the content."""
REPLACED = "before_repair"
"""Folder of a recording that keeps what a repair has replaced."""
SUBFOLDERS = frozenset(
    {"background", "masks", "regions", "unknown", "boards", "board_walk", REPLACED}
    | {"calibration", "intrinsics", "extrinsics"}
)
"""Folders of a recording that are no camera's."""
_RESULT = "summary.json"  # a folder that has it is a result
_UNREAD = frozenset(
    ".h264 .264 .avc .h265 .265 .hevc .mjpeg .mjpg .yuv .raw .av1 .obu"
    " .mxf .flv .vob .asf .mod .tod .r3d .braw .insv .360 .lrv .dav .m2v .f4v .rmvb .gif".split()
)
_UNREAD_STILLS = frozenset(
    ".heic .heif .avif .jxl .jp2 .gif .dng .nef .cr2 .cr3 .arw .orf .raf .rw2".split()
)
_OURS = frozenset({"subject.toml", "recording.toml", "voxelpose.toml", "calibration_places.json"})
_TELLING = re.compile("cam|calib|intri|extri", re.IGNORECASE)
_MOST = 3  # names in a message


def pictures_by_camera(folder: Path, stills: bool = False) -> dict[str, Path]:
    """Returns the videos and folders of images, or of chapters, in a folder, by camera name.
    InputError where two files belong to one camera.

    The camera name is the stem of the file or the name of the folder.

    Args:
        folder: the folder; one that does not exist is empty.
        stills: whether single images count too.
    """
    paths: dict[str, Path] = {}
    for path in visible_entries(folder):
        suffix = path.suffix.lower()
        if path.name in SUBFOLDERS:
            continue
        if path.is_dir():
            if not is_image_folder(path) and not chapters_in(path):
                continue
            name = path.name
        elif suffix in VIDEOS or (stills and suffix in STILLS):
            name = path.stem
        else:
            continue
        if name in paths:
            raise InputError(
                f"{folder} has both {paths[name].name} and {path.name} for camera {name}:"
                " remove one"
            )
        paths[name] = path
    return paths


def is_image_folder(folder: Path) -> bool:
    """Whether a folder holds images of a camera, and is no result of ours."""
    files = visible_entries(folder)
    if any(file.name == _RESULT for file in files):
        return False
    return any(file.suffix.lower() in STILLS for file in files)


def not_read(folder: Path, frame: str = "; {}") -> str:
    """Words on what lies in a recording folder and is not read, each with its remedy, put into a
    frame; "" where there is no such thing.
    """
    unread = []
    for path in visible_entries(folder):
        suffix = path.suffix.lower()
        if path.is_dir() and path.name not in SUBFOLDERS:
            if inside := [*map(str, pictures_by_camera(path))]:
                joined = f", or join the parts of one film to {path.name}.mp4"
                remedy = f"move that up here{joined if len(inside) > 1 else ''}"
                unread.append(f"{path.name}/ holds {_first_ones(inside)}: {remedy}")
            elif path.name != "calibration" and not visible_entries(path):
                unread.append(f"{path.name}/ is empty")
            elif not is_image_folder(path):
                unread.append(f"{path.name}/ holds no images{unread_stills(path)}")
        elif suffix in _UNREAD:
            unread.append(
                f"{path.name} is no video that is read: ffmpeg -i {path.name} {path.stem}.mp4"
            )
    words = [*unread[:_MOST], *_calibrations(folder)[:1]]
    return frame.format("; ".join(words)) if words else ""


def unread_stills(folder: Path) -> str:
    """Words on images in a folder of a kind that is not read, with the remedy; "" without any."""
    stills = (path for path in visible_entries(folder) if path.suffix.lower() in _UNREAD_STILLS)
    first = next(stills, None)
    return "" if first is None else f" that are read ({first.name}: save it as JPEG or PNG)"


def _calibrations(folder: Path) -> list[str]:
    """Words on files that look like calibrations but for their names."""
    return [
        f"{path.name} is not read by this name: if it is the calibration, name it"
        f" calibration{path.suffix.lower()}"
        for path in visible_entries(folder)
        if path.stem != "calibration" and looks_like_calibration(path.name)
    ]


def looks_like_calibration(name: str) -> bool:
    """Whether a file may be the calibration by its name."""
    known = Path(name).suffix.lower() in CALIBRATION_SUFFIXES and name not in _OURS
    return known and _TELLING.search(name) is not None


def renaming(paths: Mapping[str, Path], names: Sequence[str]) -> str:
    """Words that propose names for files of cameras as they are calibrated; "" where none fit.

    Args:
        paths: videos or folders by a name that is not calibrated.
        names: calibrated cameras without a video.
    """
    for alike in (str.casefold, _letters, _number):
        calibrated = _by_key(names, alike)
        filmed = _by_key(paths, alike)
        pairs = {filmed[key]: calibrated[key] for key in filmed.keys() & calibrated.keys() - {""}}
        if pairs:
            break
    else:
        pairs = {
            name: inside[0]
            for name in paths
            if len(inside := [one for one in names if one.casefold() in name.casefold()]) == 1
        }
    words = [
        f"{paths[old].name} to {new}{'' if paths[old].is_dir() else paths[old].suffix}"
        for old, new in sorted(pairs.items())
    ]
    return f"rename {_first_ones(words)}" if words else ""


def _by_key(names: Iterable[str], key: Callable[[str], str]) -> dict[str, str]:
    """Names by what a function makes of them, of those that it tells apart."""
    keys = [key(name) for name in names]
    return {one: name for one, name in zip(keys, names, strict=True) if keys.count(one) == 1}


def _letters(name: str) -> str:
    return re.sub(r"[\W_]|(?<!\d)0+(?=\d)", "", name.casefold())


def _number(name: str) -> str:
    """The last number of a name, without noughts before it."""
    numbers = re.findall(r"\d+", name)
    return str(int(numbers[-1])) if numbers else ""


def _first_ones(words: Sequence[str]) -> str:
    return ", ".join(words[:_MOST]) + (" and so on" if len(words) > _MOST else "")
