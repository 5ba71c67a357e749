"""Limbs found again where the whole pose had them wrong."""

from dataclasses import replace

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.monocular.tracking.limb_resampling import LimbResampler, PoseFrame
from silhouette_core.monocular.tracking.observed_frame import FrameObserver
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.cpu import CPU
from tests.silhouette_core.monocular.filming import (
    body,
    camera_at,
    performed,
    poses_of,
    silhouette,
)

CAMERA = camera_at((0.5, -4.0, 1.4))
MODEL = body()
ARM = [
    MODEL.dof_names.index(name)
    for name in MODEL.dof_names
    if name.startswith(("right_upper_arm", "right_forearm"))
]


@pytest.fixture(scope="module")
def resampler(library):
    return LimbResampler(
        MODEL, PinholeViews.from_rig(Rig((CAMERA,))), library.base_angles.astype(float)
    )


@pytest.fixture(scope="module")
def observer(library):
    return FrameObserver(PinholeViews.from_rig(Rig((CAMERA,))), library, "balanced", CPU)


@pytest.fixture(scope="module")
def truth():
    return poses_of(performed("wave"))[16:34:3]


def pose_frame(observer, pose, seen, time_s):
    mask = silhouette(MODEL, seen, CAMERA)
    distance = float(np.linalg.norm(seen.root_m - CAMERA.center_m))
    return PoseFrame(pose, observer.observe(mask, distance, time_s))


def apart_mm(poses, truth):
    root, rotation, angles = (
        np.stack([getattr(pose, name) for pose in poses])
        for name in ("root_m", "root_rotation", "angles_rad")
    )
    result = landmarks(MODEL, *forward(MODEL, root, quaternions(rotation), angles))
    root, rotation, angles = (
        np.stack([getattr(pose, name) for pose in truth])
        for name in ("root_m", "root_rotation", "angles_rad")
    )
    return 1000 * np.linalg.norm(
        result - landmarks(MODEL, *forward(MODEL, root, quaternions(rotation), angles)), axis=-1
    )


def lowered(pose):
    """The pose with its right arm half way down."""
    angles = pose.angles_rad.copy()
    angles[ARM] = 0.5 * angles[ARM] + 0.5 * poses_of(performed("wave"))[0].angles_rad[ARM]
    return Pose(pose.root_m, pose.root_rotation, angles)


def test_an_arm_is_found_where_it_is_seen(resampler, observer, truth):
    wrong = [lowered(pose) for pose in truth]
    pose_frames = [
        pose_frame(observer, pose, seen, 0.1 * k)
        for k, (pose, seen) in enumerate(zip(wrong, truth, strict=True))
    ]
    result = resampler.resample(pose_frames)
    before, after = apart_mm(wrong, truth), apart_mm([one.pose for one in result], truth)
    assert before.max() > 250
    assert after.max() < 160 and after.mean() < 25
    for one, given in zip(result, pose_frames, strict=True):
        assert (one.pose.root_m == given.pose.root_m).all() and one.observed is given.observed


def test_what_is_right_stays(resampler, observer, truth):
    result = resampler.resample(
        [pose_frame(observer, pose, pose, 0.1 * k) for k, pose in enumerate(truth)]
    )
    assert apart_mm([one.pose for one in result], truth).mean() < 15


@pytest.mark.parametrize("continued", [False, True])
def test_refinement_draws_poses_onto_their_contours(resampler, observer, truth, continued):
    rng = np.random.default_rng(2)
    off = []
    for pose in truth:
        step = np.concatenate(
            [rng.normal(0, 0.02, 3), rng.normal(0, 0.03, 3), rng.normal(0, 0.08, MODEL.dof_count)]
        )
        step[6:][MODEL.dof_fixed] = 0
        off.append(pose.moved(step).clipped())
    pose_frames = [
        pose_frame(observer, pose, seen, 0.1 * k)
        for k, (pose, seen) in enumerate(zip(off, truth, strict=True))
    ]
    before = PoseFrame(truth[0], replace(pose_frames[0].observed, time_s=-0.1))
    refined = resampler.refine(pose_frames, before if continued else None)
    at_first, at_last = (
        np.mean([one.observed.weights.distances(MODEL, [one.pose])[0] for one in frames])
        for frames in (pose_frames, refined)
    )
    assert at_last < 0.5 * at_first
    assert apart_mm([frame.pose for frame in refined], truth).mean() < apart_mm(off, truth).mean()
