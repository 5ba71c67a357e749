"""What the miniatures of data sets are made of: two cameras, a figure, small videos and images."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

from tests.sources import write_film
from voxelpose import Recording
from voxelpose.recording.truth import read_truth

SIZE = (64, 48)
FRAMES = 6
CONVERT = Path(__file__).resolve().parents[2] / "datasets" / "convert.py"

# Metres, z up, facing -y, left hand toward +x: in the order of a recording's truth.
FIGURE = {
    "pelvis": (0.0, 0.0, 0.95),
    "left_hip": (0.1, 0.0, 0.9),
    "left_knee": (0.11, -0.02, 0.5),
    "left_ankle": (0.12, 0.01, 0.08),
    "right_hip": (-0.1, 0.0, 0.9),
    "right_knee": (-0.11, -0.02, 0.5),
    "right_ankle": (-0.12, 0.01, 0.08),
    "neck": (0.0, 0.03, 1.48),
    "head_top": (0.0, 0.0, 1.75),
    "left_shoulder": (0.18, 0.02, 1.43),
    "left_elbow": (0.22, 0.04, 1.12),
    "left_wrist": (0.24, -0.03, 0.86),
    "right_shoulder": (-0.18, 0.02, 1.43),
    "right_elbow": (-0.22, 0.04, 1.12),
    "right_wrist": (-0.24, -0.03, 0.86),
}
EARS = {"left_ear": (0.07, 0.0, 1.62), "right_ear": (-0.07, 0.0, 1.62)}
POINTS = np.array([*FIGURE.values(), *EARS.values()])


def moving(frame: int) -> dict[str, np.ndarray]:
    """The figure, walking 1 cm per frame along y; metres, z up."""
    return {name: np.add(at, (0, -0.01 * frame, 0)) for name, at in (FIGURE | EARS).items()}


def truth_of(frames: int = FRAMES) -> np.ndarray:
    """(frames, 15, 3), m, z up."""
    return np.array([[moving(frame)[name] for name in FIGURE] for frame in range(frames)])


def looking(number: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and translation, m, of a camera 3 m away, from a world whose z points up."""
    angle = 0.9 * number + 0.2
    centre = np.array([3 * np.sin(angle), -3 * np.cos(angle), 1.5])
    forward = np.array([0, 0, 1.0]) - centre
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward])
    return rotation, -rotation @ centre


def write_video(file: Path, frames: int = FRAMES, fps: float = 25.0, size=SIZE) -> Path:
    """A grey video that becomes lighter by frame."""
    pictures = (np.full((*size[::-1], 3), 40 + 10 * number, np.uint8) for number in range(frames))
    return write_film(file, pictures, fps, "mp4v" if file.suffix == ".mp4" else "MJPG")


def write_images(folder: Path, frames: int = FRAMES, name: str = "{:06d}.png", size=SIZE, first=0):
    """Grey images that become lighter by frame."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(frames):
        image = np.full((size[1], size[0], 3), 40 + 10 * number, np.uint8)
        cv2.imwrite(str(folder / name.format(first + number)), image)


def write_masks(folder: Path, frames: int = FRAMES, value: int = 255, name: str = "{:06d}.png"):
    """Images with a square of a value, 10 pixels wide, that moves by a pixel per frame."""
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(frames):
        image = np.zeros(SIZE[::-1], np.uint8)
        image[10:20, 5 + number : 15 + number] = value
        cv2.imwrite(str(folder / name.format(number)), image)


def write_json(file: Path, content: object) -> Path:
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(content))
    return file


def opened(out: Path, native_pixels: dict[str, np.ndarray], **options) -> Recording:
    """Opens a converted recording and checks that the known points are seen where they have to be.

    Args:
        out: the recording.
        native_pixels: by camera, (N, 2): POINTS, projected by the data set's own formula.
        options: of Recording.open.
    """
    recording = Recording.open(out, **options)
    assert set(recording.rig.names) == set(native_pixels)
    for camera in recording.rig:
        pixels, depth = camera.project(POINTS)
        assert (depth > 0).all()
        np.testing.assert_allclose(pixels, native_pixels[camera.name], atol=1e-3)
    frames = [number for number, _, pictures in recording if len(pictures) == len(native_pixels)]
    assert frames == list(range(recording.frame_count))
    return recording


def checked_truth(out: Path, expected: np.ndarray, but: tuple[str, ...] = ()) -> None:
    """Reads truth.json and compares all joints but some, which are compared to 5 cm."""
    truth = read_truth(out / "truth.json")
    document = json.loads((out / "truth.json").read_text())
    assert document["unit"] == "m" and document["up"] == "z"
    assert sorted(document["approximate"]) == sorted(but)
    assert truth.shape == expected.shape
    for place, name in enumerate(FIGURE):
        tolerance = 0.05 if name in but else 2e-6
        np.testing.assert_allclose(
            truth[:, place], expected[:, place], 1e-7, tolerance, err_msg=name
        )


def pinhole(points, rotation, translation, matrix) -> np.ndarray:
    """K (R X + t), in whatever units."""
    pixels = (points @ rotation.T + translation) @ matrix.T
    return pixels[:, :2] / pixels[:, 2:]


def run_alone(*arguments: object) -> subprocess.CompletedProcess:
    """Runs convert.py as a user does."""
    words = [sys.executable, str(CONVERT), *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, timeout=120)
