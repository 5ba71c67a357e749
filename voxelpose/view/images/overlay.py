"""Overlays and contact sheet: the fitted body over the pictures it was fitted to."""

from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import chain
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.estimator import Frame, FrameSource
from silhouette_core.jit import cores
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter
from voxelpose.view.images.canvas import INK, PAPER, WARNING, Image, png, write_text
from voxelpose.view.images.contact_sheet import ContactSheet
from voxelpose.view.images.figure import FigurePainter
from voxelpose.view.images.webm import WebmWriter

_LONGEST_PX = 960
_PAINTED_AHEAD = 2  # time steps


def draw_pictures(
    source: FrameSource, motion: Motion, folder: Path, title: str, reporter: Reporter
) -> None:
    """Writes `overlay_CAMERA.webm` for every camera and `contact_sheet.png`.

    Reads the frames again. Few time steps are held in memory at a time: while one is written, the
    next ones are painted.

    Args:
        motion: the poses; frames without one are shown unchanged and marked.
        title: first line of the contact sheet.

    Raises:
        OSError: a video could not be written, for example because the disk is full.
    """
    rotation, origin = motion.parts()
    rows = {int(frame): row for row, frame in enumerate(motion.frames)}
    unknown = source.unknown()
    sheet = ContactSheet(motion, rotation, origin, list(source.rig), unknown)
    videos = [
        _Video(folder, camera, motion, source.fps, unknown.get(camera.name))
        for camera in source.rig
    ]
    reporter.stage("pictures", source.frame_count)
    painted: deque[list[Future[Image]]] = deque()
    tiles: list[Future[None]] = []

    def write_oldest() -> None:
        # Encoding takes as long as painting: every video in a thread, and in order.
        images = painted.popleft()
        written = [
            pool.submit(lambda video, image: video.writer.write(image.result()), video, image)
            for video, image in zip(videos, images, strict=True)
        ]
        for one in written:
            one.result()
        reporter.advance()

    try:
        with ThreadPoolExecutor(cores()) as pool:
            try:
                for frame, time_s, images in source:
                    row = rows.get(frame)
                    pose = None if row is None else (rotation[row], origin[row])
                    caption = f"frame {frame} · {time_s:.2f} s"
                    painted.append(
                        [
                            pool.submit(video.painted, images[video.camera.name], pose, caption)
                            for video in videos
                        ]
                    )
                    if row is not None:
                        tiles.append(pool.submit(sheet.add, row, images))
                    if len(painted) > _PAINTED_AHEAD:
                        write_oldest()
                while painted:
                    write_oldest()
                for tile in tiles:
                    tile.result()
            finally:
                for image in chain.from_iterable(painted):
                    image.cancel()
        for video in videos:
            video.writer.close()
    finally:  # no thread writes any more
        for video in videos:
            video.writer.release()
    (folder / "contact_sheet.png").write_bytes(png(sheet.image(title)))


class _Video:
    """Writer of one camera's overlay."""

    def __init__(
        self,
        folder: Path,
        camera: Camera,
        motion: Motion,
        fps: float,
        unknown: NDArray[np.bool_] | None,
    ) -> None:
        self.camera = camera
        # Small pictures are enlarged, so that lines stay thinner than limbs.
        scale = min(1.5, _LONGEST_PX / max(camera.size))
        self.painter = FigurePainter(motion.model, camera, scale, unknown)
        self.writer = WebmWriter(folder / f"overlay_{camera.name}.webm", fps, self.painter.size)

    def painted(
        self,
        frame: Frame,
        pose: tuple[NDArray[np.float64], NDArray[np.float64]] | None,
        caption: str,
    ) -> Image:
        """Picture of a frame with its pose; any thread may paint it."""
        image = self.painter.resized(frame)
        if pose is not None:
            self.painter.paint(image, *pose)
        warning = "" if pose is not None else "no pose found"
        _mark(image, f"{self.camera.name} · {caption}", warning)
        return image


def _mark(image: Image, caption: str, warning: str) -> None:
    size = max(13, image.shape[0] // 45)
    x, y = size, image.shape[0] - size
    for colour, shift in ((PAPER, 1), (INK, 0)):
        write_text(image, caption, x + shift, y + shift, size, colour, bold=True)
    if warning:
        write_text(image, warning, x, y - 2 * size, size, WARNING, bold=True)
