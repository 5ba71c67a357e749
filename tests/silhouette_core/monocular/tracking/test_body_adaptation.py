"""The body, adapted to the frames of one camera."""

from dataclasses import replace

import numpy as np
import pytest

from calib.camera import Rig
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import SHAPE_AXES, BodySizes
from silhouette_core.monocular.tracking.body_adaptation import adapted_body, shod_scale
from silhouette_core.monocular.tracking.pose_modes import FrameModes
from silhouette_core.motion.motion_file import read_motion, write_motion
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.silhouette_error import silhouette_error
from tests.silhouette_core.monocular.filming import (
    STATURE_M,
    body,
    camera_at,
    films,
    performed,
    poses_of,
    prior_at,
    silhouette,
)

CAMERA = camera_at((0.6, -4.0, 1.5))
VIEWS = PinholeViews.from_rig(Rig((CAMERA,)))
NAMES = [axis.name for axis in SHAPE_AXES]
STOUT = {"trunk_width": 0.25, "trunk_depth": 0.2, "thigh_girth": 0.3, "shin_girth": 0.2}


def modes_at(landmarks_m: np.ndarray) -> list[FrameModes]:
    """One mode a frame, at joints (T, 15, 3)."""
    return [FrameModes(np.ones(1), [prior_at(joints, 0.05)], 4.0) for joints in landmarks_m]


def test_a_stout_person_gets_a_stout_body():
    """The proposal is wrong by 3 cm at every joint, in every frame otherwise."""
    true = body([STOUT.get(name, 0.0) for name in NAMES])
    motion, rng = performed("wave", true), np.random.default_rng(0)
    poses, rows = poses_of(motion), range(0, 40, 4)
    masks = [silhouette(true, poses[row], CAMERA) for row in rows]
    modes = modes_at(motion.landmarks()[list(rows)] + rng.normal(0, 0.03, (10, 15, 3)))
    found = adapted_body(body(), ("male",), VIEWS, masks, modes, CpuBackend())
    gained = {name: found.shape[NAMES.index(name)] for name in STOUT}
    assert all(value > 0.08 for value in gained.values()), gained
    assert found.sizes.stature_m == pytest.approx(true.sizes.stature_m, rel=0.006)

    seen = [Observation.from_masks(VIEWS, [mask]) for mask in masks]

    def error(model):
        pairs = zip(rows, seen, strict=True)
        return np.mean([silhouette_error(model, poses[k], one, CpuBackend()) for k, one in pairs])

    assert error(found) < 0.6 * error(body())


def test_who_is_shod_is_taller_than_stated(tmp_path):
    """A person of 1.80 m, said to be of 1.75 m, and put nearer by as much."""
    true = BodyModel.from_sizes(BodySizes(1.80))
    motion, rows = performed("wave", true), range(0, 40, 4)
    masks = films(motion, CAMERA, rows)
    center = CAMERA.center_m
    seen_m = center + (motion.landmarks()[list(rows)] - center) * (STATURE_M / 1.80)
    found = adapted_body(body(), ("male",), VIEWS, masks, modes_at(seen_m), CpuBackend())
    assert 1.76 < found.sizes.stature_m < 1.80
    path = tmp_path / "motion.safetensors"
    write_motion(replace(motion, model=found), path)
    assert np.allclose(read_motion(path).model.vertices_m, found.vertices_m)


def test_feet_above_the_floor_tell_how_much_taller_a_person_is():
    camera_m, standing = 1.5, np.zeros(10)
    assert shod_scale(standing, camera_m) == 1.0
    taller = shod_scale(camera_m * (1 - 1 / 1.03) + standing, camera_m)
    assert 1.012 < taller < 1.03
    higher = shod_scale(2 * camera_m * (1 - 1 / 1.03) + standing, 2 * camera_m)
    assert taller < higher < 1.03  # from higher up the same error lifts the feet more


@pytest.mark.parametrize(
    ("lowest_m", "camera_m"),
    [
        pytest.param(-0.06, 1.5, id="a foot before the other"),
        pytest.param(0.50, 1.5, id="on a ladder, or z = 0 is not the floor"),
        pytest.param(0.06, 0.1, id="a camera at the floor"),
    ],
)
def test_nobody_is_taller_for_feet_that_do_not_stand_or_are_seen_from_the_floor(lowest_m, camera_m):
    assert shod_scale(np.full(10, lowest_m), camera_m) == 1.0


def test_who_jumps_is_hardly_taller():
    jumping = np.array([-0.05, -0.02, 0.0, 0.03, 0.06, 0.07, 0.09, 0.2, 0.3, 0.4])
    standing = np.full(10, np.median(jumping))
    assert shod_scale(jumping, 1.5) - 1 < 0.4 * (shod_scale(standing, 1.5) - 1)
