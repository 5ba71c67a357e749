"""Writer of rendered recording folders."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from calib.files import write_rig
from silhouette_core.body.joints import LANDMARK_NAMES
from voxelpose.demo.choreography import performances
from voxelpose.demo.mannequin import STATURE_M, Mannequin
from voxelpose.demo.measurements import Measurements, tailor
from voxelpose.demo.room import SIZE, FilmCamera, demo_rig
from voxelpose.recording.truth import TRUTH, write_truth

_EMPTY_FRAMES = 24


def make_recording(
    folder: Path | str,
    frames: int | None = None,
    seed: int = 0,
    performance: str = "three_seconds",
    cameras: Sequence[str] | None = None,
    person: Measurements | None = None,
) -> Path:
    """Renders a recording: videos, empty backgrounds, calibration, subject and exact truth.

    Args:
        folder: where to write; made if absent.
        frames: number of frames, at the performance's rate; beyond its end the performance
            repeats. None: the whole performance.
        seed: of the sensor noise.
        performance: a name of performances.toml, or "walk".
        cameras: names of those that film, of cam_1 to cam_8; None: the performance's own.
        person: measurements of the actor; None: the standard mannequin, 1.68 m tall.

    Returns:
        The folder. Its `truth.json` holds the 15 joints of every frame.

    Raises:
        InputError: a video cannot be written there.
        ValueError: fewer than one frame, or an unknown performance or camera.
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
    actor = Mannequin.build() if person is None else tailor(person)
    stature = STATURE_M if person is None else person.stature_m
    write_rig(rig, folder / "calibration.toml")
    subject = f"stature = {stature}\n" + ('sex = "male"\n' if person is None else "")
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
    write_truth(folder / TRUTH, joints_m, played.fps, stature)
    return folder


def write_video(path: Path, fps: int, pictures: Iterable[NDArray[np.uint8]]) -> None:
    """Writes pictures (480, 640, 3) uint8 BGR as a video.

    Raises:
        InputError: it cannot be written there.
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
