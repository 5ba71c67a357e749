"""A pose from nothing but one frame: torso placements, paper B's matching for each, refinement, and
the silhouettes as judge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from silhouette_core.body.model import BodyModel
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.pose import Pose
from silhouette_core.refinement.refine import PosePrior, RefineSettings, refine
from silhouette_core.refinement.silhouette_error import silhouette_error
from silhouette_core.refinement.surface import Surface
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.body_volume import BodyVolume
from voxelpose.matching.limb_search import CHAINS, place_limb
from voxelpose.matching.matcher import MatchSettings, match
from voxelpose.matching.torso_search import find_torso

_QUICK = RefineSettings(reaches_m=(0.30, 0.25, 0.20, 0.15, 0.12, 0.10, 0.08))
_SHORT = RefineSettings(reaches_m=(0.15, 0.10, 0.08, 0.06))


@dataclass(frozen=True, eq=False)
class FittingBody:
    """One body prepared for both kinds of fitting: the model, its inside as points, its surface as
    points.
    """

    model: BodyModel
    body_volume: BodyVolume
    surface: Surface

    @classmethod
    def of(cls, model: BodyModel, voxel_size_m: float) -> FittingBody:
        """Prepares a body for voxels of that size."""
        return cls(model, BodyVolume.of(model, voxel_size_m), Surface(model))


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A pose and the share of the silhouettes (XOR over OR, mean of the cameras) that it does not
    explain.
    """

    pose: Pose
    error: float


def find_pose(
    body: FittingBody,
    observation: Observation,
    grid: VoxelGrid,
    occupancy: np.ndarray,
    settings: MatchSettings | None = None,
    count: int = 10,
) -> list[PoseFit]:
    """Searches the whole range of postures.

    Args:
        body: prepared body.
        observation: the frame's silhouettes.
        grid: the voxels' places.
        occupancy: (nx, ny, nz) bool, the hull.
        settings: of the matcher.
        count: torso placements to try.

    Returns:
        Poses, best first, at most one per torso placement; empty where there is no hull.
    """
    first = [
        _improve(body, observation, grid, occupancy, start, settings)
        for start in find_torso(body.body_volume, grid, occupancy, count)
    ]
    first.sort(key=lambda found: found.error)
    # With the torso now well placed the limbs are matched once more; where that is no better, the
    # first answer stands.
    again = [
        _improve(body, observation, grid, occupancy, found.pose, settings) for found in first[:3]
    ]
    ranked = sorted([*again, *first], key=lambda found: found.error)
    return sorted(
        [*(move_limbs(body, observation, found) for found in ranked[:2]), *ranked[2:]],
        key=lambda found: found.error,
    )


def move_limbs(
    body: FittingBody, observation: Observation, found: PoseFit, prior: PosePrior | None = None
) -> PoseFit:
    """Looks for each arm and leg on the silhouettes, and keeps what lowers the error."""
    for chain in CHAINS:
        moved = place_limb(body.body_volume, observation, found.pose, chain)
        pose = refine(body.surface, observation, moved, prior, _SHORT).pose
        error = silhouette_error(body.model, pose, observation)
        if error < 0.99 * found.error:
            found = PoseFit(pose, error)
    return found


def _improve(
    body: FittingBody,
    observation: Observation,
    grid: VoxelGrid,
    occupancy: np.ndarray,
    start: Pose,
    settings: MatchSettings | None,
) -> PoseFit:
    matched = match(body.body_volume, grid, occupancy, start, settings)
    pose = refine(body.surface, observation, matched.pose, settings=_QUICK).pose
    return PoseFit(pose, silhouette_error(body.model, pose, observation))
