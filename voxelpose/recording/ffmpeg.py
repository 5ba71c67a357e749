"""FFmpeg, the program that imageio-ffmpeg brings along, and when it shows a video's pictures."""

import re
import subprocess
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError

QUIET = ("-v", "quiet", "-nostdin")
_STREAMS = frozenset(".ts .mts .m2ts .mpg .mpeg".split())  # they begin at any time of a clock
_UNKNOWN = -(2**62)  # ticks, below which FFmpeg says that it does not know
_AS_LONG = re.compile("Video: (ffv1|mpeg4)")  # they may spend as many bytes on what is repeated
_ALIKE = "Video: mjpeg"  # it codes a picture in the same bytes again
_SMALL = 10
"""Times smaller than the mean is a coded picture that may be the one before; and by so many times
less than their mean vary the bytes of so many pictures where a budget is spent: of 15 videos coded
at a quality those of 1, of 9 coded at a constant rate those of 8."""
_HEADERS = 64  # bytes, of a coded picture in which nothing changes, at most
_FIRST_TRACK = "0:v:0"
_FIRST = ("-", "-map", _FIRST_TRACK, "-vf", "showinfo", "-frames:v", "1", "-f", "null")
_FILMED = re.compile(r"com\.android\.capture\.fps\s*: ([\d.]+)")
_FLAGS = re.compile(r"F=0x([0-9A-F]+)")  # of a coded picture; none: _KEY alone
_KEY, _CUT_OFF = 1, 4
_FIELDS = re.compile(r"\bi:[TB]\b")  # of a picture, in the words of the filter showinfo


@dataclass(frozen=True, eq=False)
class CodedPictures:
    """What a video's file tells of its pictures; hardly any is decoded."""

    count: int = 0  #: number of those that are shown; 0 without FFmpeg.
    shown_s: NDArray[np.float64] | None = None
    """(count,) float64, s, increasing, when they are; None where it does not tell."""
    cut_off: int = 0  #: number of those that an edit list leaves out.
    interlaced: bool = False  #: whether the first is flagged as two fields.
    may_repeat: bool = False
    """Whether some are coded in so few bytes, or so alike, that they may be those before them."""
    filmed_fps: float | None = None
    """Frames per second at which a telephone says that it filmed; None where it does not."""


def coded_pictures(path: Path) -> CodedPictures:
    """Looks at a video's file."""
    try:
        table, words = _packets(path, "-copyts", *_FIRST)
    except (InputError, OSError):
        return CodedPictures()
    first_coded_s = table[0, 0] if len(table) else np.nan
    cut_off = int(table[:, 5].sum()) // _CUT_OFF
    table = table[table[:, 5] == 0]
    filmed = _FILMED.search(words)
    coded = CodedPictures(
        len(table),
        cut_off=cut_off,
        filmed_fps=None if filmed is None else float(filmed[1]),
        interlaced=_FIELDS.search(words) is not None,
        may_repeat=_may_repeat(table, words),
    )
    times_s = np.sort(table[:, 1])
    if not len(table) or np.isnan(times_s[-1]) or (np.diff(times_s) <= 0).any():
        return coded
    # Without an edit list, pictures come late by as much as some are coded ahead.
    counts_from_first = path.suffix.lower() in _STREAMS or first_coded_s == 0
    return replace(coded, shown_s=times_s - times_s[0] * counts_from_first)


def _may_repeat(table: NDArray[np.float64], words: str) -> bool:
    """Whether coded pictures, as of `_packets`, may be those before them."""
    coded = table[np.argsort(table[:, 1], kind="stable"), 2:]
    if len(coded) < 3:
        return False
    small = _SMALL * (coded[:, 0] - _HEADERS) < coded[:, 0].mean()
    alike = (coded[1:] == coded[:-1]).all(axis=1)
    # What codes each picture by itself, or by a budget, spends as many bytes on a repeated one.
    spent = np.convolve(coded[:, 0], np.ones(_SMALL), "valid")
    even = coded[:, 2].all() or _SMALL * spent.std() < spent.mean()
    budget = even and _ALIKE not in words
    return bool(small.any() or alike.any() or budget or _AS_LONG.search(words))


def packets(path: Path, *words: str, track: str = _FIRST_TRACK) -> NDArray[np.float64]:
    """When a video's coded pictures are to be decoded and shown, (n, 2), s, in the order of the
    file; NaN where it does not tell. InputError where there is no FFmpeg for this machine.

    Args:
        words: further options of FFmpeg's output.
    """
    return _packets(path, *words, track=track)[0][:, :2]


def _packets(path: Path, *words: str, track: str = _FIRST_TRACK) -> tuple[NDArray[np.float64], str]:
    """Times as of `packets`, numbers of bytes, checksums, whether a picture is coded by itself, and
    whether an edit list cuts it off, (n, 6); and what FFmpeg says.
    """
    source = _track(path, track)
    done = finished("-nostdin", *source, "-c", "copy", "-f", "framecrc", *words, "-")
    unit, rows = 1.0, []
    for line in done.stdout.splitlines():
        if line.startswith("#tb 0:"):
            top, _, bottom = line.removeprefix("#tb 0:").partition("/")
            unit = float(top) / float(bottom)
        elif line.startswith("0,"):
            flags = int((_FLAGS.search(line) or ("", "1"))[1], 16)
            coded = (int(line.split(",")[k], 0) for k in (1, 2, 4, 5))
            rows.append([*coded, flags & _KEY, flags & _CUT_OFF])
    table = np.array(rows, np.int64).reshape(-1, 6)
    times = np.where(table[:, :2] > _UNKNOWN, table[:, :2] * unit, np.nan)
    return np.column_stack([times, table[:, 2:].astype(np.float64)]), done.stderr


@cache
def has_fields(path: Path, changed_ns: int) -> bool:
    """Whether any picture of a video, which was changed last at a time, is flagged as two fields;
    all are decoded.
    """
    try:
        done = finished("-nostdin", *_track(path), "-vf", "showinfo", "-f", "null", "-")
        return _FIELDS.search(done.stderr) is not None
    except (InputError, OSError):
        return False


class FieldCapture:
    """Pictures of a video flagged as interlaced, which OpenCV 5 does not convert, decoded by
    FFmpeg; those whose lines are of two moments are deinterlaced. It is used as `cv2.VideoCapture`.
    """

    def __init__(self, path: Path, size: tuple[int, int]) -> None:
        """Opens a video of pictures (width, height) px. InputError where there is no FFmpeg for
        this machine.
        """
        source = (*_track(path), "-fps_mode", "passthrough")
        raw = ("-vf", "idet,bwdif=send_frame:auto:interlaced", "-f", "rawvideo", "-pix_fmt")
        words = [program(), *QUIET, *source, *raw, "bgr24", "-"]
        self._size = size
        self._process = subprocess.Popen(words, stdout=subprocess.PIPE)

    def grab(self) -> bool:
        """Passes over a picture; whether there was one."""
        return self.read()[0]

    def read(self) -> tuple[bool, NDArray[np.uint8] | None]:
        """Whether there is another picture, and it, (H, W, 3) uint8, BGR."""
        width, height = self._size
        assert self._process.stdout is not None, "it is a pipe"
        data = self._process.stdout.read(3 * width * height)
        if len(data) < 3 * width * height:
            return False, None
        return True, np.frombuffer(bytearray(data), np.uint8).reshape(height, width, 3)

    def release(self) -> None:
        """Ends FFmpeg."""
        self._process.kill()
        self._process.communicate()


def video_address(path: Path) -> str:
    """A video's path as FFmpeg takes it: a colon in a relative one would name a protocol."""
    return str(path.absolute())


def _track(path: Path, track: str = _FIRST_TRACK) -> tuple[str, ...]:
    return "-i", video_address(path), "-map", track


def words_on(path: Path) -> str:
    """What FFmpeg says of a file and its tracks. InputError where there is none."""
    return finished("-hide_banner", "-nostdin", "-i", video_address(path)).stderr


def finished(*words: str) -> subprocess.CompletedProcess[str]:
    """FFmpeg with these arguments, at its end. InputError where there is none for this machine."""
    return subprocess.run(
        [program(), *words], capture_output=True, check=False, encoding="utf-8", errors="replace"
    )


def program() -> str:
    """Path of FFmpeg. InputError where there is none for this machine."""
    import imageio_ffmpeg

    try:
        return imageio_ffmpeg.get_ffmpeg_exe()
    except RuntimeError as error:
        raise InputError(
            "this needs FFmpeg, which the package imageio-ffmpeg has none of for this machine:"
            " install it and set IMAGEIO_FFMPEG_EXE to its path"
        ) from error
