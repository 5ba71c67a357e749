"""TotalCapture: calibration.cal, TC_S1_acting1_cam1.mp4 ..., gt_skel_gbl_pos.txt."""

import argparse
import re
from pathlib import Path

import numpy as np
from clip import (
    Camera,
    CameraView,
    Clip,
    InputError,
    camera_name,
    make_camera,
    number_in,
    open_frames,
    read_numbers,
    read_text,
    select_names,
    to_world_z_up,
    z_up_from,
)
from truth import JOINTS, extend_line

SUMMARY = "TotalCapture: 5 subjects, 8 cameras, inertial sensors, marker-based truth."

_FPS = 60.0
_INCH = 0.0254
_VERTEX_OVER_HEAD_M = 0.15  # top of the head over the joint named Head, roughly; see the card
_NAMES = {"pelvis": "Hips", "neck": "Neck"} | {
    f"{side.lower()}_{joint}": side + bone
    for side in ("Left", "Right")
    for joint, bone in {
        "hip": "UpLeg",
        "knee": "Leg",
        "ankle": "Foot",
        "shoulder": "Arm",
        "elbow": "ForeArm",
        "wrist": "Hand",
    }.items()
}


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that choose a clip."""
    group.add_argument("--subject", required=True, help="S1 to S5")
    group.add_argument("--sequence", required=True, help="rom1, walking2, acting3, freestyle1 ...")
    group.add_argument(
        "--up", choices=("y", "z"), default="y", help="axis of the world that points up (y)"
    )


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a clip.

    Raises:
        InputError: something is missing or cannot be read.
    """
    title = f"TC_{options.subject}_{options.sequence}"
    videos = _videos(source, title)
    names = select_names(videos, options.cameras, f"camera of {title}", source)
    file = next(iter(sorted(source.rglob("calibration.cal"))), source / "calibration.cal")
    cameras = _read_cameras(file)
    select_names(cameras, names, "camera", file)
    views = []
    for name in names:
        camera = to_world_z_up(cameras[name], options.up)
        views.append(CameraView(camera, open_frames(videos[name])))
    notes = {"clip": f"{options.subject} {options.sequence}"}
    if options.no_truth:
        return Clip(tuple(views), _FPS, notes=notes)
    truth = _read_truth(_truth_file(source, options.subject, options.sequence), options.up)
    return Clip(tuple(views), _FPS, truth, ("head_top",), notes=notes)


def _videos(source: Path, title: str) -> dict[str, Path]:
    """Returns the videos by cam1, cam2 ..., wherever the archives were unpacked."""
    videos: dict[str, Path] = {}
    for path in sorted(source.rglob("*.mp4")):
        match = re.fullmatch(rf"{re.escape(title)}_(cam\d+)", path.stem, re.IGNORECASE)
        if match is not None:
            camera = match[1].lower()
            if camera in videos:
                raise InputError(f"{path} and {videos[camera]} are the same video: remove one")
            videos[camera] = path
    return dict(sorted(videos.items(), key=lambda item: number_in(item[0])))


def _read_cameras(file: Path) -> dict[str, Camera]:
    """Reads calibration.cal: how many cameras, order of distortion, and the cameras.

    Per camera: first and last row and column, fx fy cx cy, distortion, R by rows, t in metres, with
    X_camera = R X + t.
    """
    lines = [line.split() for line in read_text(file).splitlines() if line.strip()]
    count, order = read_numbers(lines[0] if lines else [], file, "the first line", 2).astype(int)
    if order > 3 or order < 0:
        raise InputError(
            f"{file}: a distortion of order {order} is not documented: download it again"
        )
    words = [word for line in lines[1:] for word in line]
    size = 4 + 4 + order + 9 + 3
    values = read_numbers(words, file, f"{count} cameras", count * size).reshape(count, size)
    cameras = {}
    for number, one in enumerate(values):
        _, rows, _, columns = one[:4]
        fx, fy, cx, cy = one[4:8]
        k1, k2, k3 = [*one[8 : 8 + order], 0, 0, 0][:3]
        name = f"cam{number + 1}"
        cameras[name] = make_camera(
            file,
            name=camera_name(name),
            size=(columns + 1, rows + 1),
            matrix=[[fx, 0, cx], [0, fy, cy], [0, 0, 1]],
            distortion=[k1, k2, 0, 0, k3],
            rotation=one[8 + order : 17 + order].reshape(3, 3),
            translation=one[17 + order :],
        )
    return cameras


def _truth_file(source: Path, subject: str, sequence: str) -> Path:
    """Finds acting1/gt_skel_gbl_pos.txt below a folder of the subject (s1, S1_vicon_pos_ori)."""
    files = [
        path
        for path in sorted(source.rglob("gt_skel_gbl_pos.txt"))
        if path.parent.name.lower() == sequence.lower()
        and any(
            re.fullmatch(rf"{re.escape(subject)}(_.*)?", part, re.IGNORECASE)
            for part in path.relative_to(source).parts
        )
    ]
    if len(files) != 1:
        raise InputError(
            f"{source} holds {len(files) or 'no'} {subject}/{sequence}/gt_skel_gbl_pos.txt: "
            "unpack it once, or give --no-truth"
        )
    return files[0]


def _read_truth(file: Path, up: str) -> np.ndarray:
    """Returns (T, 15, 3), m, of a line of joint names, then x y z of each, inches, per frame."""
    names, *lines = [line.split() for line in read_text(file).splitlines() if line.strip()] or [[]]
    missing = [name for name in (*_NAMES.values(), "Head") if name not in names]
    if missing or not lines:
        raise InputError(f"{file} has no {missing[0] if missing else 'frames'}: download it again")
    rows = [read_numbers(line, file, f"frame {n}", 3 * len(names)) for n, line in enumerate(lines)]
    points = _INCH * np.array(rows).reshape(len(rows), len(names), 3) @ z_up_from(up).T
    joints = {joint: points[:, names.index(name)] for joint, name in _NAMES.items()}
    joints["head_top"] = extend_line(
        joints["neck"], points[:, names.index("Head")], _VERTEX_OVER_HEAD_M
    )
    return np.stack([joints[name] for name in JOINTS], axis=1)
