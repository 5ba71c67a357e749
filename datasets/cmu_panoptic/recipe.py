"""CMU Panoptic's HD cameras: hdVideos, calibration_NAME.json, hdPose3d_stage1_coco19."""

import argparse
from collections import Counter
from pathlib import Path

import numpy as np
from clip import (
    Camera,
    CameraView,
    Clip,
    FrameReader,
    InputError,
    find_frames,
    number_in,
    open_frames,
    read_json,
    read_json_cameras,
    select_names,
    to_world_z_up,
    z_up_from,
)
from truth import drop_uncertain, from_keypoints

SUMMARY = "CMU Panoptic Studio: 31 HD cameras, one or several people, markerless truth."

_FPS = 30000 / 1001
_CM = 0.01
_LIMBS = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
# coco19: neck, nose, centre of the hips, then the limbs, left before right, then eyes and ears.
_PLACES = {"neck": 0, "pelvis": 2, "left_ear": 16, "right_ear": 18} | {
    f"{side}_{joint}": first + number
    for side, first in (("left", 3), ("right", 9))
    for number, joint in enumerate(_LIMBS)
}


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that choose a person."""
    group.add_argument(
        "--person", type=int, metavar="ID", help="whose joints, where several people are there"
    )
    group.add_argument(
        "--least-confidence",
        type=float,
        default=0.1,
        help="joints below it are unknown (default 0.1)",
    )


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a clip.

    Raises:
        InputError: something is missing or cannot be read.
    """
    file = _calibration(source)
    cameras = _read_cameras(file)
    paths = {name: path for name in cameras if (path := _frames(source, name)) is not None}
    names = select_names(paths, options.cameras, "HD camera", source)
    views = tuple(
        CameraView(to_world_z_up(cameras[n], "-y", _CM), open_frames(paths[n])) for n in names
    )
    first = _first_number(views[0].frames)
    if any(_first_number(view.frames) != first for view in views):
        raise InputError(
            f"{source}: the images of the cameras begin at different frames: extract all alike"
        )
    notes = {"clip": file.stem.removeprefix("calibration_")}
    if options.no_truth:
        return Clip(views, _FPS, notes=notes)
    count = min(view.frames.frame_count for view in views)
    points = _read_bodies(
        source, range(first, first + count), options.person, options.least_confidence
    )
    truth, constructed = from_keypoints(_CM * points @ z_up_from("-y").T, _PLACES)
    return Clip(views, _FPS, truth, constructed, notes=notes)


def _calibration(source: Path) -> Path:
    files = sorted(source.glob("calibration_*.json"))
    if len(files) != 1:
        raise InputError(
            f"{source} holds {len(files) or 'no'} calibration_*.json: "
            "give the folder of one sequence"
        )
    return files[0]


def _read_cameras(file: Path) -> dict[str, Camera]:
    """Returns the HD cameras: X_camera = R X + t, t in cm."""
    return read_json_cameras(
        file,
        "calibration of the Panoptic Studio",
        {
            "size": "resolution",
            "matrix": "K",
            "distortion": "distCoef",
            "rotation": "R",
            "translation": "t",
        },
        lambda content: [camera for camera in content["cameras"] if camera["type"] == "hd"],
    )


def _frames(source: Path, name: str) -> Path | None:
    """Returns a camera's video, or the folder of images extracted from it."""
    return find_frames(source / "hdVideos" / f"hd_{name}") or find_frames(source / "hdImgs" / name)


def _first_number(frames: FrameReader) -> int:
    """Returns the number of the first frame, which extracted images have in their names."""
    return (number_in(frames.stills[0].stem) or 0) if frames.stills else 0


def _read_bodies(source: Path, frames: range, person: int | None, confidence: float) -> np.ndarray:
    """Returns (T, 19, 3), cm, of one person; NaN where unknown."""
    folders = [source / "hdPose3d_stage1_coco19" / "hd", source / "hdPose3d_stage1_coco19"]
    folder = next((f for f in folders if any(f.glob("body3DScene_*.json"))), None)
    if folder is None:
        raise InputError(
            f"{folders[1]} is missing: extract hdPose3d_stage1_coco19.tar, or give --no-truth"
        )
    bodies: dict[int, list[dict]] = {}
    for number in frames:
        file = folder / f"body3DScene_{number:08d}.json"
        if file.is_file():
            bodies[number] = _bodies(file)
    seen = Counter(body["id"] for of_frame in bodies.values() for body in of_frame)
    if person is None and len(seen) > 1:
        listed = ", ".join(f"{one} ({count} frames)" for one, count in seen.most_common())
        raise InputError(
            f"{folder} has several people: choose with --person ID, or --no-truth; IDs: {listed}"
        )
    chosen = person if person is not None else next(iter(seen), None)
    if chosen not in seen:
        raise InputError(
            f"{folder} has nobody {'' if person is None else f'with ID {person} '}in these frames"
        )
    points = np.full((len(frames), 19, 4), np.nan)
    for row, number in enumerate(frames):
        for body in bodies.get(number, []):
            if body["id"] == chosen:
                points[row] = body["joints"]
    return drop_uncertain(points, confidence)


def _bodies(file: Path) -> list[dict]:
    content = read_json(file)
    try:
        return [
            {"id": int(b["id"]), "joints": np.asarray(b["joints19"], np.float64).reshape(19, 4)}
            for b in content["bodies"]
        ]
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(
            f"{file} does not hold bodies of 19 joints ({error}): extract it again"
        ) from None
