"""Movements of the example bodies, and recordings of them with the exact truth."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from calib.camera import Rig
from calib.files import write_rig
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import relaxed_rad
from silhouette_core.motion.kinematics import quaternions, skin
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import write_motion
from voxelpose.demo.mannequin import COLOURS_BGR
from voxelpose.demo.room import FilmCamera, demo_rig, write_video
from voxelpose.recording.truth import TRUE_MOTION

from . import example_bodies

BODY = "body.safetensors"
_FPS, _EMPTY_FRAMES = 15, 24
_Curves = Callable[[np.ndarray], tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]]


def _wave(t: np.ndarray, low: float, high: float, hertz: float, phase: float = 0.0) -> np.ndarray:
    """Degrees between two angles, `phase` in turns."""
    return low + (high - low) * (0.5 + 0.5 * np.sin(2 * np.pi * (hertz * t + phase)))


def _still(t: np.ndarray, at: tuple[float, float], yaw_deg: float) -> tuple[np.ndarray, np.ndarray]:
    return np.tile([*at, 0.0], (len(t), 1)), np.full(len(t), yaw_deg)


def _robot(t: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    angles = {
        "turret.shoulder_pan": _wave(t, -70, 60, 0.22, 0.1),
        "upper_arm.shoulder_lift": _wave(t, -50, 10, 0.31, 0.6),
        "forearm.elbow": _wave(t, -30, 50, 0.27, 0.3),
        "wrist_1.wrist_roll": _wave(t, -50, 50, 0.35, 0.8),
        "wrist_2.wrist_bend": _wave(t, 25, 80, 0.3),
        "gripper.gripper_roll": _wave(t, -60, 60, 0.25, 0.4),
    }
    return angles, *_still(t, (0.05, 0.1), 12.0)


def _quadruped(t: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    step, angles = 1.0, {
        "neck.lift": _wave(t, -12, 12, 0.5), "neck.turn": _wave(t, -25, 25, 0.3),
        "head.nod": _wave(t, -10, 15, 0.6), "tail.lift": _wave(t, -30, 0, 0.4),
        "tail.wag": _wave(t, -30, 30, 1.0),
    }  # fmt: skip
    for name, phase in (
        ("left_fore", 0.0), ("right_fore", 0.5), ("right_hind", 0.25), ("left_hind", 0.75)
    ):  # fmt: skip
        fore = name.endswith("fore")
        bend = _wave(t, 5, 55, step, phase + 0.25)
        swing = _wave(t, -28, 28, step, phase)
        angles |= {
            f"{name}_upper.swing": swing,
            f"{name}_upper.spread": _wave(t, -4, 4, 0.5, phase),
            f"{name}_lower.bend": bend if fore else -bend,
            f"{name}_paw.bend": -0.4 * swing,
        }
    turn = np.radians(40 * t + 20)
    place = 0.45 * np.stack([np.cos(turn), np.sin(turn), np.zeros_like(t)], 1)
    place[:, 2] = -0.02 + 0.01 * np.sin(4 * np.pi * step * t)
    return angles, place, np.degrees(turn) + 180.0


def _lamp(t: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    angles = {
        "lower_arm.pitch": _wave(t, -30, 25, 0.3, 0.2),
        "lower_arm.lean": _wave(t, -20, 20, 0.4),
        "upper_arm.pitch": _wave(t, -35, 40, 0.35, 0.5),
        "shade.pitch": _wave(t, -30, 40, 0.5, 0.7),
    }
    return angles, *_still(t, (0.0, -0.1), 25.0)


def _stick(t: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    angles = {
        "right_upper_arm.abduction": _wave(t, -30, 25, 0.5),
        "right_upper_arm.forward": _wave(t, 0, 50, 0.35, 0.2),
        "right_forearm.flexion": _wave(t, 15, 80, 0.6, 0.6),
        "left_upper_arm.abduction": _wave(t, -40, -20, 0.5),
        "left_forearm.flexion": _wave(t, 10, 35, 0.5),
        "left_thigh.flexion": _wave(t, -10, 20, 0.5), "left_shin.flexion": _wave(t, 0, 25, 0.5),
        "right_thigh.flexion": _wave(t, -10, 20, 0.5, 0.5),
        "right_shin.flexion": _wave(t, 0, 25, 0.5, 0.5),
        "lumbar.rotation": _wave(t, -10, 10, 0.5),
    }  # fmt: skip
    return angles, *_still(t, (0.0, 0.0), -15.0)


def _spider(t: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray, np.ndarray]:
    angles = {}
    for k, name in enumerate(("left_fore", "left_hind", "right_hind", "right_fore")):
        angles |= {
            f"{name}_upper.swing": _wave(t, -70, 70, 0.5, 0.21 * k),
            f"{name}_upper.lift": _wave(t, -40, 10, 0.9, 0.37 * k),
            f"{name}_lower.bend": _wave(t, -40, 30, 0.7, 0.29 * k),
        }
    place = np.stack([0.2 * np.sin(t), 0.1 * np.cos(t), 0.25 + 0.05 * np.sin(3 * t)], 1)
    return angles, place, 30 * t


_EXAMPLES: dict[str, tuple[Callable[[], BodyModel], _Curves, int]] = {
    "robot_arm": (example_bodies.robot_arm, _robot, 45),
    "quadruped": (example_bodies.quadruped, _quadruped, 45),
    "desk_lamp": (example_bodies.desk_lamp, _lamp, 30),
    "person_with_stick": (example_bodies.person_with_stick, _stick, 30),
    "spider": (example_bodies.spider, _spider, 45),
}
EXAMPLES = tuple(_EXAMPLES)


def example_motion(name: str, frames: int | None = None) -> Motion:
    """Movement of one of the `EXAMPLES`, 15 frames per second; None: the whole of it.

    Raises:
        ValueError: there is no such example.
    """
    if name not in _EXAMPLES:
        raise ValueError(f"there is no example {name!r}: {', '.join(EXAMPLES)}")
    body, curves, usual = _EXAMPLES[name]
    model, t = body(), np.arange(usual if frames is None else frames) / _FPS
    degrees, place, yaw_deg = curves(t)
    angles = np.tile(relaxed_rad(model.tree), (len(t), 1))
    for dof, values in degrees.items():
        angles[:, model.tree.dof_names.index(dof)] = np.radians(values)
    low, high = model.tree.dof_limits_rad.T
    turn = Rotation.from_euler("z", yaw_deg[:, None], degrees=True)
    root = place + turn.apply(model.joints_m[0])
    rotation = quaternions(turn.as_matrix())
    return Motion(float(_FPS), model, root, rotation, np.clip(angles, low, high))


def film_example(
    folder: Path, name: str, frames: int | None = None, cameras: Sequence[int] = (1, 2, 3, 4)
) -> Path:
    """Renders a recording of an example: videos, empty backgrounds, calibration, body and truth.

    Args:
        folder: where to write; made if absent.
        name: one of `EXAMPLES`.
        frames: number of frames; None: the whole movement.
        cameras: numbers of those that film, 1 to 8.

    Returns:
        The folder; `BODY` in it holds the body at rest, `TRUE_MOTION` the true motion. That of the
        robot arm holds its URDF, too.
    """
    motion = example_motion(name, frames)
    (folder / "background").mkdir(parents=True, exist_ok=True)
    rig = Rig(tuple(demo_rig(8).cameras[number - 1] for number in cameras))
    write_rig(rig, folder / "calibration.toml")
    write_motion(motion, folder / TRUE_MOTION)
    write_motion(_at_rest(motion.model), folder / BODY)
    if name == example_bodies.ROBOT_ARM.stem:
        shutil.copy(example_bodies.ROBOT_ARM, folder)
    rotation, origin = motion.parts()
    meshes = [skin(motion.model, *one) for one in zip(rotation, origin, strict=True)]
    colour = (motion.model.face_part % len(COLOURS_BGR)).astype(np.int32)
    for number, camera in zip(cameras, rig, strict=True):
        view = FilmCamera(camera, np.random.default_rng(number))
        empty = (view.empty() for _ in range(_EMPTY_FRAMES))
        write_video(folder / "background" / f"{camera.name}.mp4", _FPS, empty)
        pictures = (view.picture(mesh, motion.model.faces, colour) for mesh in meshes)
        write_video(folder / f"{camera.name}.mp4", _FPS, pictures)
    return folder


def _at_rest(model: BodyModel) -> Motion:
    upright = np.array([[1.0, 0, 0, 0]])
    return Motion(float(_FPS), model, model.joints_m[:1], upright, np.zeros((1, model.dof_count)))
