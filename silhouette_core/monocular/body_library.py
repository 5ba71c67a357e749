"""Library of a body that is no person's, as the camera of a recording sees it.

A root that stands still is found first; the body's poses are then seen from where the camera stands
to it, one view of each, and so many more of them.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from calib.camera import Camera
from calib.checks import BoolArray, FloatArray
from calib.errors import InputError
from calib.moments import even_moments
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import FrameSource
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from silhouette_core.monocular.person import find_person
from silhouette_core.monocular.person_finder import LONG_SIDE_PX
from silhouette_core.monocular.tree.base_poses import base_poses
from silhouette_core.monocular.tree.build import build_library
from silhouette_core.monocular.tree.pose_library import BasePoses, LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.rendering import yaw_rotations
from silhouette_core.monocular.tree.root_search import find_root
from silhouette_core.monocular.tree.store import is_library, read_library
from silhouette_core.monocular.tuning import SAMPLED_MOTION, TREE
from silhouette_core.monocular.window import look_at
from silhouette_core.motion.body_source import load_body
from silhouette_core.motion.dynamics import FPS, relaxed_rad
from silhouette_core.motion.kinematics import quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter
from silhouette_core.scoring.backend import Backend

_SAMPLED_FRAMES, _SEED = 40_000, 0
_FROM_ALL_SIDES = 24_000  # samples
_FROM_ONE_SIDE = 12_000
_MOMENTS = 8
_FRAMES_PER_KNOT = 15


def body_of_track(body: str, library: str, reporter: Reporter) -> BodyModel | None:
    """The body to be tracked if it is no person's, by the options of the estimator; else None.
    Raises InputError where there is no such body, or library.
    """
    if body:
        model = load_body(body, reporter.note)
    elif library and is_library(Path(library)):
        model = read_library(Path(library)).model
    else:
        return None
    return model if model.person is None else None


SomeSilhouettes = tuple[Camera, list[BoolArray]]
"""Pinhole camera without distortion, z up, and silhouettes (h, w) bool, not empty."""


def some_silhouettes(
    source: FrameSource, silhouettes: Silhouettes, camera: Camera
) -> SomeSilhouettes:
    """Silhouettes of a few moments of a recording. Raises InputError where none of the frames shows
    a body.

    Args:
        source: the recording, of one camera.
        camera: the same camera with z up.
    """
    lens, name = UndistortedView.from_camera(camera, LONG_SIDE_PX), source.rig.names[0]
    steps = even_moments(source.frame_count, _MOMENTS).tolist()
    bodies = [
        find_person(lens.undistort(silhouettes.of(one, step=step)[name]))
        for step, one in zip(steps, source.at(steps), strict=True)
    ]
    masks = [body.mask for body in bodies if body is not None]
    if not masks:
        raise InputError(
            f"camera {name} shows no body in any of {len(steps)} frames that were looked"
            " at: check its silhouettes, and that the body moves before it"
        )
    return lens.pinhole, masks


def library_of_body(
    model: BodyModel, file: str, silhouettes: SomeSilhouettes, backend: Backend, reporter: Reporter
) -> tuple[PoseLibrary, Pose | None]:
    """Library of a body, and the place of its root if that stands still. Raises InputError where
    the library is another body's.

    Args:
        file: library of its recorded poses; empty: poses are sampled within its limits.
    """
    recorded = _read(file, model) if file else None
    if recorded is not None and not model.tree.root_fixed:
        return recorded, None
    if recorded is None:
        reporter.note(
            "no library of the body's poses is given: its joints are assumed to move at random"
            " within their limits (voxelpose library build makes one from an earlier result)"
        )
    camera, masks = silhouettes
    pitches = [look_at(camera, mask, 1.0, 100.0).pitch_rad for mask in masks]
    pitch_deg = float(np.degrees(np.median(pitches)))
    reporter.stage("pose library")
    settings = _settings(_FROM_ALL_SIDES, 15.0, pitch_deg)
    library = recorded or build_library(_sampled_bases(model, settings), model, settings)
    if not model.tree.root_fixed:
        return library, None
    reporter.stage("root")
    root = find_root(library, camera, masks, backend)
    reporter.stage("pose library")
    return _from_one_side(library, recorded is None, camera, root), root


def _read(file: str, model: BodyModel) -> PoseLibrary:
    library = read_library(Path(file))
    if library.model.names != model.names or library.model.tree.dof_names != model.tree.dof_names:
        raise InputError(
            f"{file} is the library of a body with other parts or joints: build one of this body"
            " with voxelpose library build RESULT --body BODY"
        )
    return replace(library, model=model)


def _settings(poses: int, yaw_step_deg: float, pitch_deg: float) -> LibrarySettings:
    pitch_deg = min(max(pitch_deg, -60.0), 75.0)  # beyond it, which side is shown hardly counts
    thresholds = *TREE.thresholds[:2], 0.0  # few samples: each that looks different is a leaf
    return LibrarySettings(
        poses,
        yaw_step_deg=yaw_step_deg,
        pitches_deg=(pitch_deg,),
        mirror=False,
        thresholds=thresholds,
        weighting="xor",
    )


def _sampled_bases(model: BodyModel, settings: LibrarySettings) -> BasePoses:
    """Poses sampled within the joint limits."""
    motion = sampled_motion(model, np.random.default_rng(_SEED), _SAMPLED_FRAMES)
    return base_poses({"sampled": motion}, settings)


def sampled_motion(model: BodyModel, rng: np.random.Generator, frames: int) -> Motion:
    """Smooth random motion of all joints of a body, each by itself, at `dynamics.FPS`.

    Angles are normally distributed about rest, cut off at the limits. A root that is free leans a
    little; a motion has no heading, since a library shows every pose from all sides.
    """
    rest = relaxed_rad(model.tree)
    low, high = np.where(model.tree.dof_fixed, rest, model.tree.dof_limits_rad.T)
    knots = rng.standard_normal((frames // _FRAMES_PER_KNOT + 2, model.dof_count + 2))
    drawn = knots[:, 2:] * SAMPLED_MOTION.spread
    angles = np.clip(rest + np.where(drawn < 0, rest - low, high - rest) * drawn, low, high)
    tilt = np.zeros((len(knots), 3))
    if not model.tree.root_fixed:
        tilt[:, :2] = np.radians(SAMPLED_MOTION.tilt_deg) * knots[:, :2]
    turns = Rotation.from_rotvec(_between(tilt, frames)).as_matrix()
    root = np.tile(model.joints_m[0], (frames, 1))
    return Motion(FPS, model, root, quaternions(turns), _between(angles, frames))


def _between(knots: FloatArray, frames: int) -> FloatArray:
    """Values (T, n) that pass through knots (K, n) and never beyond their neighbours."""
    times = np.arange(len(knots)) * _FRAMES_PER_KNOT
    return np.asarray(PchipInterpolator(times, knots)(np.arange(frames)))


def _from_one_side(library: PoseLibrary, sampled: bool, camera: Camera, root: Pose) -> PoseLibrary:
    """Poses from where a camera stands to a root: of a library, or newly sampled and more."""
    model, (x, y, z) = library.model, root.root_m - camera.center_m
    pitch_deg = float(np.degrees(np.arctan2(-z, np.hypot(x, y))))
    settings = _settings(max(_FROM_ONE_SIDE, len(library.bases.angles)), 360.0, pitch_deg)
    bases = _sampled_bases(model, settings) if sampled else library.bases
    heading = yaw_rotations(np.array([-np.arctan2(-x, y)]))[0]
    turn = quaternions(heading @ root.root_rotation).astype(np.float32)
    return build_library(
        replace(bases, quaternion=np.tile(turn, (len(bases.angles), 1))), model, settings
    )
