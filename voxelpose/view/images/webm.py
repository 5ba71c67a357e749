"""Videos that browsers play: VP9 in WebM, encoded by FFmpeg in a process of its own."""

import errno
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from voxelpose.recording.ffmpeg import QUIET, program, video_address

# As fast as VP9 gets, which is about as fast as OpenCV's MPEG-4; OpenCV's own VP8 and VP9 take no
# options and 17 and 70 times as long. Constant quality; one thread, as there is a file per camera.
_OPTIONS = "-an -c:v libvpx-vp9 -pix_fmt yuv420p -deadline realtime -cpu-used 8 -crf 34 -b:v 0"
_RAW = "-y -f rawvideo -pix_fmt bgr24"


class WebmWriter:
    """Writes one video, replacing an earlier file, of a size (width, height) in px. Close it, or
    nothing of it can be read. InputError where there is no FFmpeg for this machine.
    """

    def __init__(self, path: Path, fps: float, size: Sequence[int]):
        self.path, self.frames = path, 0
        self._size = int(size[0]), int(size[1])
        try:
            words = [program(), *QUIET, *_RAW.split(), "-s", "{}x{}".format(*self._size)]
        except InputError as error:
            raise InputError(f"{error}, or use --no-pictures") from error
        words += ["-r", f"{fps}", "-i", "-", *_OPTIONS.split(), "-threads", "1"]
        # Ctrl-C is this program's: what is half-written is removed by it.
        self._encoder = subprocess.Popen(
            [*words, video_address(path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            start_new_session=True,
        )

    def write(self, image: NDArray[np.uint8]) -> None:
        """Writes the next frame, (height, width, 3) uint8 BGR. OSError where the encoder has ended,
        for example because the disk is full.
        """
        assert self._encoder.stdin is not None, "it is a pipe"
        assert image.shape[1::-1] == self._size
        try:
            self._encoder.stdin.write(np.ascontiguousarray(image).data)
        except (OSError, ValueError):
            raise self._failure() from None
        self.frames += 1

    def close(self) -> None:
        """Completes the file, and checks that it holds every frame. OSError where it does not."""
        self.release()
        capture = cv2.VideoCapture(video_address(self.path))
        written = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        capture.release()
        if written != self.frames:
            raise self._failure()

    def release(self) -> None:
        """Ends the process without checks; does nothing the second time."""
        self._encoder.communicate()

    def _failure(self) -> OSError:
        folder = self.path.parent
        if folder.is_dir() and shutil.disk_usage(folder).free < 2**20:
            return OSError(errno.ENOSPC, "no space left for the video", str(self.path))
        reason = "FFmpeg ended before all frames were written (see: voxelpose doctor)"
        return OSError(errno.EIO, reason, str(self.path))
