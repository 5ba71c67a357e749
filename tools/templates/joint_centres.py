"""Learns where joint centres lie in the template bodies, as silhouettes show these.

Usage: `python -m tools.templates.joint_centres --bodies FOLDER --motion FOLDER`, 20 minutes on two
cores. The folders are MakeHuman's data (CC0) and recorded motion. The same folders give the same
file, for any number of processes.

Bodies of either sex are drawn over the middle of the range, half of them in wide clothes, posed as
recorded people were, and seen by three to six cameras. A template is adapted to their silhouettes,
whose outlines waver, as `fit` does it, each pose by itself; what is kept is where their joints lie
in its parts. Both sexes are in it for either template, since silhouettes alone hardly tell them
apart. Printed are mean errors of the joints relative to the pelvis: as they are, and moved by what
the other bodies gave.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save_file

from calib.camera import Camera, Rig
from silhouette_core.body.joint_centres import FILE, JointCentres
from silhouette_core.body.joints import EXCHANGED_LANDMARKS
from silhouette_core.body.model import BodyModel, read_template
from silhouette_core.body.rigs.makehuman import MakeHumanPerson, read_makehuman
from silhouette_core.body.shape import vertex_normals
from silhouette_core.body.sizes import SHAPE_SIGMA, BodySizes
from silhouette_core.monocular.making.from_motion import read_clips
from silhouette_core.motion.kinematics import landmarks
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.adaptation import Stature, adapt_shape
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import load_backend
from silhouette_core.scoring.silhouette_error import body_masks
from tools.templates.make_templates import sort_header

WIDTH, NOISE = 3.0, 0.3
"""Of the Gaussian process, in standard deviations of people, and as a share of its variance; chosen
by errors of recordings, see docs/decisions.md.
"""
LOWEST, HIGHEST = (-0.5, -0.4, -0.5), (0.5, 0.6, 0.5)  # height, weight, muscle; extremes are rare
BODIES, POSES, FEWEST_CAMERAS, MOST_CAMERAS = 96, 8, 3, 6  # bodies of each sex
OUTLINE_PX, WAVE_PX = 1.5, 16
CLOTHES_M = 0.010, 0.035  # of those who wear wide ones
STATURE_SIGMA_M = 0.006
BARE = "head neck forearm hand thumb fingers foot toes".split()
MIRROR = np.array([-1.0, 1.0, 1.0])
FloatArray = NDArray[np.float64]


def draw_body(rng: np.random.Generator, sex: str, bodies: Path) -> BodyModel:
    """A body drawn at random on the human tree, half of them in wide clothes."""
    height, weight, muscle = rng.uniform(LOWEST, HIGHEST).tolist()
    origin = ("asian", "caucasian")[rng.integers(2)]
    person = MakeHumanPerson(sex, height, weight, muscle, origin)
    body = read_makehuman(bodies, person, human=True)
    thick_m = rng.uniform(*CLOTHES_M) * rng.integers(2)
    bare = np.array([name.split("_", 1)[-1] in BARE for name in body.names])
    share = 1 - (body.skin_weights * bare[body.skin_parts]).sum(1, keepdims=True)
    outward = vertex_normals(body.vertices_m, body.faces)
    return replace(body, vertices_m=body.vertices_m + thick_m * share * outward)


def draw_rig(rng: np.random.Generator) -> Rig:
    """Cameras about a body that stands on z = 0."""
    cameras = []
    count = int(rng.integers(FEWEST_CAMERAS, MOST_CAMERAS + 1))
    for k in range(count):
        turn = 2 * np.pi * (k + rng.uniform(-0.3, 0.3)) / count
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


def outlined(mask: NDArray[np.bool_], rng: np.random.Generator) -> NDArray[np.bool_]:
    """A silhouette (h, w) whose outline wavers as in recorded pictures."""
    inside, outside = (
        cv2.distanceTransform(part.astype(np.uint8), cv2.DIST_L2, 5) for part in (mask, ~mask)
    )
    height, width = mask.shape
    coarse = rng.normal(scale=OUTLINE_PX, size=(height // WAVE_PX, width // WAVE_PX))
    moved = cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)
    return inside - outside + moved > 0


@dataclass(frozen=True, eq=False)
class Adapted:
    """A template adapted to a body in N poses."""

    shape: FloatArray  #: (K,), in standard deviations of people.
    apart: FloatArray  #: (N, 15, 3), true joints relative to the template's, world, in statures.
    turn: FloatArray  #: (N, 15, 3, 3), rotations of the joints' parts.
    stature_m: float

    @property
    def offsets(self) -> FloatArray:
        """Places (15, 3) of the true joints in the template's parts, the same on both sides."""
        places = np.einsum("tlij,tli->lj", self.turn, self.apart) / len(self.turn)
        return 0.5 * (places + places[EXCHANGED_LANDMARKS] * MIRROR)

    def error_mm(self, offsets: FloatArray) -> float:
        """Mean error of the joints relative to the pelvis, once they are moved by offsets."""
        left = self.apart - np.einsum("tlij,lj->tli", self.turn, offsets)
        error = np.linalg.norm(left - left[:, :1], axis=-1)[:, 1:].mean()
        return 1000 * self.stature_m * float(error)


def adapt(job: tuple[int, str], template_sex: str, bodies: Path, angles: FloatArray) -> Adapted:
    """Adapts a template to a body drawn by a seed, of a sex, in some of the poses (N, D)."""
    cv2.setNumThreads(1)
    seed, sex = job
    rng, backend = np.random.default_rng([seed, sex == "female"]), load_backend("cpu")
    body, views = draw_body(rng, sex, bodies), PinholeViews.from_rig(draw_rig(rng))
    stature_m = float(np.ptp(body.vertices_m[:, 2]))
    chosen = angles[rng.choice(len(angles), POSES, replace=False)]
    poses = [Pose(body.joints_m[0] * [0, 0, 1], np.eye(3), one) for one in chosen]
    observations = [
        Observation.from_masks(
            views, [outlined(mask, rng) for mask in body_masks(body, one, views, backend)]
        )
        for one in poses
    ]
    model = read_template(template_sex).scaled(stature_m)
    stature, covariance = Stature(stature_m, STATURE_SIGMA_M), np.diag(SHAPE_SIGMA**2)
    surface, adapted = adapt_shape(
        Surface(model), observations, poses, stature, model.shape, covariance
    )
    true, _ = _landmarks(body, poses)
    estimated, turn = _landmarks(surface.model, adapted)
    return Adapted(
        surface.model.shape / SHAPE_SIGMA, (true - estimated) / stature_m, turn, stature_m
    )


def _landmarks(model: BodyModel, poses: Sequence[Pose]) -> tuple[FloatArray, FloatArray]:
    """Landmarks (T, 15, 3), world, and rotations (T, 15, 3, 3) of their parts."""
    posed = Surface(model, 8).posed_many(PoseArrays.from_poses(poses))
    marks = landmarks(model, posed.part_rotation, posed.part_origin)
    return marks, posed.part_rotation[:, model.tree.landmark_part]


def learn(shapes: FloatArray, offsets: FloatArray) -> JointCentres:
    """The Gaussian process of shapes (N, K) and offsets (N, L, 3)."""
    kernel = JointCentres(shapes, offsets, WIDTH).kernel(shapes)
    weights = np.linalg.solve(
        kernel + NOISE * np.eye(len(shapes)), offsets.reshape(len(shapes), -1)
    )
    return JointCentres(shapes, weights.reshape(offsets.shape).astype(float), WIDTH)


def main() -> None:
    """Writes the file, and prints the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--bodies", type=Path, required=True, help="MakeHuman's data folder")
    parser.add_argument("--motion", type=Path, required=True, help="folder of recorded motion")
    given = parser.parse_args()
    clips = read_clips([given.motion], BodyModel.from_sizes(BodySizes(1.75)))
    angles = np.concatenate([clips[name].angles_rad for name in sorted(clips)])
    jobs = [(seed, sex) for seed in range(BODIES) for sex in ("male", "female")]
    arrays, about = {}, {"source": "MakeHuman's bodies (CC0), recorded motion of CMU"}
    print(f"{'template':<10}{'men':>14}{'women':>14}   mm, as it is, and moved")
    for name, template_sex in (("man", "male"), ("woman", "female")):
        one_job = partial(adapt, template_sex=template_sex, bodies=given.bodies, angles=angles)
        with ProcessPoolExecutor() as pool:
            adapted = list(pool.map(one_job, jobs))
        shapes, offsets = (
            np.array([getattr(one, key) for one in adapted]) for key in ("shape", "offsets")
        )
        errors = []
        for k, one in enumerate(adapted):
            others = np.arange(len(adapted)) // 2 != k // 2
            centres = learn(shapes[others], offsets[others])
            moved = centres.offsets(one.shape * SHAPE_SIGMA)
            errors.append((one.error_mm(np.zeros_like(moved)), one.error_mm(moved)))
        columns = "".join(
            f"{before:>8.1f}{after:>6.1f}"
            for before, after in (np.mean(errors[sex::2], axis=0) for sex in (0, 1))
        )
        print(f"{name:<10}{columns}", flush=True)
        centres = learn(shapes, offsets)
        arrays |= {
            f"{name}_{key}": getattr(centres, key).astype(np.float32)
            for key in ("shapes", "weights")
        }
        about[f"{name}_width"] = str(WIDTH)
    save_file(arrays, FILE, about)
    sort_header(FILE)


if __name__ == "__main__":
    main()
