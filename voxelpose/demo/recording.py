"""Writes the demo's recording folder, as if it had been filmed."""

import json
from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.files import write_rig
from silhouette_core.body.joints import LANDMARK_NAMES
from voxelpose.demo.choreography import pose_at
from voxelpose.demo.mannequin import STATURE_M, Mannequin
from voxelpose.demo.scene import SIZE, View, demo_rig

FPS = 20
_EMPTY_FRAMES = 24


def make_recording(folder: Path | str, frames: int = 60, seed: int = 0) -> Path:
    """Makes a recording of the mannequin, with videos, empty backgrounds, calibration, subject and exact truth.

    Args:
        folder: where to write; made if absent.
        frames: how many frames at 20 per second; 60 are the whole performance.
        seed: of the sensor noise.

    Returns:
        The folder. `truth.json` in it holds the 15 joints of every frame.

    Raises:
        InputError: a video cannot be written there.
        ValueError: no frame asked for.
    """
    if frames < 1:
        raise ValueError(f"frames must be at least 1, got {frames}")
    folder = Path(folder)
    (folder / "background").mkdir(parents=True, exist_ok=True)
    rig, actor = demo_rig(), Mannequin.build()
    write_rig(rig, folder / "calibration.toml")
    (folder / "subject.toml").write_text(f'stature = {STATURE_M}\nsex = "male"\n', encoding="utf-8")
    poses = [actor.pose(*pose_at(frame / FPS)) for frame in range(frames)]
    for k, camera in enumerate(rig):
        view = View(camera, np.random.default_rng((seed, k)))
        _write_video(folder / "background" / f"{camera.name}.mp4", (view.empty() for _ in range(_EMPTY_FRAMES)))
        _write_video(folder / f"{camera.name}.mp4", (view.picture(v, actor.faces, actor.face_colour) for v, _ in poses))
    truth = {name: [joints[name].round(5).tolist() for _, joints in poses] for name in LANDMARK_NAMES}
    about = {"fps": FPS, "unit": "m", "up": "z", "stature": STATURE_M, "joints": truth}
    (folder / "truth.json").write_text(json.dumps(about), encoding="utf-8")
    return folder


def _write_video(path: Path, pictures: Iterable[NDArray[np.uint8]]) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), FPS, SIZE)
    if not writer.isOpened():
        raise InputError(f"{path} cannot be written: check the folder and `voxelpose doctor` for the video encoder")
    try:
        for picture in pictures:
            writer.write(picture)
    finally:
        writer.release()
