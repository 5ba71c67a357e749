"""Search for a sitting person's pose. Beside a chair the thickest part of a hull may be no torso,
and its thin ones no legs.
"""

from __future__ import annotations

from operator import attrgetter

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.dynamics import relaxed_rad
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.refine import RefineStart
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.pose_search import (
    MORE_PLACEMENTS,
    SEARCHED,
    BodyGeometry,
    PoseFit,
    move_limbs,
    refine_fits,
)
from voxelpose.multiview.matching.torso_search import find_torso

_HEADINGS, _BEST = 12, 5


def find_sitting_pose(body: BodyGeometry, frame: FrameObservation) -> list[PoseFit]:
    """Poses near an upright chair's, best first: the legs begin as a sitting person's and are not
    searched in the hull, where they would be found in a chair's.
    """
    model, points = body.model, frame.grid.occupied_points(frame.occupancy)
    angles = relaxed_rad(model.tree).copy()
    bent_deg = {"thigh.flexion": 80, "thigh.abduction": 8, "shin.flexion": 80}  # on a chair
    for k, name in enumerate(model.tree.dof_names):
        joint = name.partition("_")[2]
        if joint in bent_deg:
            angles[k] = np.radians(bent_deg[joint])
    root = _below_head(model, points)
    headings_deg = np.arange(_HEADINGS) * 360 / _HEADINGS
    places = [(root, Rotation.from_euler("z", h, degrees=True).as_matrix()) for h in headings_deg]
    torsos = find_torso(body.body_volume, frame.grid, frame.occupancy, MORE_PLACEMENTS)
    places += [(torso.root_m, torso.root_rotation) for torso in torsos]
    starts = [RefineStart(Pose(*place, angles), SEARCHED) for place in places]
    fits = sorted(refine_fits(body, frame.observation, starts), key=attrgetter("error"))
    moved = [move_limbs(body, frame.observation, fit) for fit in fits[:_BEST]]
    return sorted(moved, key=attrgetter("error"))


def _below_head(model: BodyModel, points_m: np.ndarray) -> np.ndarray:
    """Where the root (3,) of an upright body is whose head is the top of a hull (n, 3)."""
    top_m = points_m[:, 2].max()
    half_head_m = 0.12
    head = points_m[points_m[:, 2] > top_m - half_head_m]
    trunk_m = model.vertices_m[:, 2].max() - model.joints_m[0, 2]
    return np.append(np.median(head[:, :2], axis=0), top_m - trunk_m)
