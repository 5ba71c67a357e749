"""Videos that browsers play: VP9 in WebM, encoded by FFmpeg in a process of its own."""

import errno
import shutil
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError

# As fast as VP9 gets, which is about as fast as OpenCV's MPEG-4; OpenCV's own VP8 and VP9 take no
# options and 17 and 70 times as long. Constant quality; one thread, as there is a file per camera.
_OPTIONS = ["-deadline", "realtime", "-cpu-used", "8", "-crf", "34", "-b:v", "0", "-threads", "1"]


class WebmWriter:
    """Writes one video, replacing an earlier file, of a size (width, height) in px. Close it, or
    nothing of it can be read. InputError where there is no FFmpeg for this machine.
    """

    def __init__(self, path: Path, fps: float, size: Sequence[int]):
        self.path, self.frames = path, 0
        self._size = int(size[0]), int(size[1])
        self._encoder: Generator[None, Any, None] | None = _encoder(path, fps, self._size)

    def write(self, image: NDArray[np.uint8]) -> None:
        """Writes the next frame, (height, width, 3) uint8 BGR. OSError where the encoder has ended,
        for example because the disk is full.
        """
        assert self._encoder is not None
        assert image.shape[1::-1] == self._size
        try:
            self._encoder.send(np.ascontiguousarray(image))
        except OSError:
            self._encoder = None
            raise self._failure() from None
        self.frames += 1

    def close(self) -> None:
        """Completes the file, and checks that it holds every frame. OSError where it does not."""
        self.release()
        capture = cv2.VideoCapture(str(self.path.absolute()))
        written = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        capture.release()
        if written != self.frames:
            raise self._failure()

    def release(self) -> None:
        """Ends the process without checks; does nothing the second time."""
        encoder, self._encoder = self._encoder, None
        if encoder is not None:
            encoder.close()

    def _failure(self) -> OSError:
        folder = self.path.parent
        if folder.is_dir() and shutil.disk_usage(folder).free < 2**20:
            return OSError(errno.ENOSPC, "no space left for the video", str(self.path))
        reason = "FFmpeg ended before all frames were written (see: voxelpose doctor)"
        return OSError(errno.EIO, reason, str(self.path))


def _encoder(path: Path, fps: float, size: tuple[int, int]) -> Generator[None, Any, None]:
    import imageio_ffmpeg

    try:
        encoder = imageio_ffmpeg.write_frames(
            str(path.absolute()),
            size,
            fps=fps,  # type: ignore[arg-type]
            codec="libvpx-vp9",
            pix_fmt_in="bgr24",
            macro_block_size=1,
            quality=None,  # type: ignore[arg-type]
            ffmpeg_log_level="quiet",
            output_params=list(_OPTIONS),
        )
        encoder.send(None)
    except RuntimeError as error:
        raise InputError(
            "videos need FFmpeg, which the package imageio-ffmpeg has none of for this machine:"
            " install it and set IMAGEIO_FFMPEG_EXE to its path, or use --no-pictures"
        ) from error
    return encoder
