"""Pictures and a video of hull and skeleton, without a screen."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.progress import Reporter
from voxelpose.view.images.canvas import FAINT, write_text
from voxelpose.view.images.figure import skeleton_bones
from voxelpose.view.images.hull_picture import Skeleton, hull_picture
from voxelpose.view.images.overlay import check_video
from voxelpose.view.viewer.result_scenes import ResultScenes, Scene

_MARGIN_M = 0.12  # around the joints: flesh, and what a hull has too much
_AZIMUTHS_DEG = (-90.0, -30.0, 30.0)
_CODEC = "mp4v"  # as the overlays: every OpenCV wheel writes it


def skeleton_of(scene: Scene) -> Skeleton | None:
    """Returns the fitted skeleton of a scene."""
    return (
        None
        if scene.body is None
        else Skeleton(scene.body.joints_m, np.array([bone[:2] for bone in skeleton_bones()]))
    )


def write_picture(scenes: ResultScenes, frame: int, path: Path) -> float:
    """Writes hull and skeleton of one frame, from four sides, as PNG.

    Returns:
        The hull's volume, litres.

    Raises:
        InputError: there is no hull to show, or the file cannot be written.
    """
    scene = scenes.scene(frame)
    if scene.hull is None:
        raise InputError(f"frame {frame} has no hull: {'; '.join(scene.notes)}")
    good, data = cv2.imencode(
        ".png", hull_picture(scene.hull.grid, scene.hull.occupancy, skeleton_of(scene))
    )
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_bytes(data.tobytes() if good else b"")
        beside.replace(path)
    except OSError as error:
        beside.unlink(missing_ok=True)
        raise InputError(f"{path} cannot be written: {error.strerror}") from error
    return 1000 * float(np.count_nonzero(scene.hull.occupancy)) * scene.hull.grid.voxel_size_m**3


def write_film(scenes: ResultScenes, path: Path, reporter: Reporter) -> int:
    """Writes hull and skeleton of all frames, from three sides that walk along with the person, as
    MPEG-4.

    Returns:
        How many frames it holds: those without a hull are left out.

    Raises:
        InputError: there is nothing to show, or the file cannot be written.
    """
    motion = scenes.motion
    if motion is None:
        raise InputError(
            f"{scenes.title} is a recording without a fit: --mp4 wants a result; --png shows one"
            " frame's hull"
        )
    reach = motion.landmarks() - motion.root_m[:, None]
    low, high = reach.min((0, 1)) - _MARGIN_M, reach.max((0, 1)) + _MARGIN_M
    beside = path.with_name(f".{path.stem}.{os.getpid()}.mp4")
    writer, count = None, 0
    reporter.stage("film", len(scenes.frames))
    try:
        for frame in scenes.frames.tolist():
            scene = scenes.scene(frame)
            if scenes.recording is None:
                raise InputError(scenes.missing)
            if scene.hull is not None:
                middle = motion.root_m[np.abs(motion.frames - frame).argmin()]
                picture = _page(scene, (middle + low, middle + high))
                if writer is None:
                    writer = cv2.VideoWriter(
                        str(beside),
                        cv2.VideoWriter.fourcc(*_CODEC),
                        scenes.fps,
                        picture.shape[1::-1],
                    )
                writer.write(picture)
                count += 1
            reporter.advance()
        if writer is None:
            raise InputError("no frame has a hull: look at the silhouettes with `voxelpose carve`")
        writer.release()
        check_video(beside, count)
        beside.replace(path)
    except OSError as error:
        raise InputError(f"{path} cannot be written: {error.strerror}") from error
    finally:
        beside.unlink(missing_ok=True)
    return count


def _page(
    scene: Scene, box_m: tuple[NDArray[np.float64], NDArray[np.float64]]
) -> NDArray[np.uint8]:
    if scene.hull is None:
        raise ValueError("a page needs a hull")
    picture = hull_picture(
        scene.hull.grid, scene.hull.occupancy, skeleton_of(scene), _AZIMUTHS_DEG, box_m=box_m
    )
    write_text(
        picture, f"frame {scene.frame} · {scene.time_s:.2f} s", 16, picture.shape[0] - 16, 18, FAINT
    )
    return picture
