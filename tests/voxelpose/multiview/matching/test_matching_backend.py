"""The multi-view searches score through the backend of the body that they are given."""

import numpy as np
import pytest

from silhouette_core.refinement.surface import Surface
from tests.outside import record_calls
from tests.silhouette_core.scoring.outside_backend import ArrayBackend
from tests.voxelpose.multiview.matching_scenes import fitting_model, hull, photograph, stance, views
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.matching.pose_search import BodyGeometry, find_pose
from voxelpose.multiview.quality.quality import assess


@pytest.mark.slow
def test_the_same_pose_by_a_backend_from_outside(monkeypatch):
    surface, seen_by, voxel_size_m = Surface(fitting_model(), 600), views(4), 0.04
    truth = stance(surface.model, {"left_upper_arm.abduction": 20.0})
    frame = FrameObservation(
        seen_by,
        photograph(seen_by, surface.model, truth),
        *hull(seen_by, surface.model, truth, voxel_size_m),
    )

    def fitted(*backend):
        body = BodyGeometry.from_surface(surface, voxel_size_m, *backend)
        best = find_pose(body, frame, MatchSettings(np.radians(25.0)), 2)[0]
        return best, assess(body.body_volume, best.pose, frame)

    expected, overlap = fitted()
    called = record_calls(monkeypatch)
    result, again = fitted(ArrayBackend())
    np.testing.assert_allclose(result.pose.angles_rad, expected.pose.angles_rad, atol=1e-6)
    np.testing.assert_allclose(again.part_overlap, overlap.part_overlap)
    assert called == set(
        "voxel_overlap voxel_cover pixel_scores silhouette_errors part_images".split()
    )
