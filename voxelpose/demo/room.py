"""The demo's room and cameras: textured floor and walls, daylight, a cast shadow, sensor noise;
and the recording folders that are filmed there.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.files import write_rig
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.raster import render_parts
from voxelpose.demo import demo_table
from voxelpose.demo.choreography import performances
from voxelpose.demo.mannequin import COLOURS_BGR, Mannequin
from voxelpose.recording.truth import TRUTH, write_truth

SIZE = (640, 480)
_SUPERSAMPLING = 2  # outlines of a real picture are soft
_SHADES = 50  # brightness steps per colour: with 5 colours the part image still fits 8 bits
_MARGIN = (32, 24)  # what a barrel lens sees beyond the pinhole picture, px on every side
_ROOM_M = 5  # half length and half width of the floor

_EMPTY_FRAMES = 24


def demo_rig(count: int = 4) -> Rig:
    """Cameras with a slight barrel distortion: four on a half circle, up to four behind."""
    cameras = []
    for k, (azimuth, distance_cm, height_cm) in enumerate(demo_table("room")["positions"][:count]):
        turn, distance = np.radians(azimuth), distance_cm / 100
        centre = np.array([distance * np.sin(turn), -distance * np.cos(turn), height_cm / 100])
        forward = np.array([0, 0, 0.92]) - centre
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, (0, 0, 1))
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        matrix = np.array([[570.0 + 6 * k, 0, 318.0 + k], [0, 570.0 + 6 * k, 241.5 - k], [0, 0, 1]])
        distortion = np.array([-0.06, 0.015, 0.0, 0.0, 0.0])
        cameras.append(
            Camera(f"cam_{k + 1}", SIZE, matrix, distortion, rotation, -rotation @ centre)
        )
    return Rig(tuple(cameras))


class FilmCamera:
    """One camera's view of the room."""

    def __init__(
        self,
        camera: Camera,
        rng: np.random.Generator,
        colours_bgr: NDArray[np.float64] = COLOURS_BGR,
        shadow: float = 0.38,
    ) -> None:
        """Paints the empty room.

        Args:
            camera: as calibrated; pictures are drawn without distortion and then distorted.
            colours_bgr: (5, 3) of skin, hair, shirt, trousers, shoes.
            shadow: share of the light that the actor keeps from the floor.
        """
        self._wide = _with_margin(camera)
        self._maps = _distortion_maps(camera)
        # The same seed for all cameras: it is one room.
        self._room, self._floor = _paint_room(self._wide, np.random.default_rng(11))
        self._rng = rng
        self._colours_bgr, self._shadow = colours_bgr, shadow
        toward_window = np.array([0.35, -0.45, 0.82])
        self._light = toward_window / np.linalg.norm(toward_window)
        self._noise = rng.normal(0, 2.2, (SIZE[1] + 64, SIZE[0] + 64, 3)).astype(np.float32)

    def empty(self) -> NDArray[np.uint8]:
        """Picture (480, 640, 3) uint8 BGR of the room without the actor."""
        return self._expose(self._room)

    def picture(
        self,
        vertices_m: NDArray[np.float64],
        faces: NDArray[np.int32],
        face_colour: NDArray[np.int32],
    ) -> NDArray[np.uint8]:
        """Picture of the actor in the room.

        Args:
            face_colour: (F,) index into `COLOURS_BGR`.

        Returns:
            (480, 640, 3) uint8 BGR.
        """
        corners = vertices_m[faces]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        light = 0.45 + 0.55 * np.maximum(normals @ self._light, 0) + 0.10 * normals[:, 2]
        shade = np.clip(np.rint((light - 0.3) * (_SHADES - 1)), 0, _SHADES - 1).astype(np.int32)
        palette = (
            self._colours_bgr[:, None] * (0.3 + np.arange(_SHADES) / (_SHADES - 1))[:, None]
        ).reshape(-1, 3)
        palette = np.vstack([np.zeros(3), palette]).clip(0, 255).astype(np.float32)
        flat = vertices_m - vertices_m[:, 2:] / self._light[2] * self._light
        window = self._window(np.vstack([vertices_m, flat]))
        labels = self._draw(vertices_m, faces, face_colour * _SHADES + shade, window)
        shadow = self._draw(flat, faces, np.zeros(len(faces), np.int32), window)
        left, top, right, bottom = window
        size = (right - left, bottom - top)
        actor = cv2.resize(palette[labels], size, interpolation=cv2.INTER_AREA)
        cover = cv2.resize((labels > 0).astype(np.float32), size, interpolation=cv2.INTER_AREA)[
            ..., None
        ]
        dark = cv2.GaussianBlur(
            cv2.resize((shadow > 0).astype(np.float32), size, interpolation=cv2.INTER_AREA),
            (0, 0),
            2.0,
        )
        light = self._room.copy()
        room, floor = (image[top:bottom, left:right] for image in (self._room, self._floor))
        light[top:bottom, left:right] = (
            room * (1 - self._shadow * dark[..., None] * floor) * (1 - cover) + actor
        )
        return self._expose(light)

    def _window(self, points_m: NDArray[np.float64]) -> tuple[int, int, int, int]:
        """Left, top, right and bottom of the pixels that points and their soft shadow touch."""
        pixels, _ = self._wide.project(points_m)
        width, height = self._wide.size
        low = np.clip(np.floor(np.nanmin(pixels, axis=0)) - 8, 0, (width - 2, height - 2)).astype(
            int
        )
        high = np.clip(np.ceil(np.nanmax(pixels, axis=0)) + 9, low + 1, (width, height)).astype(int)
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _draw(
        self,
        points_m: NDArray[np.float64],
        faces: NDArray[np.int32],
        labels: NDArray[np.int32],
        window: tuple[int, int, int, int],
    ) -> NDArray[np.uint8]:
        inside = points_m @ self._wide.rotation.T + self._wide.translation
        left, top, right, bottom = window
        shift = np.array([[1, 0, -left], [0, 1, -top], [0, 0, 1.0]])
        half = 0.5 * (_SUPERSAMPLING - 1)  # pixel centres are integers
        scale = np.array([[_SUPERSAMPLING, 0, half], [0, _SUPERSAMPLING, half], [0, 0, 1.0]])
        size = ((right - left) * _SUPERSAMPLING, (bottom - top) * _SUPERSAMPLING)
        return render_parts(inside, faces, labels, scale @ shift @ self._wide.matrix, size)[0]

    def _expose(self, light: NDArray[np.float32]) -> NDArray[np.uint8]:
        """Distorts a picture as the lens does and adds noise and a little flicker."""
        picture = cv2.remap(light, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        row, column = self._rng.integers(0, 64, 2)
        picture *= 1 + self._rng.normal(0, 0.004)
        picture += self._noise[row : row + SIZE[1], column : column + SIZE[0]]
        return picture.clip(0, 255).astype(np.uint8)


def _with_margin(camera: Camera) -> Camera:
    wide = camera.pinhole()
    shift = np.array([[1, 0, _MARGIN[0]], [0, 1, _MARGIN[1]], [0, 0, 1.0]])
    return replace(
        wide, size=(SIZE[0] + 2 * _MARGIN[0], SIZE[1] + 2 * _MARGIN[1]), matrix=shift @ wide.matrix
    )


def _distortion_maps(camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Position of each recorded pixel in the widened pinhole picture, for `cv2.remap`."""
    x, y = np.meshgrid(np.arange(SIZE[0], dtype=float), np.arange(SIZE[1], dtype=float))
    ideal = camera.undistort(np.column_stack([x.ravel(), y.ravel()])) + _MARGIN
    maps = ideal.astype(np.float32).reshape(SIZE[1], SIZE[0], 2)
    return np.ascontiguousarray(maps[..., 0]), np.ascontiguousarray(maps[..., 1])


def _paint_room(
    camera: Camera, rng: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Light (h, w, 3) of the empty room at a pinhole camera, and 1 on the floor (h, w, 1)."""
    width, height = camera.size
    x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    centre, direction = camera.rays(np.column_stack([x.ravel(), y.ravel()]))
    with np.errstate(divide="ignore"):
        to_floor = np.where(direction[:, 2] < 0, -centre[2] / direction[:, 2], np.inf)
        to_wall = (np.sign(direction[:, :2]) * _ROOM_M - centre[:2]) / direction[:, :2]
    distance = np.minimum(to_floor, to_wall.min(1))
    on_floor = to_floor <= to_wall.min(1)
    point = centre + distance[:, None] * direction
    along = np.where(to_wall[:, 0] < to_wall[:, 1], point[:, 1], point[:, 0])
    grain = cv2.GaussianBlur(rng.normal(0, 1, (512, 512)).astype(np.float32), (0, 0), 5) * 12

    def cloud(u: NDArray[np.float64], v: NDArray[np.float64]) -> NDArray[np.float32]:
        return grain[np.floor(v * 64).astype(int) % 512, np.floor(u * 64).astype(int) % 512]

    board = np.floor(point[:, 0] / 0.18)
    seam = np.minimum(np.mod(point[:, 0], 0.18), 0.18 - np.mod(point[:, 0], 0.18)) < 0.006
    wood = (
        1
        + 0.10 * np.sin(board * 12.9898)
        + 0.05 * cloud(point[:, 0] * 2, point[:, 1] * 0.3)
        - 0.25 * np.clip(1.4 - distance / 4, 0, 1) * seam
    )
    panel = (
        1
        - 0.10 * (np.mod(along, 1.2) < 0.02)
        + 0.03 * cloud(along, point[:, 2])
        + 0.05 * np.sign(np.sin(along * 1.7))
    )
    skirting = np.where(point[:, 2] < 0.12, 0.72, 1.0)
    floor = np.array([116.0, 130, 121]) * wood[:, None]
    wall = np.array([196.0, 190, 176]) * (panel * skirting)[:, None]
    # Brighter toward the window.
    fall_off = 1 - 0.035 * np.linalg.norm(point[:, :2] - (1.5, -2.0), axis=1)
    light = np.where(on_floor[:, None], floor, wall) * fall_off[:, None]
    light, floor = light.reshape(height, width, 3), on_floor.reshape(height, width, 1)
    return light.astype(np.float32), floor.astype(np.float32)


def make_recording(
    folder: Path | str,
    frames: int | None = None,
    seed: int = 0,
    performance: str = "three_seconds",
    cameras: Sequence[str] | None = None,
    actor: Mannequin | None = None,
) -> Path:
    """Renders a recording: videos, empty backgrounds, calibration, subject and exact truth.
    InputError where a video cannot be written there; ValueError for fewer than one frame, or an
    unknown performance or camera.

    Args:
        folder: where to write; made if absent.
        frames: number of frames, at the performance's rate; beyond its end the performance
            repeats. None: the whole performance.
        seed: of the sensor noise.
        performance: a name of performances.toml, or "walk".
        cameras: names of those that film, of cam_1 to cam_8; None: the performance's own.
        actor: who performs; None: the standard mannequin, 1.68 m tall.

    Returns:
        The folder. Its `truth.json` holds the 15 joints of every frame.
    """
    known = performances()
    if performance not in known:
        raise ValueError(f"there is no performance {performance!r}: {', '.join(known)}")
    played = known[performance]
    frames = played.frames if frames is None else frames
    if frames < 1:
        raise ValueError(f"frames must be at least 1, got {frames}")
    chosen = played.cameras if cameras is None else tuple(cameras)
    numbers = {camera.name: k for k, camera in enumerate(demo_rig(8))}
    if not chosen or not set(chosen) <= set(numbers):
        raise ValueError(
            f"cameras must be some of {', '.join(numbers)}, got {', '.join(chosen) or 'none'}"
        )
    folder = Path(folder)
    (folder / "background").mkdir(parents=True, exist_ok=True)
    rig = Rig(tuple(camera for camera in demo_rig(8) if camera.name in chosen))
    write_rig(rig, folder / "calibration.toml")
    sex = 'sex = "male"\n' if actor is None else ""
    actor = actor or Mannequin.build()
    subject = f"stature = {actor.stature_m}\n{sex}"
    (folder / "subject.toml").write_text(subject, encoding="utf-8")
    poses = [actor.pose(*played.pose_at(frame / played.fps)) for frame in range(frames)]
    for camera in rig:
        view = FilmCamera(camera, np.random.default_rng((seed, numbers[camera.name])))
        write_video(
            folder / "background" / f"{camera.name}.mp4",
            played.fps,
            (view.empty() for _ in range(_EMPTY_FRAMES)),
        )
        write_video(
            folder / f"{camera.name}.mp4",
            played.fps,
            (view.picture(v, actor.faces, actor.face_colour) for v, _ in poses),
        )
    joints_m = np.array([[joints[name] for name in LANDMARK_NAMES] for _, joints in poses])
    write_truth(folder / TRUTH, joints_m, played.fps, actor.stature_m)
    return folder


def write_video(path: Path, fps: int, pictures: Iterable[NDArray[np.uint8]]) -> None:
    """Writes pictures (480, 640, 3) uint8 BGR as a video. InputError where it cannot be written
    there.
    """
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), fps, SIZE)
    if not writer.isOpened():
        raise InputError(
            f"{path} cannot be written: check the folder and `voxelpose doctor` for the video"
            " encoder"
        )
    try:
        for picture in pictures:
            writer.write(picture)
    finally:
        writer.release()
