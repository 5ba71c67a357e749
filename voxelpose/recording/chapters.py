"""Films that a camera wrote in several files: chapters in a folder, joined where one continues the
other; and the film in a file whose first video track is a still picture: a cover, or a thumbnail.
"""

import atexit
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.storage.documents import visible_entries
from voxelpose.recording.ffmpeg import QUIET, finished, packets, video_address, words_on
from voxelpose.recording.frame_reader import STILLS, VIDEOS, Frame, FrameReader, size_text
from voxelpose.recording.image_names import natural_order

_GOPRO = re.compile(r"(?:GOPR|G[A-Z](\d\d))(\d{4})", re.IGNORECASE)  # chapter, film
_CAMERAS = re.compile(
    r"(C|CLIP|DJI|DSC|DSCF|IMG|MAH|MAQ|MOV|MOVI|MVI|P|PXL|REC|VID|VIDEO)?[_-]?\d{4,}.*"
    r"|.*(chapter|clip|part|pt)[ _-]?\d+",
    re.IGNORECASE,
)
_CREATED = re.compile(r"creation_time\s*: (\S+)")
_TIMECODE = re.compile(r"timecode\s*: (\d\d):(\d\d):(\d\d)([:;.])(\d\d)")
_START = re.compile(r"start: (-?[\d.]+)")
_STREAMS = (".ts", ".mts", ".m2ts")  # their times go on from one to the next
_TRACK = re.compile(r"Stream #0:(\d+).*?: Video: ")
_OFF_S = (1, 1, 2)  # by which `_begins` may be off: the last are whole seconds
_COMPARED_S = 3  # of two chapters, in which they may overlap
_ALIKE = 4  # times less than successive pictures differ those that two chapters have


@dataclass(frozen=True)
class FilmReader(FrameReader):
    """Frames of a film that lies in other files than a video of its name."""

    files: tuple[FrameReader, ...] = field(default=(), compare=False)
    """Readers of the files, in their order."""
    note: str = ""  #: what is to be told.

    @classmethod
    def of(cls, path: Path, files: Sequence[FrameReader], note: str) -> "FilmReader":
        """The film of a camera in files of one size and rate.

        Args:
            path: the camera's video or folder.
        """
        first, count = files[0], sum(file.frame_count for file in files)
        coded = replace(first.coded, may_repeat=any(file.coded.may_repeat for file in files))
        film = cls(path, (), first.size, count, first.fps, shown_s=_shown_s(files), coded=coded)
        promised = sum(file.promised for file in files)
        return replace(film, promised=promised, files=tuple(files), note=note)

    def _pictures(self, numbers: Sequence[int]) -> Iterator[Frame]:
        begin = 0
        for file in self.files:
            end = begin + file.frame_count
            inside = [number - begin for number in numbers if begin <= number < end]
            if inside:
                yield from file.select(inside)
            begin = end


def open_camera(path: Path) -> FrameReader:
    """Opens the pictures of a camera: a video, an image, a folder of images or of chapters.
    InputError where it is missing, empty or cannot be read, or the chapters are not those of a
    film.
    """
    files = chapters_in(path)
    if not files:
        reader = FrameReader.open(path)
        if reader.stills or reader.frame_count > 1 or (film := _film_track(path)) is None:
            return reader
        note = f"{path.name}: the first video track is a still picture, and a later one is used"
        return FilmReader.of(path, [FrameReader.open(film)], note)
    if len(files) > 1 and all(_GOPRO.fullmatch(file.stem) for file in files):
        files = _gopro_order(path, files)
    chapters = [FrameReader.open(file) for file in files]
    if len(chapters) > 1:
        chapters = _continued(path, chapters)
    names = ", ".join(chapter.path.name for chapter in chapters)
    joined = "are joined as the chapters of one film" if len(chapters) > 1 else "is the film"
    note = f"{path.name}: {names} {joined}"
    for k in range(1, len(chapters)):
        if count := _overlap(chapters[k - 1], chapters[k]):
            note += f"; {chapters[k].path.name} begins with the last {count} pictures before it,"
            note += " which are left out"
            chapters[k] = chapters[k].select(range(count, chapters[k].frame_count))
    return FilmReader.of(path, chapters, note)


def chapters_in(folder: Path) -> list[Path]:
    """The chapters among the files of a folder."""
    return chapters_among(visible_entries(folder))


def chapters_among(entries: Sequence[Path]) -> list[Path]:
    """The videos of a folder, if they are named as a camera names those of one film; none where
    they are not, or where there are images.
    """
    videos = [path for path in entries if path.suffix.lower() in VIDEOS]
    stems = {path.stem for path in videos}  # a camera may put a picture beside each
    stills = any(p.suffix.lower() in STILLS and p.stem not in stems for p in entries)
    named = all(_GOPRO.fullmatch(stem) or _CAMERAS.fullmatch(stem) for stem in stems)
    return sorted(videos, key=natural_order) if named and not stills else []


def chapters_apart(names: Iterable[str]) -> str:
    """Words on cameras that are chapters of one film by their names; "" where there are none."""
    films: dict[str, list[str]] = {}
    for name in names:
        if match := _GOPRO.fullmatch(name):
            films.setdefault(match[2], []).append(name)
    several = next((film for film in films.values() if len(film) > 1), None)
    if several is None:
        return ""
    return f"{', '.join(several)} are chapters of one film: put them into a folder of their camera"


def _gopro_order(folder: Path, files: Sequence[Path]) -> list[Path]:
    """Chapters of a film by the number in their names. InputError where there are several films, or
    a chapter is missing or there twice.
    """
    matches = {file: match for file in files if (match := _GOPRO.fullmatch(file.stem))}
    films = {match[2] for match in matches.values()}
    if len(films) > 1:
        raise InputError(
            f"{folder} holds chapters of the films {', '.join(sorted(films))}: leave those of one"
        )
    numbers = {file: int(match[1] or 0) for file, match in matches.items()}
    order = sorted(files, key=lambda file: numbers[file])
    first = 0 if any(match[1] is None for match in matches.values()) else 1
    for number, file in enumerate(order, first):
        if numbers[file] != number:
            what = f"lacks chapter {number}" if numbers[file] > number else "holds a chapter twice"
            raise InputError(f"{folder} {what} of its film: put all there, each once")
    return order


def _continued(folder: Path, chapters: Sequence[FrameReader]) -> list[FrameReader]:
    """Chapters in the order in which each continues the one before. InputError where they do not,
    or nothing tells it, or they were filmed in different ways.
    """
    first = chapters[0]
    for chapter in chapters:
        rates = round(chapter.fps or 0, 2), round(first.fps or 0, 2)
        if chapter.size != first.size or rates[0] != rates[1]:
            ways = ", ".join(
                f"{each.path.name} {size_text(each.size)} px at {each.fps or 0:.4g} per second"
                for each in (first, chapter)
            )
            raise InputError(f"{folder} holds films of different kinds ({ways}): leave one")
    facts = {chapter.path: _begins(chapter) for chapter in chapters}
    names = ", ".join(chapter.path.name for chapter in chapters)
    for which, most_s in enumerate(_OFF_S):
        begins = {path: fact[which] for path, fact in facts.items()}
        if None in begins.values() or len({*begins.values()}) == 1:
            continue
        order = sorted(chapters, key=lambda chapter: begins[chapter.path] or 0)
        lasting = [chapter.frame_count / (chapter.fps or 1) for chapter in order]
        passed = np.diff([begins[chapter.path] or 0 for chapter in order])
        # Some cameras state when a chapter ended.
        off_s = [np.abs(passed - lasting[:-1]).max(), np.abs(passed - lasting[1:]).max()]
        if off_s[0] <= most_s or (which == 2 and off_s[1] <= most_s):
            return order
        raise InputError(
            f"{folder} holds {names}, and by their times none continues the other: leave the one"
            " that is meant, or give each camera a folder, or a file, of its own"
        )
    if all(_GOPRO.fullmatch(chapter.path.stem) for chapter in chapters):
        return list(chapters)
    raise InputError(
        f"{folder} holds {names}, and nothing in them tells whether one continues the other: if so,"
        f" join them into {folder.name}.mp4 (ffmpeg -f concat); if not, leave one"
    )


def _overlap(before: FrameReader, after: FrameReader) -> int:
    """Number of a chapter's first pictures that are the last ones of the chapter before it; 0 also
    where hardly anything changes in them.
    """
    end, begin = _small_pictures(before, "-sseof", f"-{_COMPARED_S}"), _small_pictures(after)
    most = min(len(end), len(begin))
    off = [np.abs(end[-k:] - begin[:k]).max(axis=1).mean() for k in range(1, most + 1)]
    best = int(np.argmin(off[:-1])) if most > 1 else 0
    return best + 1 if most > 1 and off[best] * _ALIKE < off[best + 1] else 0


def _small_pictures(film: FrameReader, *words: str) -> NDArray[np.float32]:
    """Small pictures (n, pixels), grey levels, of a video's begin, or where FFmpeg's words say."""
    import imageio_ffmpeg

    small = ["-fps_mode", "passthrough", "-vf", "scale=64:36:flags=area"]
    pictures = imageio_ffmpeg.read_frames(
        video_address(film.path),
        "gray",
        input_params=[*words, "-t", f"{_COMPARED_S}"],
        output_params=small,
        bits_per_pixel=8,
    )
    next(pictures)  # what it is
    return np.array([np.frombuffer(picture, np.uint8) for picture in pictures], np.float32)


def _begins(chapter: FrameReader) -> tuple[float | None, float | None, float | None]:
    """When a file says that it began, s: by its timecode, its times of a stream, and when it was
    made; None where it does not say.
    """
    said = words_on(chapter.path)
    timecode = start = created = None
    if (match := _TIMECODE.search(said)) and chapter.fps and round(chapter.fps):
        hours, minutes, seconds, mark, frames = match.groups()
        count = round(chapter.fps)
        timecode = 60 * (60 * int(hours) + int(minutes)) + int(seconds) + int(frames) / count
        if mark == ":":  # else numbers are left out, so that they keep pace with the clock
            timecode *= count / chapter.fps
    if chapter.path.suffix.lower() in _STREAMS and (match := _START.search(said)):
        start = float(match[1])
    if match := _CREATED.search(said):
        try:
            created = datetime.fromisoformat(match[1]).timestamp()
        except ValueError:
            created = None
    return timecode, start, created


def _shown_s(chapters: Sequence[FrameReader]) -> np.ndarray | None:
    """When the frames of chapters are shown, (n,) float64, s; None where one does not tell."""
    times = [chapter.shown_s for chapter in chapters]
    joined, begin = [], 0.0
    for shown_s in times:
        if shown_s is None or len(shown_s) < 2:
            return None
        joined.append(shown_s - shown_s[0] * bool(joined) + begin)
        begin = float(joined[-1][-1] + np.median(np.diff(shown_s)))
    return np.concatenate(joined)


def _film_track(path: Path) -> Path | None:
    """A copy of a video with its film and its sound alone, in a temporary folder that ends with the
    process; None where the file has no other video track than its first. InputError where there is
    no room for the copy.

    OpenCV reads none but the first.
    """
    return _film_copy(path.absolute(), path.stat().st_mtime_ns)


@cache
def _film_copy(path: Path, changed_ns: int) -> Path | None:
    try:
        said = words_on(path)
    except InputError:  # without FFmpeg
        return None
    tracks = [int(number) for number in _TRACK.findall(said)]
    counts = {track: len(packets(path, track=f"0:{track}")) for track in tracks[1:]}
    film = max(counts, key=lambda track: counts[track], default=None)
    if film is None or counts[film] < 2:
        return None
    folder = Path(tempfile.mkdtemp(prefix="voxelpose-film-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    copy = folder / path.name
    source, track = str(path), f"0:{film}"
    copied = finished(*QUIET, "-i", source, "-map", track, "-map", "0:a?", "-c", "copy", str(copy))
    if copied.returncode:
        raise InputError(
            f"{path}: its film, which is not its first video track, cannot be copied to {folder}:"
            " is there room? Else leave the film alone in the file (ffmpeg -map)"
        )
    return copy
