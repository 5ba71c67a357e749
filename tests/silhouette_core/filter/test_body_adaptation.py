"""The body, adapted to the frames of one camera."""

import numpy as np

from calib.camera import Rig
from silhouette_core.body.sizes import SHAPE_AXES
from silhouette_core.filter.body_adaptation import adapted_body
from silhouette_core.filter.pose_modes import FrameModes
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import Observation, PinholeViews
from silhouette_core.scoring.silhouette_error import silhouette_error
from tests.silhouette_core.filter.filming import body, camera_at, performed, poses_of, silhouette

CAMERA = camera_at((0.6, -4.0, 1.5))
VIEWS = PinholeViews.from_rig(Rig((CAMERA,)))
NAMES = [axis.name for axis in SHAPE_AXES]
STOUT = {"trunk_width": 0.25, "trunk_depth": 0.2, "thigh_girth": 0.3, "shin_girth": 0.2}


def test_a_stout_person_gets_a_stout_body():
    """The proposal is wrong by 3 cm at every joint, in every frame otherwise."""
    true = body([STOUT.get(name, 0.0) for name in NAMES])
    motion, rng = performed("wave", true), np.random.default_rng(0)
    poses, rows = poses_of(motion), range(0, 40, 4)
    masks = [silhouette(true, poses[row], CAMERA) for row in rows]
    precision = np.tile(np.eye(3) / 0.05**2, (15, 1, 1))
    modes = []
    for joints in motion.landmarks()[list(rows)]:
        joints = joints + rng.normal(0, 0.03, joints.shape)
        prior = LandmarkPrior(joints - joints[0], precision, joints[0], precision[0])
        modes.append(FrameModes(np.ones(1), [prior], 4.0))
    found = adapted_body(body(), ("male",), VIEWS, masks, modes)
    gained = {name: found.shape[NAMES.index(name)] for name in STOUT}
    assert all(value > 0.08 for value in gained.values()), gained
    assert found.sizes.stature_m == true.sizes.stature_m

    def error(model):
        observed = zip(rows, masks, strict=True)
        return np.mean(
            [
                silhouette_error(model, poses[row], Observation.from_masks(VIEWS, [mask]))
                for row, mask in observed
            ]
        )

    assert error(found) < 0.6 * error(body())
