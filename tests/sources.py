"""Small sources of frames for tests: grey pictures of any rig, in memory or in a folder."""

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from benchmarks.board_scene import looking_at
from calib.camera import Camera, Rig
from calib.files import write_rig
from calib.rotation import matrix_from_rodrigues
from silhouette_core.estimator import GROUP
from silhouette_core.image.raster import render_parts
from silhouette_core.motion import kinematics
from silhouette_core.motion.motion import Motion


def ring(
    count: int = 3, size: tuple[int, int] = (160, 120), distortion: tuple[float, ...] = ()
) -> Rig:
    """Cameras on a half circle of 4 m around a person, at 1.4 m height, looking at 1 m height."""
    cameras = []
    for number in range(count):
        angle = np.pi * number / count
        center = np.array([4 * np.sin(angle), -4 * np.cos(angle), 1.4])
        focal = 1.1 * size[1]
        x, y = (size[0] - 1) / 2, (size[1] - 1) / 2
        matrix = np.array([[focal, 0, x], [0, focal, y], [0, 0, 1.0]])
        ahead = np.array([0, 0, 1.0])
        cameras.append(looking_at(f"cam_{number + 1}", center, ahead, matrix, size, distortion))
    return Rig(tuple(cameras))


@dataclass
class GreySource:
    """Frames without anything on them."""

    rig: Rig
    frame_count: int
    fps: float = 25.0
    silhouettes_given: bool = False
    grey: int = 90

    def backgrounds(self) -> dict:
        return {}

    def regions(self) -> dict:
        return {}

    def unknown(self) -> dict:
        return {}

    def at(self, steps: Sequence[int]) -> Iterator[dict[str, np.ndarray]]:
        for _ in steps:
            yield {
                c.name: np.full((c.size[1], c.size[0], 3), self.grey, np.uint8) for c in self.rig
            }

    def __iter__(self) -> Iterator[tuple[int, float, dict[str, np.ndarray]]]:
        for frame, frames in enumerate(self.at(range(self.frame_count))):
            yield frame, frame / self.fps, frames


def write_film(
    path: Path, pictures: Iterable[np.ndarray], fps: float = 25.0, code: str = "MJPG"
) -> Path:
    """Writes BGR pictures of one size as a video; makes its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    first, *others = pictures
    size = first.shape[1::-1]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*code), fps, size)
    assert writer.isOpened()
    for picture in (first, *others):
        writer.write(picture)
    writer.release()
    return path


def write_recording(folder: Path, rig: Rig, frame_count: int = 6, fps: float = 25.0) -> Path:
    """Writes a recording of empty grey videos."""
    folder.mkdir(parents=True)
    write_rig(rig, folder / "calibration.toml")
    for camera in rig:
        grey = np.full((camera.size[1], camera.size[0], 3), 90, np.uint8)
        write_film(folder / f"{camera.name}.mp4", [grey] * frame_count, fps, "mp4v")
    return folder


def write_staged(folder: Path, motion: Motion, rig: Rig, *others: Motion) -> Path:
    """Writes a recording of a posed body, or of some, before an empty room: lossless videos
    (JPEG-LS: whether FFV1 holds an opacity is looked for, which takes long), backgrounds and
    calibration. It lasts as long as the first one's motion.
    """
    (folder / "background").mkdir(parents=True)
    write_rig(rig, folder / "calibration.toml")
    bodies = [(one, *one.parts()) for one in (motion, *others)]
    for camera in rig:
        room = np.full((camera.size[1], camera.size[0], 3), (70, 60, 50), np.uint8)
        cv2.imwrite(str(folder / "background" / f"{camera.name}.png"), room)
        pictures = []
        for frame in motion.frames:
            picture = room
            for one, rotation, origin in bodies:
                for row in np.flatnonzero(one.frames == frame):
                    skin = kinematics.skin(one.model, rotation[row], origin[row])
                    mesh = one.model.faces, one.model.face_part
                    seen = skin @ camera.rotation.T + camera.translation
                    parts, _ = render_parts(seen, *mesh, camera.matrix, camera.size)
                    colour = np.array([90, 160, 230], np.uint8)
                    picture = np.where(parts[..., None] > 0, colour, picture)
            pictures.append(picture)
        write_film(folder / f"{camera.name}.mkv", pictures, motion.fps, "MJLS")
    return folder


_BALLS = (
    *((0, 0, 1.6, 0.13), (0, 0, 1.3, 0.17), (0, 0, 1.0, 0.16)),
    *((0.35, 0.1, 1.2, 0.07), (-0.3, -0.1, 0.95, 0.07)),
    *((0.12, 0.25, 0.1, 0.09), (-0.12, -0.2, 0.1, 0.09)),
    *((0.12, 0.1, 0.5, 0.09), (-0.12, -0.1, 0.5, 0.09)),
)


def turned(rig: Rig, name: str, degrees: float) -> Rig:
    """A rig in which somebody has bumped a camera."""
    turn = matrix_from_rodrigues(np.radians(degrees) * np.array([0.8, 0.6, 0]))
    bumped = replace(
        rig[name], rotation=turn @ rig[name].rotation, translation=turn @ rig[name].translation
    )
    return Rig(tuple(bumped if camera.name == name else camera for camera in rig))


def figure_masks(camera: Camera, moments: Iterable[float]) -> list[np.ndarray]:
    """Silhouettes of a figure of balls that walks, turns and nods; a moment is a frame, or between
    two.
    """
    masks = []
    for moment in moments:
        mask = np.zeros(camera.size[::-1], np.uint8)
        turn, swing = 0.12 * moment, np.sin(0.45 * moment)
        for x, y, z, radius in _BALLS:
            y = y * (swing if z < 0.8 else 1.0)
            across = np.cos(turn) * x - np.sin(turn) * y
            along = np.sin(turn) * x + np.cos(turn) * y + 0.03 * moment - 0.4
            place = np.array([[across, along, z * (1 + 0.05 * swing)]])
            (pixel,), (depth,) = camera.project(place)
            # Sixteenths of a pixel, or whole frames would look alike.
            middle = tuple(int(v) for v in np.round(pixel * 16))
            reach = int(16 * camera.matrix[0, 0] * radius / depth)
            cv2.circle(mask, middle, reach, 255, cv2.FILLED, cv2.LINE_8, 4)
        masks.append(mask)
    return masks


def write_figure(
    folder: Path, rig: Rig, films: dict[str, list[np.ndarray]], fps: float = 25.0
) -> Path:
    """Writes silhouettes as a recording of black and white videos, each with a black background
    still.
    """
    write_rig(rig, folder / "calibration.toml")
    (folder / "background").mkdir()
    for name, film in films.items():
        pictures = (cv2.cvtColor(mask, cv2.COLOR_GRAY2BGR) for mask in film)
        write_film(folder / f"{name}.avi", pictures, fps)
        cv2.imwrite(str(folder / "background" / f"{name}.png"), np.zeros_like(film[0]))
    return folder


_OUTSIDE = """
import time
import numpy as np
from silhouette_core.estimator import Estimate
from tests.clips import waving, waving_couple

class Standing:
    name = "standing"

    def estimate(self, source, settings, reporter):
        reporter.stage("standing about", source.frame_count)
        for frame, _, _ in source:
            if settings.options.get("voxel_size_m") == 0.09:
                time.sleep(1)
            reporter.advance()
        if settings.options.get("voxel_size_m") == 0.08:
            raise RuntimeError("a bug")
        motion = waving(source.frame_count, settings.stature_m or 1.7, source.fps)
        stage_s = {"standing": np.full(source.frame_count, 0.002)}
        return Estimate(motion.select(np.arange(1, len(motion))), stage_s, {"tried": np.arange(2)})

    def estimate_people(self, source, settings, reporter, people):
        if people in (None, 1):
            return [self.estimate(source, settings, reporter)]
        motions = waving_couple(source.frame_count, source.fps)
        return [Estimate(motion, {"standing": np.full(4, 0.002)}, {}) for motion in motions]
"""


def open_desk(desk: Path, patch: pytest.MonkeyPatch) -> Path:
    """Makes a folder the current one, and installs beside it (in site/) an estimator of somebody
    else, named "standing"; it loses the first frame. Where two people are asked for, they are
    `tests.clips.waving_couple`.
    """
    folder = desk / "site"
    folder.mkdir()
    (folder / "standing_estimator.py").write_text(_OUTSIDE)
    metadata = folder / "standing_estimator-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: standing-estimator\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(
        f"[{GROUP}]\nstanding = standing_estimator:Standing\n"
    )
    patch.syspath_prepend(str(folder))
    patch.delitem(sys.modules, "standing_estimator", raising=False)
    patch.chdir(desk)
    return desk
