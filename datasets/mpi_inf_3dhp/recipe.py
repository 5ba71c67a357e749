"""MPI-INF-3DHP's training set: S1/Seq1/imageSequence, camera.calibration, annot.mat."""

import argparse
from pathlib import Path

import numpy as np
from clip import (
    VIDEOS,
    Camera,
    CameraView,
    Clip,
    InputError,
    camera_name,
    first_existing,
    make_camera,
    open_frames,
    read_numbers,
    read_text,
    select_names,
    to_world_z_up,
)
from truth import select_joints

SUMMARY = "MPI-INF-3DHP (training set): 8 subjects, 14 cameras, green screen, markerless truth."

_MM = 0.001
_PLACES = {
    "pelvis": 4,
    "neck": 5,
    "head_top": 7,
    "left_shoulder": 9,
    "left_elbow": 10,
    "left_wrist": 11,
    "right_shoulder": 14,
    "right_elbow": 15,
    "right_wrist": 16,
    "left_hip": 18,
    "left_knee": 19,
    "left_ankle": 20,
    "right_hip": 23,
    "right_knee": 24,
    "right_ankle": 25,
}
_JOINTS = 28
_DISAGREE_M = 0.01


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that choose a clip."""
    group.add_argument("--subject", required=True, help="S1 to S8")
    group.add_argument("--sequence", required=True, help="Seq1 or Seq2")
    group.add_argument(
        "--fps", type=float, help="where videos were extracted to images: 25 or 50, see the card"
    )


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a clip.

    Raises:
        InputError: something is missing or cannot be read.
    """
    subjects = sorted(path.name for path in source.glob("S*") if path.is_dir())
    select_names(subjects, [options.subject], "subject", source)
    folder = source / options.subject
    sequences = sorted(path.name for path in folder.glob("Seq*"))
    select_names(sequences, [options.sequence], "sequence", folder)
    folder = folder / options.sequence
    paths = _paths(folder)
    names = select_names(paths, options.cameras, "camera", folder)
    cameras = _read_cameras(folder / "camera.calibration")
    select_names(cameras, names, "camera", folder / "camera.calibration")
    views = [
        CameraView(to_world_z_up(cameras[name], "y", _MM), open_frames(paths[name]))
        for name in names
    ]
    truth = (
        None
        if options.no_truth
        else _read_truth(folder / "annot.mat", views, list(map(int, names)))
    )
    return Clip(
        tuple(views), options.fps, truth, notes={"clip": f"{options.subject} {options.sequence}"}
    )


def _paths(folder: Path) -> dict[str, Path]:
    """Returns the videos, or folders of extracted frames, by the camera's number."""
    images = first_existing(folder, "imageSequence", "imageFrames")
    paths = {_number(path): path for path in sorted(images.rglob("video_*")) if _is_camera(path)}
    return {name: paths[name] for name in sorted(paths, key=int)}


def _number(path: Path) -> str:
    return path.stem.removeprefix("video_")


def _is_camera(path: Path) -> bool:
    return _number(path).isdigit() and (path.is_dir() or path.suffix.lower() in VIDEOS)


def _read_cameras(file: Path) -> dict[str, Camera]:
    """Reads Skeletool's text: name, size, intrinsic and extrinsic (4 x 4, by rows), radial."""
    blocks: list[dict[str, list[str]]] = []
    for line in read_text(file).splitlines():
        key, *words = line.split() or [""]
        if key == "name":
            blocks.append({})
        if blocks and key:
            blocks[-1][key] = words
    if not blocks:
        raise InputError(f"{file} is no Skeletool calibration: download it again")
    cameras = {}
    for block in blocks:
        name = " ".join(block["name"])
        intrinsic, extrinsic = (
            read_numbers(block.get(key, ()), file, f"{key} of camera {name}", 16).reshape(4, 4)
            for key in ("intrinsic", "extrinsic")
        )
        if any(read_numbers(block.get("radial", ()), file, "radial")):
            raise InputError(
                f"{file}: camera {name} has a radial distortion, which is not documented"
            )
        cameras[name] = make_camera(
            file,
            name=camera_name(name),
            size=read_numbers(block.get("size", ()), file, f"size of camera {name}", 2),
            matrix=intrinsic[:3, :3],
            distortion=[],
            rotation=extrinsic[:3, :3],
            translation=extrinsic[:3, 3],
        )
    return cameras


def _read_truth(file: Path, views: list[CameraView], numbers: list[int]) -> np.ndarray:
    """Returns (T, 15, 3), m, world, of annot3, which has the joints in every camera, mm."""
    from scipy.io import loadmat

    if not file.is_file():
        raise InputError(f"{file} is missing: download it, or give --no-truth")
    try:
        table = loadmat(str(file), variable_names=["annot3"])["annot3"]
        seen = [np.asarray(table[n][0], np.float64).reshape(-1, _JOINTS, 3) for n in numbers]
    except Exception as error:  # scipy raises whatever its parser stumbles on
        raise InputError(f"{file}: annot3 cannot be read ({error}): download it again") from None
    worlds = []
    for view, points in zip(views, seen, strict=True):
        joints = _MM * select_joints(points, _PLACES)
        worlds.append((joints - view.camera.translation) @ view.camera.rotation)
    for view, world in zip(views, worlds, strict=True):
        if world.shape != worlds[0].shape or np.abs(world - worlds[0]).max() > _DISAGREE_M:
            raise InputError(
                f"{file}: the joints in camera {view.camera.name} are elsewhere in the world "
                f"than in {views[0].camera.name}: files of different "
                "sequences? give --no-truth otherwise"
            )
    return np.mean(worlds, axis=0)
