"""The overview: reduced frames of the overlays, as pictures that every browser shows.

Single pictures rather than the videos themselves: the page stays one file, can be stepped through,
and stays synchronous with the charts.
"""

import base64
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.moments import even_moments
from voxelpose.view.images.canvas import encoded, hatched, reduced
from voxelpose.view.images.figure import PeoplePainter
from voxelpose.view.viewer.result_scenes import ResultScenes

_MOST = 120  # pictures
_WIDTH_PX = 880
_QUALITY = 55
_MOST_CAMERAS = 6


@dataclass(frozen=True)
class Preview:
    """Pictures in temporal order."""

    pictures: tuple[str, ...]  # data URIs
    frames: tuple[int, ...]
    time_s: tuple[float, ...]  # time of each, seconds
    cameras: tuple[str, ...]  # names, in the pictures from left to right and top to bottom
    size: tuple[int, int]  # width and height, pixels


def make_preview(folder: Path, scenes: ResultScenes) -> Preview | None:
    """Preview from the overlay videos in a folder, else from the recording; None where both are
    missing.
    """
    first, last = int(scenes.frames[0]), int(scenes.frames[-1])
    chosen = (first + even_moments(last - first + 1, _MOST, margin=0)).tolist()
    names = scenes.rig.names[:: -(-len(scenes.rig) // _MOST_CAMERAS)]
    videos = [folder.absolute() / f"overlay_{name}.webm" for name in names]
    if all(video.exists() for video in videos):
        tiled = _overlay_tiles(videos, first, set(chosen))
    elif scenes.recording is not None:
        tiled = _painted_tiles(scenes, names, chosen)
    else:
        return None
    pictures, frames, size = [], [], (0, 0)
    for frame, tiles in tiled:
        page = _mosaic(tiles)
        size = page.shape[1], page.shape[0]
        pictures.append(data_uri(page, _WIDTH_PX, ".webp", _QUALITY))
        frames.append(frame)
    if not pictures:
        return None
    times = np.array(frames) / scenes.fps
    if len(scenes.time_s) > 1:
        times = np.interp(frames, [*scenes.time_s], [*scenes.time_s.values()])
    times_s = tuple(np.round(times, 4).tolist())
    return Preview(tuple(pictures), tuple(frames), times_s, tuple(names), size)


def data_uri(image: NDArray[np.uint8], width: int, suffix: str, quality: int) -> str:
    """Image (h, w, 3) uint8 BGR, reduced to a largest width in px, as a data URI of the format
    .webp or .jpg with a quality from 1 to 100.
    """
    data = encoded(reduced(image, width / image.shape[1]), suffix, quality)
    media = "webp" if suffix == ".webp" else "jpeg"
    return f"data:image/{media};base64,{base64.b64encode(data).decode()}"


def _overlay_tiles(
    videos: list[Path], first: int, chosen: set[int]
) -> Iterator[tuple[int, list[NDArray[np.uint8]]]]:
    captures = [cv2.VideoCapture(str(video)) for video in videos]
    try:
        for frame in range(first, max(chosen) + 1):
            if not all([capture.grab() for capture in captures]):
                return
            if frame in chosen:
                tiles = [capture.retrieve()[1] for capture in captures]
                yield frame, [np.asarray(tile, np.uint8) for tile in tiles]
    finally:
        for capture in captures:
            capture.release()


def _painted_tiles(
    scenes: ResultScenes, names: tuple[str, ...], chosen: list[int]
) -> Iterator[tuple[int, list[NDArray[np.uint8]]]]:
    models = [motion.model for motion in scenes.motions]
    for frame in chosen if models else ():
        tiles, poses = [], scenes.part_poses(frame)
        for camera_frame in scenes.camera_frames(frame):
            camera, picture, mask = camera_frame.camera, camera_frame.picture, camera_frame.mask
            if camera.name in names and mask is not None:
                if picture is None:
                    picture = np.where(mask[..., None], 200, 40).repeat(3, 2)
                tile = np.ascontiguousarray(picture[..., ::-1], np.uint8)
                if camera_frame.unknown is not None:
                    tile = hatched(tile, camera_frame.unknown)
                PeoplePainter(models, camera).paint(tile, poses)
                tiles.append(tile)
        yield frame, tiles


def _mosaic(tiles: list[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Pictures side by side, in two rows if there are three or more."""
    columns = len(tiles) if len(tiles) < 3 else -(-len(tiles) // 2)
    width = _WIDTH_PX // max(columns, 2)
    height = round(width * max(tile.shape[0] / tile.shape[1] for tile in tiles))
    rows = -(-len(tiles) // columns)
    page = np.full((rows * height, columns * width, 3), 24, np.uint8)
    for k, tile in enumerate(tiles):
        scale = min(width / tile.shape[1], height / tile.shape[0])
        size = round(tile.shape[1] * scale), round(tile.shape[0] * scale)
        small = cv2.resize(tile, size, interpolation=cv2.INTER_AREA)
        top, left = (k // columns) * height, (k % columns) * width
        page[top : top + small.shape[0], left : left + small.shape[1]] = small
    return page
