"""Pictures and videos of hull and skeleton; they need no screen."""

from pathlib import Path

import numpy as np

from calib.atomic import replacing, write_whole
from calib.errors import InputError
from silhouette_core.progress import Reporter
from voxelpose.view.images.canvas import FAINT, png, write_text
from voxelpose.view.images.figure import bone_ends
from voxelpose.view.images.hull_picture import SIZE, Skeleton, hull_picture
from voxelpose.view.images.webm import WebmWriter
from voxelpose.view.viewer.result_scenes import ResultScenes
from voxelpose.view.viewer.scene import Scene


def skeleton_of(scene: Scene) -> Skeleton | None:
    """The fitted skeleton of a scene; None where there is no pose."""
    if scene.body is None:
        return None
    return Skeleton(scene.body.joints_m, bone_ends(scene.body.bones))


def write_picture(scenes: ResultScenes, frame: int, path: Path) -> float:
    """Writes hull and skeleton of one frame, from four sides, as PNG; returns the hull's volume,
    litres.

    Raises:
        InputError: there is no hull to show, or the file cannot be written.
    """
    scene = scenes.scene(frame)
    if scene.hull is None:
        raise InputError(f"frame {frame} has no hull: {'; '.join(scene.notes)}")
    picture = hull_picture(scene.hull.grid, scene.hull.occupancy, skeleton_of(scene))
    write_whole(path, png(picture))
    return scene.hull.litres(scene.hull.occupancy)


def write_film(scenes: ResultScenes, path: Path, reporter: Reporter) -> int:
    """Writes hull and skeleton of all frames, from three sides that follow the person, as WebM;
    returns the number of frames written: those without a hull are left out.

    Raises:
        InputError: there is nothing to show, or the file cannot be written.
    """
    motion = scenes.motion
    if motion is None:
        raise InputError(
            f"{scenes.title} is a recording without a fit: --video wants a result; --png shows one"
            " frame's hull"
        )
    reach = motion.landmarks() - motion.root_m[:, None]
    margin_m = 0.12  # around the joints: flesh, and the excess of the hull
    low, high = reach.min((0, 1)) - margin_m, reach.max((0, 1)) + margin_m
    if path.suffix != ".webm":
        raise InputError(f"{path} must end in .webm: that is the format of the video")
    sides = (-90, -30, 30)
    reporter.stage("film", len(scenes.frames))
    with replacing(path) as partial:
        writer = WebmWriter(partial, scenes.fps, (len(sides) * SIZE[0], SIZE[1]))
        try:
            for frame in scenes.frames.tolist():
                scene = scenes.scene(frame)
                if scene.hull is not None:
                    middle = motion.root_m[np.abs(motion.frames - frame).argmin()]
                    box_m, hull = (middle + low, middle + high), scene.hull
                    picture = hull_picture(
                        hull.grid, hull.occupancy, skeleton_of(scene), sides, box_m
                    )
                    caption = f"frame {frame} · {scene.time_s:.2f} s"
                    write_text(picture, caption, 16, picture.shape[0] - 16, 18, FAINT)
                    writer.write(picture)
                reporter.advance()
            if not writer.frames:
                raise InputError(
                    "no frame has a hull: look at the silhouettes with `voxelpose carve`"
                )
            writer.close()
        finally:
            writer.release()
    return writer.frames
