"""AIST++: cameras/mapping.txt, cameras/settingN.json and keypoints3d beside the videos of AIST."""

import argparse
from pathlib import Path

import numpy as np
from clip import (
    Camera,
    CameraView,
    Clip,
    InputError,
    find_frames,
    open_frames,
    read_json,
    read_json_cameras,
    read_text,
    select_names,
    to_world_z_up,
    z_up_from,
)
from truth import COCO17, from_keypoints

SUMMARY = "AIST++: dances of 30 people, 9 cameras, markerless truth."

_FPS = 60.0
_CM = 0.01


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that choose a clip."""
    group.add_argument(
        "--sequence", required=True, help="gBR_sBM_cAll_d04_mBR0_ch01, as in mapping.txt"
    )
    group.add_argument(
        "--videos", type=Path, help="folder of AIST's videos (default SOURCE/videos)"
    )
    group.add_argument(
        "--keypoints",
        choices=("keypoints3d_optim", "keypoints3d"),
        default="keypoints3d_optim",
        help="smoothed over time (default), or triangulated frame by frame",
    )


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a clip.

    Raises:
        InputError: something is missing or cannot be read.
    """
    settings = _read_mapping(source / "cameras" / "mapping.txt")
    select_names(settings, [options.sequence], "sequence", source / "cameras" / "mapping.txt")
    cameras = _read_cameras(source / "cameras" / f"{settings[options.sequence]}.json")
    videos = options.videos or source / "videos"
    paths = {
        name: path
        for name in cameras
        if (path := find_frames(videos / options.sequence.replace("cAll", name))) is not None
    }
    names = select_names(paths, options.cameras, f"video of {options.sequence}", videos)
    views = tuple(
        CameraView(to_world_z_up(cameras[n], "y", _CM), open_frames(paths[n])) for n in names
    )
    notes = {"clip": options.sequence}
    if options.no_truth:
        return Clip(views, _FPS, notes=notes)
    points = _read_keypoints(source / "keypoints3d", options.sequence, options.keypoints)
    truth, constructed = from_keypoints(_CM * points @ z_up_from("y").T, COCO17)
    return Clip(views, _FPS, truth, constructed, notes=notes)


def _read_mapping(file: Path) -> dict[str, str]:
    """Returns the camera setting of every sequence."""
    pairs = [line.split() for line in read_text(file).splitlines() if line.strip()]
    if any(len(pair) != 2 for pair in pairs):
        raise InputError(f"{file} must have a sequence and its setting per line: download it again")
    return dict(pairs)


def _read_cameras(file: Path) -> dict[str, Camera]:
    """Returns the cameras: rotation as a Rodrigues vector, translation in cm."""
    keys = {name: name for name in ("size", "matrix", "rotation", "translation")}
    return read_json_cameras(file, "camera setting of AIST++", keys | {"distortion": "distortions"})


def _read_keypoints(folder: Path, sequence: str, key: str) -> np.ndarray:
    """Returns (T, 17, 3), cm, of .npz or .json; a pickle can run any code and is not opened."""
    for file in (folder / f"{sequence}.npz", folder / f"{sequence}.json"):
        if not file.is_file():
            continue
        try:
            if file.suffix == ".npz":
                with np.load(file, allow_pickle=False) as content:
                    points = content[key]
            else:
                points = read_json(file)[key]
            return np.asarray(points, np.float64).reshape(-1, 17, 3)
        except InputError:
            raise
        except Exception as error:  # numpy raises whatever zip and its own parser stumble on
            raise InputError(f"{file}: {key} cannot be read ({error}): convert it again") from None
    if (folder / f"{sequence}.pkl").is_file():
        raise InputError(
            f"{folder / sequence}.pkl is a pickle, which can run any code when it is opened: "
            "convert it to .npz as aistpp/card.md says, or give --no-truth"
        )
    raise InputError(f"{folder / sequence}.npz is missing: see aistpp/card.md, or give --no-truth")
