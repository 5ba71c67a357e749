"""The overview: moments of the overlays, small, as pictures that every browser shows.

The overlay videos are MPEG-4 part 2, which no browser plays, and what plays everywhere (H.264) has
no encoder without the GPL in the wheels there are. OpenCV's VP8 would do on Linux, but not every
wheel has it. Single pictures need no codec, can be stepped through frame by frame, and keep in step
with the charts.
"""

from __future__ import annotations

import base64
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from voxelpose.results import Result
from voxelpose.view.images.figure import FigurePainter
from voxelpose.view.viewer.result_scenes import ResultScenes

_MOST = 120  # pictures
_WIDTH_PX = 880
_QUALITY = 55
_MOST_CAMERAS = 6


@dataclass(frozen=True)
class Preview:
    """Pictures in the order of time.

    Attributes:
        pictures: data URIs.
        frames: number of the frame of each.
        time_s: its time, seconds.
        cameras: names, as they lie from left to right and top to bottom.
        size: width and height, px.
    """

    pictures: tuple[str, ...]
    frames: tuple[int, ...]
    time_s: tuple[float, ...]
    cameras: tuple[str, ...]
    size: tuple[int, int]


def make_preview(result: Result, scenes: ResultScenes) -> Preview | None:
    """Takes the overview from the overlay videos, else draws it; None where the result has none and
    the recording is gone.
    """
    first, last = int(scenes.frames[0]), int(scenes.frames[-1])
    wanted = np.unique(
        np.linspace(first, last, min(_MOST, last - first + 1)).round().astype(int)
    ).tolist()
    names = result.rig.names[:: -(-len(result.rig) // _MOST_CAMERAS)]
    if all((result.folder / f"overlay_{name}.mp4").exists() for name in names):
        found = _from_overlays(result, names, first, set(wanted))
    elif scenes.recording is not None:
        found = _drawn(result, scenes, names, wanted)
    else:
        return None
    pictures, frames, size = [], [], (0, 0)
    for frame, tiles in found:
        page = _mosaic(tiles)
        size = page.shape[1], page.shape[0]
        pictures.append(data_uri(page, ".webp", _QUALITY))
        frames.append(frame)
    if not pictures:
        return None
    motion = result.motion
    times = (
        np.interp(frames, motion.frames, motion.time_s)
        if len(motion) > 1
        else np.array(frames) / motion.fps
    )
    return Preview(
        tuple(pictures), tuple(frames), tuple(np.round(times, 4).tolist()), tuple(names), size
    )


def data_uri(image: NDArray[np.uint8], kind: str, quality: int) -> str:
    """Encodes (h, w, 3) BGR as a data URI; kind is .webp or .jpg."""
    flag = cv2.IMWRITE_WEBP_QUALITY if kind == ".webp" else cv2.IMWRITE_JPEG_QUALITY
    good, data = cv2.imencode(kind, image, [flag, quality])
    if not good:
        raise ValueError(f"OpenCV cannot encode {kind}")
    return f"data:image/{'webp' if kind == '.webp' else 'jpeg'};base64,{base64.b64encode(data.tobytes()).decode()}"


def _from_overlays(
    result: Result, names: tuple[str, ...], first: int, wanted: set[int]
) -> Iterator[tuple[int, list[NDArray[np.uint8]]]]:
    captures = [cv2.VideoCapture(str(result.folder / f"overlay_{name}.mp4")) for name in names]
    try:
        for frame in range(first, max(wanted) + 1):
            if not all([capture.grab() for capture in captures]):
                return
            if frame in wanted:
                read = [capture.retrieve() for capture in captures]
                yield frame, [np.asarray(tile, np.uint8) for _, tile in read]
    finally:
        for capture in captures:
            capture.release()


def _drawn(
    result: Result, scenes: ResultScenes, names: tuple[str, ...], wanted: list[int]
) -> Iterator[tuple[int, list[NDArray[np.uint8]]]]:
    rotation, origin = result.motion.parts()
    for frame in wanted:
        tiles, row = [], scenes.row(frame)
        for camera_frame in scenes.camera_frames(frame):
            if camera_frame.camera.name in names and camera_frame.mask is not None:
                seen = (
                    camera_frame.picture
                    if camera_frame.picture is not None
                    else np.where(camera_frame.mask[..., None], 200, 40).repeat(3, 2)
                )
                tile = np.ascontiguousarray(seen[..., ::-1], np.uint8)
                if row is not None:
                    tile = FigurePainter(result.motion.model, camera_frame.camera).paint(
                        tile, rotation[row], origin[row]
                    )
                tiles.append(tile)
        yield frame, tiles


def _mosaic(tiles: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Lays pictures side by side, in two rows from three on."""
    columns = len(tiles) if len(tiles) < 3 else -(-len(tiles) // 2)
    width = _WIDTH_PX // max(columns, 2)
    height = round(width * max(tile.shape[0] / tile.shape[1] for tile in tiles))
    rows = -(-len(tiles) // columns)
    page = np.full((rows * height, columns * width, 3), 24, np.uint8)
    for k, tile in enumerate(tiles):
        scale = min(width / tile.shape[1], height / tile.shape[0])
        small = cv2.resize(
            tile,
            (round(tile.shape[1] * scale), round(tile.shape[0] * scale)),
            interpolation=cv2.INTER_AREA,
        )
        top, left = (k // columns) * height, (k % columns) * width
        page[top : top + small.shape[0], left : left + small.shape[1]] = small
    return page
