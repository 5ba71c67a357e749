"""Pictures of a fit: overlays and contact sheet, which show the body over the pictures; and
silhouettes that are refused, beside the result that is not there.
"""

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace
from itertools import chain, cycle
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from calib.errors import InputError
from calib.moments import even_moments
from calib.storage.atomic import write_whole
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Frame, FrameSource
from silhouette_core.image.plausibility import ImplausibleSilhouettesError, telling_frames
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.jit import cores
from silhouette_core.motion import kinematics
from silhouette_core.motion.motion import Motion, posed_times
from silhouette_core.progress import Reporter
from voxelpose.recording.folder import Recording
from voxelpose.view.images import canvas
from voxelpose.view.images.canvas import FAINT, INK, MIDDLE, PAPER, Image, png, write_text
from voxelpose.view.images.figure import PartPoses, PeoplePainter
from voxelpose.view.images.webm import WebmWriter

_GAP, _MARGIN, _HEAD, _LABEL = 6, 28, 96, 92
_LEGEND = 360
_WIDEST, _HIGHEST = 1900, 2000
_LEAST_PX, _MOST_PX = 640, 960  # longer side of a video
_PAINTED_AHEAD = 2  # time steps


_Poses = Sequence[PartPoses | None]
"""Of one moment, of everybody; None: not there."""


class _Motions:
    """Poses of one person, or of several, by frame number."""

    def __init__(self, motions: Sequence[Motion]) -> None:
        self.models = [motion.model for motion in motions]
        self._parts = [motion.parts() for motion in motions]
        self._rows = [{int(f): row for row, f in enumerate(motion.frames)} for motion in motions]
        self.time_s = posed_times(motions)

    def poses(self, frame: int) -> list[PartPoses | None]:
        """Everybody's pose in a frame."""
        return [
            (rotation[rows[frame]], origin[rows[frame]]) if frame in rows else None
            for rows, (rotation, origin) in zip(self._rows, self._parts, strict=True)
        ]


class ContactSheet:
    """Collects tiles while frames are read; each camera is cropped to where the body moves."""

    def __init__(
        self,
        motions: Sequence[Motion],
        cameras: Sequence[Camera],
        unknown: Mapping[str, NDArray[np.bool_]],
    ) -> None:
        """Chooses at most six moments, and the crops, of cameras, a row each; `unknown`, (H, W)
        bool by camera name, tells where nothing is known.
        """
        people = _Motions(motions)
        self.models, self.time_s, filmed = people.models, people.time_s, [*people.time_s]
        self.frames = [filmed[k] for k in even_moments(len(filmed), 6, margin=0)]
        self.poses = [people.poses(frame) for frame in self.frames]
        skins = [
            kinematics.skin(model, *pose)
            for poses in self.poses
            for model, pose in zip(self.models, poses, strict=True)
            if pose is not None
        ]
        boxes = [_box(np.concatenate(skins), camera) for camera in cameras]
        aspects = [width / height for _, _, width, height in boxes]
        aspect = float(np.clip(np.median(aspects), 0.55, 1.4))
        width = (_WIDEST - _LABEL - 2 * _MARGIN) / max(4, len(self.frames)) - _GAP
        height = min(width / aspect, (_HIGHEST - _HEAD - _MARGIN) / len(cameras) - _GAP)
        self.tile = round(height * aspect), round(height)
        self.views = [
            _View(self.models, camera, box, self.tile, unknown.get(camera.name))
            for camera, box in zip(cameras, boxes, strict=True)
        ]
        self.tiles: dict[tuple[int, int], canvas.Image] = {}

    def add(self, frame: int, images: Mapping[str, canvas.Image]) -> None:
        """Keeps the tiles of one frame, if it is one of the moments."""
        if frame in self.frames:
            column = self.frames.index(frame)
            for line, view in enumerate(self.views):
                image = images[view.painter.camera.name]
                self.tiles[line, column] = view.crop(image, self.poses[column])

    def image(self, title: str) -> canvas.Image:
        """The finished sheet, (h, w, 3) uint8 BGR."""
        width, height = self.tile
        sheet_width = 2 * _MARGIN + _LABEL + len(self.frames) * (width + _GAP) - _GAP
        sheet_width = max(sheet_width, 2 * _MARGIN + canvas.text_width(title, 24, True) + _LEGEND)
        sheet_height = _HEAD + len(self.views) * (height + _GAP) - _GAP + _MARGIN
        sheet = np.full((sheet_height, sheet_width, 3), canvas.PAPER, np.uint8)
        canvas.write_text(sheet, title, _MARGIN, 44, 24, canvas.INK, bold=True)
        x = sheet_width - _MARGIN
        for label, colour in self._legend():
            x -= canvas.text_width(label, 14)
            canvas.write_text(sheet, label, x, 42, 14, canvas.FAINT)
            canvas.dots(sheet, np.array([[x - 12.0, 37.0]]), 5, colour)
            x -= 36
        for line, view in enumerate(self.views):
            top = _HEAD + line * (height + _GAP)
            name = view.painter.camera.name
            canvas.write_text(sheet, name, _MARGIN, top + height // 2, 16, canvas.INK, bold=True)
            for column, frame in enumerate(self.frames):
                left = _MARGIN + _LABEL + column * (width + _GAP)
                if line == 0:
                    label = f"frame {frame} · {self.time_s[frame]:.2f} s"
                    canvas.write_text(sheet, label, left, _HEAD - 10, 14, canvas.FAINT)
                if (line, column) in self.tiles:
                    sheet[top : top + height, left : left + width] = self.tiles[line, column]
        return sheet

    def _legend(self) -> list[tuple[str, canvas.Colour]]:
        """What the colours mean, from right to left."""
        if len(self.models) > 1:
            pairs = zip(range(len(self.models)), cycle(canvas.PEOPLE), strict=False)
            return [(f"person {k + 1}", colour) for k, colour in pairs][::-1]
        if not canvas.has_sides(self.models[0].names):
            return []
        right = "right side, bones dashed", canvas.RIGHT
        return [("middle", canvas.MIDDLE), right, ("left side", canvas.LEFT)]


class _View:
    """One camera's crop, painted at the size at which it is shown."""

    def __init__(
        self,
        models: Sequence[BodyModel],
        camera: Camera,
        box: tuple[float, float, float, float],
        tile: tuple[int, int],
        unknown: NDArray[np.bool_] | None,
    ) -> None:
        left, top, width, height = box
        self.tile = tile
        # A distant figure is enlarged threefold at most: beyond that no more detail appears.
        scale = min(3.0, tile[0] / width, tile[1] / height)
        middle = (np.array([left + width / 2, top + height / 2]) + 0.5) * scale - 0.5
        shift = np.array(tile) / 2 - middle
        # Where the picture continues beyond the tile's edge, it is shown instead of an empty rim.
        slack = np.array(tile) - np.array(camera.pinhole(scale).size)
        shift = np.clip(shift, np.minimum(slack, slack / 2), np.maximum(0, slack / 2))
        # Nothing is painted but what the tile shows.
        low = np.maximum(np.floor(-shift / scale), 0).astype(int)
        high = np.minimum(np.ceil((np.array(tile) - shift) / scale), camera.size).astype(int)
        self.window = slice(low[1], high[1]), slice(low[0], high[0])
        matrix = camera.matrix.copy()
        matrix[:2, 2] -= low
        size = int(high[0] - low[0]), int(high[1] - low[1])
        part = replace(camera, matrix=matrix, size=size)
        hidden = None if unknown is None else unknown[self.window]
        self.painter = PeoplePainter(models, part, scale, hidden)
        self.shift = shift + low * scale

    def crop(self, frame: canvas.Image, poses: _Poses) -> canvas.Image:
        image = self.painter.resized(np.ascontiguousarray(frame[self.window]))
        self.painter.paint(image, poses)
        move = np.array([[1.0, 0.0, round(self.shift[0])], [0.0, 1.0, round(self.shift[1])]])
        rim = (48, 42, 38)
        tile = cv2.warpAffine(image, move, self.tile, flags=cv2.INTER_NEAREST, borderValue=rim)
        return np.asarray(tile, np.uint8)


def _box(points: NDArray[np.float64], camera: Camera) -> tuple[float, float, float, float]:
    """Left, top, width, height, px, around points (N, 3); the picture if none is visible."""
    pixels, _ = camera.project(points)
    pixels = np.clip(pixels[np.isfinite(pixels).all(axis=1)], 0, np.array(camera.size) - 1)
    low, high = np.zeros(2), np.array(camera.size, float)
    if len(pixels):
        low, high = pixels.min(0), pixels.max(0)
    width, height = np.maximum(high - low, 16)
    rim = 0.07 * max(width, height)
    return low[0] - rim, low[1] - rim, width + 2 * rim, height + 2 * rim


def draw_pictures(
    source: FrameSource, motions: Sequence[Motion], folder: Path, title: str, reporter: Reporter
) -> None:
    """Writes `overlay_CAMERA.webm` for every camera and `contact_sheet.png` below a title, of one
    person or several; frames without a pose are shown unchanged and marked. OSError where a video
    cannot be written, for example because the disk is full.

    Reads the frames again. Few time steps are held in memory at a time: while one is written, the
    next ones are painted.
    """
    people, unknown = _Motions(motions), source.unknown()
    sheet = ContactSheet(motions, list(source.rig), unknown)
    videos = [
        _Video(folder, camera, people.models, source.fps, unknown.get(camera.name))
        for camera in source.rig
    ]
    reporter.stage("pictures", source.frame_count)
    painted: deque[list[Future[canvas.Image]]] = deque()
    tiles: list[Future[None]] = []

    def write_oldest() -> None:
        # Encoding takes as long as painting: every video in a thread, and in order.
        images = painted.popleft()
        encodings = [
            pool.submit(lambda video, image: video.writer.write(image.result()), video, image)
            for video, image in zip(videos, images, strict=True)
        ]
        for encoding in encodings:
            encoding.result()
        reporter.advance()

    try:
        with ThreadPoolExecutor(cores()) as pool:
            try:
                for frame, time_s, images in source:
                    poses = people.poses(frame)
                    caption = f"frame {frame} · {time_s:.2f} s"
                    painted.append(
                        [
                            pool.submit(video.painted, images[video.camera.name], poses, caption)
                            for video in videos
                        ]
                    )
                    tiles.append(pool.submit(sheet.add, frame, images))
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
    (folder / "contact_sheet.png").write_bytes(canvas.png(sheet.image(title)))


class _Video:
    def __init__(
        self,
        folder: Path,
        camera: Camera,
        models: Sequence[BodyModel],
        fps: float,
        unknown: NDArray[np.bool_] | None,
    ) -> None:
        self.camera = camera
        # Small pictures are enlarged, so that lines stay thinner than limbs.
        scale = float(np.clip(1.0, _LEAST_PX / max(camera.size), _MOST_PX / max(camera.size)))
        self.painter = PeoplePainter(models, camera, scale, unknown)
        self.writer = WebmWriter(folder / f"overlay_{camera.name}.webm", fps, self.painter.size)

    def painted(self, frame: Frame, poses: _Poses, caption: str) -> canvas.Image:
        """Picture of a frame with everybody's pose; any thread may paint it."""
        image = self.painter.resized(frame)
        self.painter.paint(image, poses)
        warning = "" if any(pose is not None for pose in poses) else "no pose found"
        _mark(image, f"{self.camera.name} · {caption}", warning)
        return image


def _mark(image: canvas.Image, caption: str, warning: str) -> None:
    size = max(13, image.shape[0] // 45)
    x, y = size, image.shape[0] - size
    for colour, shift in ((canvas.PAPER, 1), (canvas.INK, 0)):
        canvas.write_text(image, caption, x + shift, y + shift, size, colour, bold=True)
    if warning:
        canvas.write_text(image, warning, x, y - 2 * size, size, canvas.WARNING, bold=True)


_REFUSED_HEAD, _NAME = 64, 58
_ROW_PX = 420  # height of a camera's row at most
_SHOWN = 3  # moments, each with the frame after it


@contextmanager
def refusal_drawn(recording: Recording, out: Path | str) -> Iterator[None]:
    """For a `with` block that estimates a recording into the folder `out`, whose parent exists:
    silhouettes that are refused are drawn into `OUT.silhouettes.png`, which the InputError then
    names; where they are not, an earlier such picture is removed.
    """
    target = Path(out).resolve()
    path = target.with_name(f"{target.name}.silhouettes.png")
    try:
        yield
    except ImplausibleSilhouettesError as error:
        sheet = draw_refused(recording, error)
        try:
            write_whole(path, png(sheet))
        except InputError:  # nothing can be written there: that they are refused says more
            raise error from None
        raise error.shown_in(path) from error
    path.unlink(missing_ok=True)


def draw_refused(recording: Recording, error: ImplausibleSilhouettesError) -> Image:
    """A sheet (h, w, 3) uint8 BGR: cameras from top to bottom, three moments from left to right,
    each with the frame after it, and the silhouettes over their pictures.
    """
    steps = telling_frames(recording.frame_count)
    pairs = even_moments(len(steps) // 2, _SHOWN).tolist()
    columns = {steps[k]: k for pair in pairs for k in (2 * pair, 2 * pair + 1)}  # each frame once
    frames = dict(zip(columns, recording.at(list(columns)), strict=True))
    room = (_WIDEST - 2 * _MARGIN + _GAP) // (2 * _SHOWN) - _GAP
    rows = []
    for name, masks in error.masks.items():
        height, width = masks[0].shape
        scale = min(room / width, _ROW_PX / height)
        size = round(width * scale), round(height * scale)
        lens = error.lenses.get(name)
        tiles = [_tile(frames[step][name], masks[k], lens, size) for step, k in columns.items()]
        rows.append((f"{name}: {error.faults[name]}", size, tiles))
    sheet = np.full(
        (_REFUSED_HEAD + sum(_NAME + size[1] for _, size, _ in rows) + _MARGIN, _WIDEST, 3),
        PAPER,
        np.uint8,
    )
    title = f"{recording.folder.resolve().name} · silhouettes that cannot be those of a person"
    write_text(sheet, title, _MARGIN, 44, 24, INK, bold=True)
    top = _REFUSED_HEAD
    for words, (width, height), tiles in rows:
        write_text(sheet, words, _MARGIN, top + 26, 17, INK, bold=True)
        left, top = _MARGIN, top + _NAME
        for step, tile in zip(columns, tiles, strict=True):
            write_text(sheet, f"frame {recording.numbers[step]}", left, top - 8, 14, FAINT)
            sheet[top : top + height, left : left + width] = tile
            left += width + _GAP
        top += height
    return sheet


def _tile(
    frame: Frame, mask: NDArray[np.bool_], lens: UndistortedView | None, size: tuple[int, int]
) -> Image:
    """A frame in a size (width, height), grey outside of its silhouette, which is outlined."""
    if lens is not None:
        frame = lens.undistort_part(frame, (0, 0), lens.pinhole.size)
    image = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    share = cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA)[..., None]
    grey = image.mean(axis=2, keepdims=True)  # rooms have all colours
    inner, outer = 0.6 * image + 0.4 * np.array(MIDDLE), 0.5 * grey
    image = np.asarray(share * inner + (1 - share) * outer, np.uint8)
    inside = (share[..., 0] > 0.5).astype(np.uint8)
    outlines, _ = cv2.findContours(inside, cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    return np.asarray(cv2.drawContours(image, outlines, -1, MIDDLE, 1, cv2.LINE_AA), np.uint8)
