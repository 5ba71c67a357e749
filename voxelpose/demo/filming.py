"""Writes the demo's recording folder, as if it had been filmed."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from calib.files import write_rig
from silhouette_core.body.joints import LANDMARK_NAMES
from voxelpose.demo.choreography import PERFORMANCES
from voxelpose.demo.mannequin import STATURE_M, Mannequin
from voxelpose.demo.scene import SIZE, FilmCamera, demo_rig

_EMPTY_FRAMES = 24


def make_recording(
    folder: Path | str,
    frames: int | None = None,
    seed: int = 0,
    performance: str = "three_seconds",
    cameras: Sequence[str] | None = None,
) -> Path:
    """Makes a recording of the mannequin, with videos, empty backgrounds, calibration, subject and
    exact truth.

    Args: folder: where to write; made if absent. frames: how many frames, at the performance's
        rate; None means the whole performance, which then repeats. seed: of the sensor noise.
        performance: a name of `choreography.PERFORMANCES`: "three_seconds", "arm_swing", "golf",
        "pointing" or "far_arm_swing". cameras: those that film; None takes the performance's own,
        four or one.

    Returns:
        The folder. `truth.json` in it holds the 15 joints of every frame.

    Raises:
        InputError: a video cannot be written there.
        ValueError: no frame asked for, or a performance or camera that there is not.
    """
    if performance not in PERFORMANCES:
        raise ValueError(f"there is no performance {performance!r}: {', '.join(PERFORMANCES)}")
    played = PERFORMANCES[performance]
    frames = played.frames if frames is None else frames
    if frames < 1:
        raise ValueError(f"frames must be at least 1, got {frames}")
    wanted = played.cameras if cameras is None else tuple(cameras)
    numbers = {camera.name: k for k, camera in enumerate(demo_rig())}
    if not wanted or not set(wanted) <= set(numbers):
        raise ValueError(
            f"cameras must be some of {', '.join(numbers)}, got {', '.join(wanted) or 'none'}"
        )
    folder = Path(folder)
    (folder / "background").mkdir(parents=True, exist_ok=True)
    rig, actor = (
        Rig(tuple(camera for camera in demo_rig() if camera.name in wanted)),
        Mannequin.build(),
    )
    write_rig(rig, folder / "calibration.toml")
    (folder / "subject.toml").write_text(f'stature = {STATURE_M}\nsex = "male"\n', encoding="utf-8")
    poses = [actor.pose(*played.pose_at(frame / played.fps)) for frame in range(frames)]
    for camera in rig:
        view = FilmCamera(camera, np.random.default_rng((seed, numbers[camera.name])))
        _write_video(
            folder / "background" / f"{camera.name}.mp4",
            played.fps,
            (view.empty() for _ in range(_EMPTY_FRAMES)),
        )
        _write_video(
            folder / f"{camera.name}.mp4",
            played.fps,
            (view.picture(v, actor.faces, actor.face_colour) for v, _ in poses),
        )
    truth = {
        name: [joints[name].round(5).tolist() for _, joints in poses] for name in LANDMARK_NAMES
    }
    about = {"fps": played.fps, "unit": "m", "up": "z", "stature": STATURE_M, "joints": truth}
    (folder / "truth.json").write_text(json.dumps(about), encoding="utf-8")
    return folder


def _write_video(path: Path, fps: int, pictures: Iterable[NDArray[np.uint8]]) -> None:
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
