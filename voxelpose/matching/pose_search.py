"""Pose of a single frame without a prior: torso placements, paper B's matching, refinement."""

from __future__ import annotations

from dataclasses import dataclass

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import PosePrior, RefineSettings, refine
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend
from silhouette_core.scoring.cpu import CPU
from silhouette_core.scoring.silhouette_error import silhouette_error
from voxelpose.matching.body_volume import BodyVolume
from voxelpose.matching.limb_search import CHAINS, place_limb
from voxelpose.matching.matcher import MatchSettings, match
from voxelpose.matching.observe import FrameObservation
from voxelpose.matching.torso_search import find_torso

_QUICK = RefineSettings(reaches_m=(0.30, 0.25, 0.20, 0.15, 0.12, 0.10, 0.08))
_SHORT = RefineSettings(reaches_m=(0.15, 0.10, 0.08, 0.06))


@dataclass(frozen=True, eq=False)
class BodyGeometry:
    """One body prepared for both kinds of fitting.

    Attributes:
        model: the body.
        body_volume: its inside as points, for matching.
        surface: its surface as points, for refinement.
    """

    model: BodyModel
    body_volume: BodyVolume
    surface: Surface

    @classmethod
    def from_surface(
        cls, surface: Surface, voxel_size_m: float, backend: Backend = CPU
    ) -> BodyGeometry:
        """Samples the inside of a body for voxels of that size."""
        volume = BodyVolume.from_model(surface.model, voxel_size_m, backend)
        return cls(surface.model, volume, surface)


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A pose and how well it explains the silhouettes.

    Attributes:
        pose: the pose.
        error: XOR over OR of silhouettes and pose, mean of the cameras.
    """

    pose: Pose
    error: float


def find_pose(
    body: BodyGeometry,
    frame: FrameObservation,
    settings: MatchSettings | None = None,
    count: int = 10,
) -> list[PoseFit]:
    """Searches the whole range of postures.

    Args:
        body: the body.
        frame: silhouettes and hull.
        settings: of the matcher.
        count: torso placements to try.

    Returns:
        Poses, best first, at most one per torso placement; empty where there is no hull.
    """
    placements = find_torso(body.body_volume, frame.grid, frame.occupancy, count)
    first = sorted((_match(body, frame, start, settings) for start in placements), key=_error)
    # With the torso now well placed the limbs are matched again; where that is no better, the
    # first fit stands.
    again = [_match(body, frame, fit.pose, settings) for fit in first[:3]]
    ranked = sorted([*again, *first], key=_error)
    moved = [move_limbs(body, frame.observation, fit) for fit in ranked[:2]]
    return sorted([*moved, *ranked[2:]], key=_error)


def move_limbs(
    body: BodyGeometry, observation: Observation, fit: PoseFit, prior: PosePrior | None = None
) -> PoseFit:
    """Searches each arm and leg on the silhouettes, and keeps what lowers the error."""
    for chain in CHAINS:
        placed = place_limb(body.body_volume, observation, fit.pose, chain)
        moved = refine_fit(body, observation, placed, prior, _SHORT)
        if moved.error < 0.99 * fit.error:
            fit = moved
    return fit


def refine_fit(
    body: BodyGeometry,
    observation: Observation,
    start: Pose,
    prior: PosePrior | None,
    settings: RefineSettings,
) -> PoseFit:
    """Refines a pose on the silhouettes, and measures its error; arguments as of `refine`."""
    pose = refine(body.surface, observation, start, prior, settings).pose
    error = silhouette_error(body.model, pose, observation, body.body_volume.backend)
    return PoseFit(pose, error)


def _match(
    body: BodyGeometry, frame: FrameObservation, start: Pose, settings: MatchSettings | None
) -> PoseFit:
    matched = match(body.body_volume, frame.grid, frame.occupancy, start, settings)
    return refine_fit(body, frame.observation, matched.pose, None, _QUICK)


def _error(fit: PoseFit) -> float:
    return fit.error
