"""What stays the same from call to call is handed to a scoring backend as the same object, and is
not written to: a device may keep a copy.
"""

from collections import defaultdict
from inspect import signature

import numpy as np

from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CpuBackend
from tests.outside import METHODS
from tests.voxelpose.multiview.matching_scenes import fitting_model, hull, photograph, stance, views
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings
from voxelpose.multiview.proposers.pose_search import BodyGeometry, find_pose


def test_a_search_hands_over_the_same_objects(monkeypatch):
    seen = defaultdict(dict)  # what was given to an argument, and a copy of it, by identity

    def noted(name, method):
        arguments = [*signature(getattr(Backend, name)).parameters][1:]

        def call(self, *given, **named):
            for argument, one in zip(arguments, given, strict=False):
                if isinstance(one, np.ndarray):
                    first, copy = seen[name, argument].setdefault(id(one), (one, one.copy()))
                    assert argument == "numbers" or np.array_equal(first, copy)
            return method(self, *given, **named)

        return call

    for name in METHODS:
        monkeypatch.setattr(CpuBackend, name, noted(name, getattr(CpuBackend, name)))
    surface, seen_by, voxel_size_m = Surface(fitting_model(), 600), views(4), 0.04
    body = BodyGeometry.from_surface(surface, voxel_size_m, "cpu")
    for degrees in (20.0, 50.0):
        truth = stance(surface.model, {"left_upper_arm.abduction": degrees})
        images = photograph(seen_by, surface.model, truth)
        voxels = hull(seen_by, surface.model, truth, voxel_size_m)
        frame = FrameObservation(seen_by, images, *voxels)
        assert find_pose(body, frame, MatchSettings(np.radians(25.0)), 2)
    limbs = len(body.body_volume.limbs)
    counts = {key: len(objects) for key, objects in seen.items()}
    assert counts["silhouette_errors", "faces"] == 1
    assert 4 <= counts["voxel_cover", "points"] <= limbs
    assert 4 <= counts["pixel_scores", "points"] <= limbs
    assert counts["voxel_overlap", "occupancy"] == 2
    assert counts["voxel_overlap", "points"] <= 4
