"""overlay_CAMERA.mp4 and contact_sheet.png: the fitted body over the pictures it was fitted to."""

from __future__ import annotations

import errno
import os
import shutil
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.estimator import Frame, FrameSource
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter
from voxelpose.view.images.canvas import INK, PAPER, WARNING, Image, write_text
from voxelpose.view.images.contact_sheet import ContactSheet
from voxelpose.view.images.figure import FigurePainter

_LONGEST_PX = 960
# MPEG-4 part 2: the one codec that every OpenCV wheel writes. Slow VP9 would take longer than the
# fit.
_CODEC = "mp4v"


def draw_pictures(
    source: FrameSource, motion: Motion, folder: Path, title: str, reporter: Reporter
) -> None:
    """Reads the frames once more and writes an overlay video per camera and a contact sheet.

    One time step is held at a time.

    Args:
        source: the frames that the motion was estimated from.
        motion: the poses; frames without one are shown as they are and marked.
        folder: where `overlay_CAMERA.mp4` and `contact_sheet.png` go.
        title: first line of the contact sheet.
        reporter: told of every time step.

    Raises:
        OSError: a video could not be written, for example because the disk is full.
    """
    rotation, origin = motion.parts()
    rows = {int(frame): row for row, frame in enumerate(motion.frames)}
    sheet = ContactSheet(motion, rotation, origin, list(source.rig))
    videos = [_Video(folder, camera, motion, source.fps) for camera in source.rig]
    reporter.stage("pictures", source.frame_count)
    with ThreadPoolExecutor(max_workers=min(len(videos), os.cpu_count() or 1)) as pool:
        try:
            for frame, time_s, images in source:
                row = rows.get(frame)
                pose = None if row is None else (rotation[row], origin[row])
                caption = f"frame {frame} · {time_s:.2f} s"
                list(
                    pool.map(
                        lambda video: video.add(images[video.camera.name], pose, caption), videos
                    )
                )  # noqa: B023 (used at once)
                if row is not None:
                    sheet.add(row, images)
                reporter.advance()
        finally:
            for video in videos:
                video.writer.release()
    for video in videos:
        video.check()
    _write_image(sheet.image(title), folder / "contact_sheet.png")


class _Video:
    """One camera's overlay on its way to the disk."""

    def __init__(self, folder: Path, camera: Camera, motion: Motion, fps: float) -> None:
        self.camera = camera
        # Small pictures are enlarged a little, so that lines stay finer than limbs.
        self.painter = FigurePainter(motion.model, camera, min(1.5, _LONGEST_PX / max(camera.size)))
        self.path = folder / f"overlay_{camera.name}.mp4"
        self.frames = 0
        width, height = self.painter.size
        self.size = (width - width % 2, height - height % 2)  # the codec wants even sides
        self.writer = cv2.VideoWriter(
            str(self.path), cv2.VideoWriter.fourcc(*_CODEC), fps, self.size
        )
        if not self.writer.isOpened():
            raise OSError(
                errno.EIO,
                "OpenCV cannot write MPEG-4 video here (see: voxelpose doctor)",
                str(self.path),
            )

    def add(
        self,
        frame: Frame,
        pose: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
        caption: str,
    ) -> None:
        image = self.painter.resized(frame)
        if pose is not None:
            self.painter.paint(image, *pose)
        _mark(image, f"{self.camera.name} · {caption}", "" if pose is not None else "no pose found")
        self.writer.write(image[: self.size[1], : self.size[0]])
        self.frames += 1

    def check(self) -> None:
        check_video(self.path, self.frames)


def check_video(path: Path, frames: int) -> None:
    """Reads the number of frames back: OpenCV does not say when writing fails.

    Raises:
        OSError: there are fewer.
    """
    capture = cv2.VideoCapture(str(path))
    written = int(capture.get(cv2.CAP_PROP_FRAME_COUNT))
    capture.release()
    if written != frames:
        full = path.parent.is_dir() and shutil.disk_usage(path.parent).free < 2**20
        raise OSError(
            errno.ENOSPC if full else errno.EIO,
            f"{written} of {frames} frames were written",
            str(path),
        )


def _mark(image: Image, caption: str, warning: str) -> None:
    size = max(13, image.shape[0] // 45)
    x, y = size, image.shape[0] - size
    for colour, shift in ((PAPER, 1), (INK, 0)):
        write_text(image, caption, x + shift, y + shift, size, colour, bold=True)
    if warning:
        write_text(image, warning, x, y - 2 * size, size, WARNING, bold=True)


def _write_image(image: Image, path: Path) -> None:
    good, data = cv2.imencode(".png", image)
    if not good:
        raise OSError(errno.EIO, "the image could not be encoded", str(path))
    path.write_bytes(data.tobytes())
