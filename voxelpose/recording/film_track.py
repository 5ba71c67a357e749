"""The film in a video file whose first video track is a still picture: a cover, or a thumbnail."""

import atexit
import re
import shutil
import tempfile
from functools import cache
from pathlib import Path

from calib.errors import InputError
from voxelpose.recording.ffmpeg import QUIET, finished

_TRACK = re.compile(r"Stream #0:(\d+).*?: Video: ")


def film_track(path: Path) -> Path | None:
    """A copy of a video with its film and its sound alone, in a temporary folder that ends with the
    process; None where the file has no other video track than its first. InputError where there is
    no room for the copy.

    OpenCV reads none but the first.
    """
    return _copy(path.absolute(), path.stat().st_mtime_ns)


@cache
def _copy(path: Path, changed_ns: int) -> Path | None:
    try:
        said = finished("-hide_banner", "-nostdin", "-i", str(path)).stderr
    except InputError:  # without FFmpeg
        return None
    tracks = [int(number) for number in _TRACK.findall(said)]
    counts = {track: _pictures(path, track) for track in tracks[1:]}
    film = max(counts, key=lambda track: counts[track], default=None)
    if film is None or counts[film] < 2:
        return None
    folder = Path(tempfile.mkdtemp(prefix="voxelpose-film-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    copy = folder / path.name
    copied = finished(*_source(path, film), "-map", "0:a?", "-c", "copy", str(copy))
    if copied.returncode:
        raise InputError(
            f"{path}: its film, which is not its first video track, cannot be copied to {folder}:"
            " is there room? Else leave the film alone in the file (ffmpeg -map)"
        )
    return copy


def _source(path: Path, track: int) -> tuple[str, ...]:
    """Words by which FFmpeg takes a track of a file."""
    return *QUIET, "-i", str(path), "-map", f"0:{track}"


def _pictures(path: Path, track: int) -> int:
    """Number of the pictures of a track."""
    listed = finished(*_source(path, track), "-c", "copy", "-f", "framecrc", "-")
    lines = listed.stdout.splitlines()
    return sum(not line.startswith("#") for line in lines)
