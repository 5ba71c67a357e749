"""CMU Panoptic's HD cameras: hdVideos, calibration_NAME.json, hdPose3d_stage1_coco19."""

import argparse
from collections import Counter
from pathlib import Path

import numpy as np
from take import (
    Camera,
    InputError,
    Pictures,
    Take,
    View,
    camera_name,
    choose,
    find_pictures,
    made,
    number_in,
    placed,
    upright,
)
from truth import confident, from_keypoints, read_json

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


def read(source: Path, options: argparse.Namespace) -> Take:
    """Reads a take.

    Raises:
        InputError: something is missing or cannot be read.
    """
    file = _calibration(source)
    cameras = _read_cameras(file)
    filmed = {name: path for name in cameras if (path := _pictures(source, name)) is not None}
    names = choose(filmed, options.cameras, "HD camera", source)
    views = tuple(View(placed(cameras[n], "-y", _CM), Pictures.open(filmed[n])) for n in names)
    first = _first_number(views[0].pictures)
    if any(_first_number(view.pictures) != first for view in views):
        raise InputError(
            f"{source}: the images of the cameras begin at different frames: extract all alike"
        )
    take = file.stem.removeprefix("calibration_")
    if options.no_truth:
        return Take(views, _FPS, notes={"take": take})
    count = min(view.pictures.count for view in views)
    points = _read_bodies(
        source, range(first, first + count), options.person, options.least_confidence
    )
    truth, constructed = from_keypoints(_CM * points @ upright("-y").T, _PLACES)
    return Take(views, _FPS, truth, constructed, notes={"take": take})


def _calibration(source: Path) -> Path:
    files = sorted(source.glob("calibration_*.json"))
    if len(files) != 1:
        raise InputError(
            f"{source} holds {len(files) or 'no'} calibration_*.json: "
            "give the folder of one sequence"
        )
    return files[0]


def _read_cameras(file: Path) -> dict[str, Camera]:
    """Returns the HD cameras: K, distCoef (OpenCV's order), R, t in cm, X_camera = R X + t."""
    content = read_json(file)
    try:
        found = [camera for camera in content["cameras"] if camera["type"] == "hd"]
        return {
            one["name"]: made(
                file,
                name=camera_name(one["name"]),
                size=one["resolution"],
                matrix=one["K"],
                distortion=one["distCoef"],
                rotation=one["R"],
                translation=one["t"],
            )
            for one in found
        }
    except (KeyError, TypeError) as error:
        raise InputError(
            f"{file} is no calibration of the Panoptic Studio ({error} is missing)"
        ) from None


def _pictures(source: Path, name: str) -> Path | None:
    """Returns a camera's video, or the folder of images extracted from it."""
    return find_pictures(source / "hdVideos" / f"hd_{name}") or find_pictures(
        source / "hdImgs" / name
    )


def _first_number(pictures: Pictures) -> int:
    """Returns the number of the first picture, which extracted images carry in their names."""
    return (number_in(pictures.stills[0].stem) or 0) if pictures.stills else 0


def _read_bodies(source: Path, frames: range, person: int | None, least: float) -> np.ndarray:
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
    return confident(points, least)


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
