"""Poses of one camera's silhouettes, where no track is begun yet."""

import numpy as np
import pytest

from silhouette_core.monocular.silhouette_proposer import SilhouetteProposer
from silhouette_core.monocular.tracking.body_heading import body_headings
from silhouette_core.refinement.proposed_poses import load_pose_proposer
from tests.silhouette_core.monocular.filming import STATURE_M, camera_at, films, performed

CAMERA = camera_at((0.0, 4.0, 1.4))
ROWS = range(0, 24, 2)


def test_somebody_who_walks_is_proposed_as_filmed():
    """Turned as they are, and where they are: nobody told how far away."""
    walk = performed("walk")
    frames = [(row / 30, mask) for row, mask in zip(ROWS, films(walk, CAMERA, ROWS), strict=True)]
    found = SilhouetteProposer().propose(CAMERA, STATURE_M, frames)
    truth = walk.landmarks()[list(ROWS)]
    likeliest = np.stack([one.likeliest for one in found if one is not None])
    turned = body_headings(likeliest[:, None])[:, 0] - body_headings(truth[:, None])[:, 0]
    assert len(likeliest) == len(truth) and (np.cos(turned) > 0.7).all()
    away = np.linalg.norm(likeliest[:, 0] - CAMERA.center_m, axis=1)
    assert away == pytest.approx(np.linalg.norm(truth[:, 0] - CAMERA.center_m, axis=1), rel=0.1)


def test_who_is_taller_is_farther_away():
    mask = films(performed("walk"), CAMERA, [0])[0]
    usual, tall = (
        load_pose_proposer().propose(CAMERA, stature, [(0.0, mask)])[0]
        for stature in (STATURE_M, 1.2 * STATURE_M)
    )
    assert usual is not None and tall is not None
    away = [np.linalg.norm(one.likeliest[0] - CAMERA.center_m) for one in (usual, tall)]
    assert away[1] / away[0] == pytest.approx(1.2, rel=0.02)


def test_frames_that_show_nobody_have_no_pose():
    mask = films(performed("walk"), CAMERA, [0])[0]
    found = SilhouetteProposer().propose(CAMERA, STATURE_M, [(0.0, mask), (0.1, 0 * mask > 0)])
    assert found[0] is not None and found[1] is None
    assert SilhouetteProposer().propose(CAMERA, STATURE_M, [(0.0, 0 * mask > 0)]) == [None]
