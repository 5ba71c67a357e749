"""What the shape space holds, and what a regression of the joints' places on it would give.

Usage: `python -m benchmarks.joint_places [--ridge BODIES]`, five minutes on two cores.

Bodies of either sex are drawn at random from ../shared/data (MakeHuman, CC0), half of them in wide
clothes, posed as recorded people were, and seen by four cameras. A template is adapted to their
exact silhouettes as `fit` does it, each pose by itself. The first row of a template is the mean
error of its joints as they are, relative to the pelvis. The others are errors with joints that a
ridge regression on the shape has placed, once and twice, on the bodies from which it is learned.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from silhouette_core.body.joints import LANDMARK_NAMES, LANDMARK_PART, PART_NAMES, exchanged_sides
from silhouette_core.body.model import BodyModel, read_template
from silhouette_core.body.rigs.makehuman import MakeHumanPerson, read_makehuman
from silhouette_core.body.shape import ShapeSpace, vertex_normals
from silhouette_core.body.sizes import SHAPE_SIGMA, BodySizes
from silhouette_core.monocular.making.from_motion import read_clips
from silhouette_core.motion.kinematics import landmarks
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.adaptation import Stature, adapt_shape
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import load_backend
from silhouette_core.scoring.silhouette_error import body_masks

SHARED = Path(os.environ.get("VOXELPOSE_SHARED", Path(__file__).resolve().parents[2] / "shared"))
BODIES, POSES, CAMERAS, ROUNDS = 24, 8, 4, 3  # bodies of each sex
CLOTHES_M = 0.010, 0.035  # of those who wear wide ones
STATURE_SIGMA_M = 0.006
BARE = "head neck forearm hand thumb fingers foot toes".split()
TOP = LANDMARK_NAMES.index("head_top")  # stays, as its height is the stature
MIRROR = np.array([-1.0, 1.0, 1.0])
EXCHANGED_PARTS = np.array(exchanged_sides(PART_NAMES))
Places = NDArray[np.float64]
"""(1 + K, 27, 3), what is added to a template's joints, over its stature: at rest, and per unit
deviation along its K shape axes.
"""


def template(sex: str, places: Places, stature_m: float) -> BodyModel:
    """A template with other places of its joints, as tall as a person."""
    body = read_template(sex)
    added_m = body.length_m * places
    joints, marks = body.joints_m + added_m[0], body.landmarks_m + added_m[0, LANDMARK_PART]
    space = ShapeSpace.from_rest(
        joints, body.vertices_m, marks, body.skin_parts, body.skin_weights, body.faces
    )
    space = replace(
        space,
        joints_change=space.joints_change + added_m[1:],
        landmarks_change=space.landmarks_change + added_m[1:, LANDMARK_PART],
    )
    return replace(body, joints_m=joints, landmarks_m=marks, space=space).scaled(stature_m)


def draw_body(rng: np.random.Generator, sex: str) -> BodyModel:
    """A body drawn at random on the human tree, half of them in wide clothes."""
    height, weight, muscle = rng.uniform((-0.5, -0.4, -0.5), (0.5, 0.6, 0.5)).tolist()
    origin = ("asian", "caucasian")[rng.integers(2)]
    person = MakeHumanPerson(sex, height, weight, muscle, origin)
    body = read_makehuman(SHARED / "data" / "makehuman", person, human=True)
    thick_m = rng.uniform(*CLOTHES_M) * rng.integers(2)
    bare = np.array([name.split("_", 1)[-1] in BARE for name in body.names])
    share = 1 - (body.skin_weights * bare[body.skin_parts]).sum(1, keepdims=True)
    outward = vertex_normals(body.vertices_m, body.faces)
    return replace(body, vertices_m=body.vertices_m + thick_m * share * outward)


def draw_rig(rng: np.random.Generator) -> Rig:
    """Cameras about a body that stands on z = 0."""
    cameras = []
    for k in range(CAMERAS):
        turn = 2 * np.pi * (k + rng.uniform(-0.3, 0.3)) / CAMERAS
        radius, height = rng.uniform((3.9, 0.9), (4.9, 2.7))
        centre = np.array([radius * np.cos(turn), radius * np.sin(turn), height])
        forward = np.array([0, 0, 0.95]) - centre
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0, 0, 1])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(forward, right), forward])
        focal = rng.uniform(540, 600)
        matrix = np.array([[focal, 0, 320], [0, focal, 240], [0, 0, 1]])
        moved = -rotation @ centre
        cameras.append(Camera(f"cam_{k}", (640, 480), matrix, np.zeros(0), rotation, moved))
    return Rig(tuple(cameras))


@dataclass(frozen=True, eq=False)
class Adapted:
    """What an adapted template tells: its shape (K,) and places (27, 3) of a body's joints in it,
    relative to its own, over the stature; mean error of its joints relative to the pelvis, m.
    """

    shape: NDArray[np.float64]
    beside: NDArray[np.float64]
    error_m: float


def adapt(
    job: tuple[int, str], template_sex: str, angles: NDArray[np.float64], now: Places
) -> Adapted:
    """Adapts a template to a body drawn by a seed, of a sex, in some of the poses (N, D)."""
    cv2.setNumThreads(1)
    seed, sex = job
    rng, backend = np.random.default_rng([seed, sex == "female"]), load_backend("cpu")
    body, views = draw_body(rng, sex), PinholeViews.from_rig(draw_rig(rng))
    stature_m = float(np.ptp(body.vertices_m[:, 2]))
    chosen = angles[rng.choice(len(angles), POSES, replace=False)]
    poses = [Pose(body.joints_m[0] * [0, 0, 1], np.eye(3), one) for one in chosen]
    observations = [
        Observation.from_masks(views, body_masks(body, one, views, backend)) for one in poses
    ]
    model = template(template_sex, now, stature_m)
    stature, covariance = Stature(stature_m, STATURE_SIGMA_M), np.diag(SHAPE_SIGMA**2)
    surface, adapted = adapt_shape(
        Surface(model), observations, poses, stature, model.shape, covariance
    )
    true, _ = _landmarks(body, poses)
    estimated, turn = _landmarks(surface.model, adapted)
    apart = true - estimated
    error = np.linalg.norm(apart - apart[:, :1], axis=-1)[:, 1:].mean()
    places = np.einsum("tlij,tli->lj", turn, apart) / len(poses) / stature_m
    joints = np.zeros((len(PART_NAMES), 3))
    turning = np.arange(len(places)) != TOP
    joints[LANDMARK_PART[turning]] = places[turning]
    mirrored = joints[EXCHANGED_PARTS] * MIRROR
    return Adapted(surface.model.shape, 0.5 * (joints + mirrored), float(error))


def _landmarks(
    model: BodyModel, poses: Sequence[Pose]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Landmarks (T, 15, 3), world, and rotations (T, 15, 3, 3) of their parts."""
    posed = Surface(model, 8).posed_many(PoseArrays.from_poses(poses))
    marks = landmarks(model, posed.part_rotation, posed.part_origin)
    return marks, posed.part_rotation[:, LANDMARK_PART]


def regression(shapes: NDArray[np.float64], places: NDArray[np.float64], ridge: float) -> Places:
    """Ridge regression of places (N, 27, 3) on shapes (N, K) in standard deviations of people."""
    middle, mean = shapes.mean(0), places.mean(0)
    scaled = (shapes - middle) / SHAPE_SIGMA
    matrix = scaled.T @ scaled + ridge * np.eye(len(middle))
    slopes = np.linalg.solve(matrix, scaled.T @ (places - mean).reshape(len(places), -1))
    slopes = slopes.reshape(-1, *mean.shape) / SHAPE_SIGMA[:, None, None]
    return np.concatenate([[mean - np.tensordot(middle, slopes, 1)], slopes])


def report(template_sex: str, angles: NDArray[np.float64], ridge: float) -> None:
    """Prints the errors of a sex's template."""
    now = np.zeros((1 + len(SHAPE_SIGMA), len(PART_NAMES), 3))
    jobs = [(seed, sex) for seed in range(BODIES) for sex in ("male", "female")]
    for _ in range(ROUNDS):
        with ProcessPoolExecutor() as pool:
            one_job = partial(adapt, template_sex=template_sex, angles=angles, now=now)
            bodies = list(pool.map(one_job, jobs))
        men, women = (1000 * np.mean([one.error_m for one in bodies[k::2]]) for k in (0, 1))
        print(f"{template_sex:<10}{men:>8.1f}{women:>8.1f}", flush=True)
        shapes = np.array([one.shape for one in bodies])
        places = now[0] + np.tensordot(shapes, now[1:], 1)
        now = regression(shapes, places + np.array([one.beside for one in bodies]), ridge)


def main() -> int:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--ridge", type=float, default=100.0, help="penalty of a slope, in bodies")
    given = parser.parse_args()
    if not (SHARED / "data" / "makehuman").is_dir():
        print(f"{SHARED / 'data' / 'makehuman'} is absent: nothing to draw", file=sys.stderr)
        return 2
    clips = read_clips([SHARED / "data" / "mocap"], BodyModel.from_sizes(BodySizes(1.75)))
    angles = np.concatenate([clips[name].angles_rad for name in sorted(clips)])
    print(f"{'template':<10}{'men':>8}{'women':>8}   mm, rows: as it is, placed once, twice")
    for template_sex in ("male", "female"):
        report(template_sex, angles, given.ridge)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
