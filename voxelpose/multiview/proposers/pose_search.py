"""Pose of a single frame without a prior: torso placements, paper B's matching, refinement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from operator import attrgetter

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.dynamics import pose_step_sigma, relaxed_rad
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart, refine_many
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.silhouette_error import mask_errors
from silhouette_core.tuning import MEASURING, REFINEMENT
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.matcher import MatchSettings, match
from voxelpose.multiview.proposers.limb_search import place_limb
from voxelpose.multiview.proposers.torso_search import find_torso
from voxelpose.multiview.tuning import MATCHING

HEADINGS = 12
"""Of upright people from which poses are searched."""
PLACEMENTS, MORE_PLACEMENTS, FEW_PLACEMENTS = 10, 20, 4
"""Placements of the torso that a search tries; where an improbable track is begun again, and of a
sitting person; and in a first search live, which the fewer, the sooner catches up.
"""
# Placements whose limbs are matched again, and poses whose limbs are searched on the silhouettes.
# Of 70 single frames (seeds 121 to 124, 211 to 220) searched live, 6 are over 100 mm off; with one
# placement, and one pose, 8.


SEARCHED = RefineSettings()
"""For poses from a search, right to within a sampling step."""
STEP = RefineSettings(REFINEMENT.near_reaches_m)
"""For poses that are predicted, or right but for a limb."""


@dataclass(frozen=True, eq=False)
class BodyGeometry:
    """One body prepared for both kinds of fitting."""

    model: BodyModel
    body_volume: BodyVolume  #: its inside as points, for matching.
    surface: Surface  #: its surface as points, for refinement.
    root: Pose | None = None
    """Places the root part where it stands still at a known place; None: it is estimated."""

    def held(self, start: RefineStart) -> RefineStart:
        """Start with the root at its known place, if there is one."""
        if self.root is None:
            return start
        prior = start.prior or PosePrior(start.pose, np.full(6 + self.model.dof_count, np.inf))
        sigma = prior.sigma.copy()
        sigma[:6] = pose_step_sigma(self.model.tree)[:6]  # of a root that stands still
        return replace(
            start,
            pose=replace(self.root, angles_rad=start.pose.angles_rad),
            prior=PosePrior(replace(self.root, angles_rad=prior.pose.angles_rad), sigma),
        )

    @classmethod
    def from_surface(cls, surface: Surface, voxel_size_m: float, backend_name: str) -> BodyGeometry:
        """Samples the inside of a body for voxels of that size."""
        volume = BodyVolume.from_model(surface.model, voxel_size_m, backend_name)
        return cls(surface.model, volume, surface)

    @classmethod
    def from_model(cls, model: BodyModel, voxel_size_m: float, backend_name: str) -> BodyGeometry:
        """Samples surface and inside of a body."""
        person = model.person
        taken = None if person is None else sampled_vertices(person.sex)
        surface = Surface(model, taken=taken)
        return cls.from_surface(surface, voxel_size_m, backend_name)


@cache
def sampled_vertices(sex: str) -> np.ndarray:
    """The same vertices of all bodies of a template: choosing them takes longer than the rest."""
    return Surface(BodyModel.from_sizes(BodySizes(MEASURING.usual_m, None, sex))).taken


@dataclass(frozen=True, eq=False)
class PoseFit:
    """A pose, its XOR over OR in the mean camera, and groups whose joint search stopped."""

    pose: Pose
    error: float
    stopped: tuple[tuple[str, ...], ...] = ()


def find_pose(
    body: BodyGeometry,
    frame: FrameObservation,
    settings: MatchSettings | None = None,
    count: int = PLACEMENTS,
) -> list[PoseFit]:
    """Searches the whole range of postures.

    Args:
        count: torso placements to try. The limbs of the best ones are matched again, and those of
            the best of these are searched on the silhouettes.

    Returns:
        Poses, best first, at most one per torso placement; empty where there is no hull.
    """
    placements = _placements(body, frame, settings or MatchSettings(), count)
    if not placements:
        return []
    upright = [RefineStart(pose, SEARCHED) for pose in standing(body, frame)]
    stood = refine_fits(body, frame.observation, upright)
    first = sorted([*_matches(body, frame, placements, settings), *stood], key=attrgetter("error"))
    # With the torso now well placed the limbs are matched again; where that is no better, the
    # first fit stands.
    second = _matches(body, frame, [fit.pose for fit in first[: MATCHING.matched_again]], settings)
    ranked = sorted([*second, *first], key=attrgetter("error"))
    best, rest = ranked[: MATCHING.searched], ranked[MATCHING.searched :]
    moved = [replace(move_limbs(body, frame.observation, fit), stopped=fit.stopped) for fit in best]
    return sorted([*moved, *rest], key=attrgetter("error"))


def _placements(
    body: BodyGeometry, frame: FrameObservation, settings: MatchSettings, count: int
) -> list[Pose]:
    """Placements of the root to try: of a person's torso; of another root those from which the
    whole body, matched coarsely part by part, fits best.
    """
    volume, hull = body.body_volume, (frame.grid, frame.occupancy)
    if body.root is not None:
        return [replace(body.root, angles_rad=relaxed_rad(body.model.tree).copy())]
    if volume.is_person:
        return find_torso(volume, *hull, count)
    coarse = replace(settings, step_rad=2 * settings.step_rad)
    roots = find_torso(volume, *hull, 3 * count)
    matched = [match(volume, *hull, root, coarse) for root in roots]
    order = np.argsort([-one.score for one in matched], kind="stable")
    return [roots[k] for k in order[:count]]


def standing(body: BodyGeometry, frame: FrameObservation) -> list[Pose]:
    """Relaxed stances in high columns of the hull, best first by the silhouettes: where the hull is
    much larger than the person, as that of two cameras, a torso fits nearly everywhere. Empty for
    a body that is no person's or stands at a known place.
    """
    if not body.body_volume.is_person or body.root is not None:
        return []
    model, grid = body.model, frame.grid
    filled = frame.occupancy.sum(axis=2)
    columns = np.argwhere(2 * filled >= filled.max())
    apart = max(round(MATCHING.apart_m / grid.voxel_size_m), 1)
    spread = columns[(columns % apart == 0).all(axis=1)]
    columns = spread if len(spread) else columns[:1]
    z = np.arange(frame.occupancy.shape[2])
    middle = (frame.occupancy * z).sum(axis=2)[*columns.T] / filled[*columns.T]
    half_m = 0.5 * (model.vertices_m[:, 2].max() + model.vertices_m[:, 2].min())
    below_m = np.array([0.0, 0.0, half_m - model.joints_m[0, 2]])
    places_m = grid.centres(np.column_stack([columns, middle])) - below_m
    turns = Rotation.from_euler("z", np.arange(HEADINGS)[:, None] * 2 * np.pi / HEADINGS)
    angles = relaxed_rad(model.tree)

    def best(poses: list[Pose]) -> list[Pose]:
        views, backend = frame.observation.views, body.body_volume.backend
        order = np.argsort(mask_errors(model, poses, views, frame.masks, backend), kind="stable")
        return [poses[k] for k in order[: MATCHING.matched_again]]

    upright = best([Pose(place, np.eye(3), angles.copy()) for place in places_m])
    return best(
        [Pose(one.root_m, turn, angles.copy()) for one in upright for turn in turns.as_matrix()]
    )


def move_limbs(body: BodyGeometry, observation: Observation, fit: PoseFit) -> PoseFit:
    """Searches each arm and leg on the silhouettes, and keeps what lowers the error."""
    chains = body.body_volume.chains
    while chains:
        volume = body.body_volume
        placed = [place_limb(volume, observation, fit.pose, chain) for chain in chains]
        starts = [RefineStart(pose, STEP) for pose in placed]
        moved = refine_fits(body, observation, starts)
        # The best one moves first, and the others that would gain are searched again beside it.
        order = sorted(range(len(chains)), key=lambda k: moved[k].error)
        gains = [k for k in order if moved[k].error < 0.99 * fit.error]
        if not gains:
            break
        fit, chains = moved[gains[0]], tuple(chains[k] for k in sorted(gains[1:]))
    return fit


def refine_fit(
    body: BodyGeometry,
    observation: Observation,
    start: Pose,
    prior: PosePrior | None,
    settings: RefineSettings,
) -> PoseFit:
    """Refines a pose on the silhouettes, and measures its error; arguments as of `refine`."""
    return refine_fits(body, observation, [RefineStart(start, settings, prior)])[0]


def refine_fits(
    body: BodyGeometry, observation: Observation, starts: Sequence[RefineStart]
) -> list[PoseFit]:
    """Refines poses on the silhouettes and measures their errors; arguments as `refine_many`."""
    if not starts:
        return []
    starts = [body.held(start) for start in starts]
    poses = [fit.pose for fit in refine_many(body.surface, observation, starts)]
    backend = body.body_volume.backend
    errors = mask_errors(body.model, poses, observation.views, observation.masks, backend)
    return [PoseFit(pose, float(error)) for pose, error in zip(poses, errors, strict=True)]


def _matches(
    body: BodyGeometry,
    frame: FrameObservation,
    placements: Sequence[Pose],
    settings: MatchSettings | None,
) -> list[PoseFit]:
    """Poses whose limbs are matched from placed torsos, refined."""
    volume = body.body_volume
    matched = [match(volume, frame.grid, frame.occupancy, start, settings) for start in placements]
    starts = [RefineStart(first.pose, SEARCHED) for first in matched]
    fits = refine_fits(body, frame.observation, starts)
    return [replace(fit, stopped=first.stopped) for fit, first in zip(fits, matched, strict=True)]
