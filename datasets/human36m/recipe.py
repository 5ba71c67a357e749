"""Human3.6M as its site packs it: S1/Videos, S1/MyPoseFeatures/D3_Positions, metadata.xml."""

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
    first_existing,
    make_camera,
    open_frames,
    read_numbers,
    read_text,
    select_names,
    to_world_z_up,
)
from human36m.masks import MaskReader
from truth import select_joints

SUMMARY = "Human3.6M: 7 subjects with truth, 4 cameras, 15 scenarios, marker-based truth."

_CAMERAS = ("54138969", "55011271", "58860488", "60457274")  # in the order of metadata.xml
_SUBJECTS = 11
_FPS = 50.0
_JOINTS = 32
_PLACES = {
    "pelvis": 0,
    "right_hip": 1,
    "right_knee": 2,
    "right_ankle": 3,
    "left_hip": 6,
    "left_knee": 7,
    "left_ankle": 8,
    "neck": 13,
    "head_top": 15,
    "left_shoulder": 17,
    "left_elbow": 18,
    "left_wrist": 19,
    "right_shoulder": 25,
    "right_elbow": 26,
    "right_wrist": 27,
}


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that choose a clip."""
    group.add_argument("--subject", required=True, help="S1, S5, S6, S7, S8, S9 or S11")
    group.add_argument(
        "--sequence", required=True, help='as the files are named: "Walking 1", "Directions"'
    )
    group.add_argument("--masks", action="store_true", help="write the data set's masks too")
    group.add_argument(
        "--metadata", type=Path, help="metadata.xml of the code release, if not in SOURCE"
    )


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a clip.

    Raises:
        InputError: something is missing or cannot be read.
    """
    subjects = sorted(path.name for path in source.glob("S*") if (path / "Videos").is_dir())
    select_names(subjects, [options.subject], "subject", source)
    folder = source / options.subject
    number = int(re.sub(r"\D", "", options.subject) or 0)
    sequences = sorted(
        {path.name.rsplit(".", 2)[0] for path in (folder / "Videos").glob("*.*.mp4")}
    )
    select_names(sequences, [options.sequence], "sequence", folder / "Videos")
    videos = {name: folder / "Videos" / f"{options.sequence}.{name}.mp4" for name in _CAMERAS}
    available = [name for name, video in videos.items() if video.is_file()]
    names = select_names(available, options.cameras, "camera", folder / "Videos")
    metadata = options.metadata or source / "metadata.xml"
    values = _read_metadata(metadata)
    views = []
    for name in names:
        frames = open_frames(videos[name])
        camera = _camera(metadata, values, number, name, frames.size)
        file = folder / "MySegmentsMat" / "ground_truth_bs" / f"{options.sequence}.{name}.mat"
        masks = MaskReader.open(file) if options.masks or options.silhouettes else None
        views.append(CameraView(to_world_z_up(camera, "z", 0.001), frames, masks=masks))
    truth = None
    if not options.no_truth:
        truth = select_joints(_read_truth(folder, options.sequence) / 1000, _PLACES)
    return Clip(tuple(views), _FPS, truth, notes={"clip": f"{options.subject} {options.sequence}"})


def _read_metadata(file: Path) -> np.ndarray:
    """Returns the numbers of w0: 6 per camera and subject, then 9 per camera."""
    match = re.search(r"<w0>\s*\[(.*?)\]\s*</w0>", read_text(file), re.DOTALL)
    if match is None:
        raise InputError(
            f"{file} has no <w0>: take metadata.xml of the data set's own code release"
        )
    count = len(_CAMERAS) * (6 * _SUBJECTS + 9)
    return read_numbers(match[1].split(), file, "<w0>", count)


def _camera(
    file: Path, values: np.ndarray, subject: int, name: str, size: tuple[int, int]
) -> Camera:
    """Returns a camera: X_camera = R (X_world - T), R = Rx Ry Rz, T in mm.

    The data set's lens is x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6 + p1 y + p2 x) + p2 r^2 and
    y' = y (...) + p1 r^2. OpenCV's tangential terms are twice as strong but for that of r^2;
    half of them, and half of p as thin prism, make exactly the data set's.
    """
    if not 1 <= subject <= _SUBJECTS:
        raise InputError(
            f"{file} knows subjects S1 to S{_SUBJECTS}, not S{subject}: correct --subject"
        )
    at = _CAMERAS.index(name)
    start = 6 * (at * _SUBJECTS + subject - 1)
    angles, centre = values[start : start + 3], values[start + 3 : start + 6]
    fx, fy, cx, cy, k1, k2, k3, p1, p2 = values[6 * _SUBJECTS * len(_CAMERAS) :].reshape(-1, 9)[at]
    rotation = _turn(0, angles[0]) @ _turn(1, angles[1]) @ _turn(2, angles[2])
    return make_camera(
        file,
        name=camera_name(name),
        size=size,
        matrix=[[fx, 0, cx], [0, fy, cy], [0, 0, 1]],
        distortion=[k1, k2, p1 / 2, p2 / 2, k3, 0, 0, 0, p2 / 2, 0, p1 / 2, 0],
        rotation=rotation,
        translation=-rotation @ centre,
    )


def _turn(axis: int, angle: float) -> np.ndarray:
    """Returns the rotation, (3, 3), about an axis."""
    turn = np.eye(3)
    a, b = (axis + 1) % 3, (axis + 2) % 3
    turn[[a, b], [a, b]] = np.cos(angle)
    turn[a, b], turn[b, a] = -np.sin(angle), np.sin(angle)
    return turn


def _read_truth(folder: Path, sequence: str) -> np.ndarray:
    """Returns (T, 32, 3), mm, world, of a .cdf, or of the .cdf.mat that MATLAB users make of it."""
    places = ("MyPoseFeatures/D3_Positions", "Poses_D3_Positions", "D3_Positions")
    file = first_existing(
        folder, *(f"{place}/{sequence}.cdf{end}" for place in places for end in ("", ".mat"))
    )
    try:
        flat = _read_mat(file) if file.suffix == ".mat" else _read_cdf(file)
        table = np.asarray(flat, dtype=np.float64).reshape(-1, _JOINTS, 3)
    except InputError:
        raise
    except Exception as error:  # the libraries raise whatever their parsers stumble on
        raise InputError(f"{file} cannot be read ({error}): download it again") from None
    return table


def _read_cdf(file: Path) -> np.ndarray:
    try:
        import cdflib
    except ImportError:
        raise InputError(f"{file} needs cdflib: pip install cdflib, or give --no-truth") from None
    return np.asarray(cdflib.CDF(str(file)).varget("Pose"))


def _read_mat(file: Path) -> np.ndarray:
    from scipy.io import loadmat

    data = loadmat(str(file))["data"]
    return data[0, 0] if data.dtype == object else data
