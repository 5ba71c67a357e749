"""Paper B: a posture from voxels, part by part and breadth first, interfering parts jointly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from silhouette_core.motion.pose import Pose
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.matching.body_volume import BodyVolume, VoxelSet
from voxelpose.multiview.matching.joint_search import best_together, interference_groups
from voxelpose.multiview.matching.limbs import Limb, sample_angles
from voxelpose.multiview.tuning import MATCHING


@dataclass(frozen=True)
class MatchSettings:
    """Settings of the matcher.

    Attributes:
        interference: match parts jointly where their movable areas share voxels; False is the
            paper's plain matcher.
    """

    step_rad: float = np.radians(MATCHING.step_deg)
    interference: bool = True


@dataclass(frozen=True, eq=False)
class Match:
    """Result of the matcher.

    Attributes:
        score: explained voxels less the cost of parts in empty space.
        explained: fraction of the hull's voxels that some part covers.
        groups: the limbs matched jointly, in the order in which they were decided.
        stopped: those of the groups whose joint search stopped at a bound, so that a better
            combination may exist.
    """

    pose: Pose
    score: float
    explained: float
    groups: tuple[tuple[str, ...], ...]
    stopped: tuple[tuple[str, ...], ...] = ()


@dataclass(frozen=True, eq=False)
class LimbPlacements:
    """The K sampled placements of one selectable limb.

    Attributes:
        angles_rad: (K, D), one row a placement.
        bits: (K, words) uint64, the free voxels that each covers.
        cost: (K,) float64, at least 0, for lying in empty space or inside a part that is already
            placed.
    """

    limb: Limb
    angles_rad: np.ndarray
    bits: np.ndarray
    cost: np.ndarray

    @property
    def movable_area(self) -> np.ndarray:
        r"""Movable area of a selectable part: (words,) uint64, a set of voxels as bits.

        .. math::
            :label: iiyama-2

            M_p = \bigcup_{\theta \in \Theta_p} V_p(\theta)

        where :math:`\Theta_p` are the sampled angles of part :math:`p` within its range, and
        :math:`V_p(\theta)` the free voxels that it covers at angles :math:`\theta`.

        Source: Iiyama, Kameda and Minoh, step (2): section 3. The area as a set of the hull's
        voxels is ours; the paper does not say how it is represented.
        """
        return np.bitwise_or.reduce(self.bits, axis=0)  # step (2)


@dataclass(frozen=True, eq=False)
class LimbArea:
    """Where one limb could be when the matcher is about to place it.

    Attributes:
        voxels: (n, 3) int64, its movable area as indices into the grid.
        interferes: names of the limbs that would be matched jointly with it, its own included.
        disputed: (m, 3) int64, the voxels of its area that also lie in that of another of them.
    """

    limb: Limb
    voxels: np.ndarray
    interferes: tuple[str, ...]
    disputed: np.ndarray


def match(
    body_volume: BodyVolume,
    grid: VoxelGrid,
    occupancy: np.ndarray,
    start: Pose,
    settings: MatchSettings | None = None,
) -> Match:
    r"""Joint angles of a body whose root part is placed.

    The parts are matched one by one, breadth first along the tree of parts: once the angles of its
    parent are decided, part :math:`p` is selectable, and

    .. math::
        :label: iiyama-1

        \hat\theta_p = \arg\max_{\theta \in \Theta_p} s_p(\theta)

    where :math:`\Theta_p` are angles sampled within the range of the part's joint and
    :math:`s_p(\theta)` is the overlap of the part with the voxels. Parts whose movable areas
    interfere are decided jointly instead (:eq:`iiyama-4`).

    Args:
        occupancy: (nx, ny, nz) bool, the voxels of one body.
        start: places the root part; its other angles are the initial values.

    Source: Iiyama, Kameda and Minoh, step (1): section 2, with section 3 for interfering parts.
    Ours: a score that subtracts a cost for empty space; the torso's voxels are taken before the
    limbs are matched, and the voxels that one level takes are not offered to the next.
    """
    search = _Search(body_volume, grid, occupancy, start, settings or MatchSettings())
    root = body_volume.root_limb
    search.decide([search.placements(root, start.angles_rad[None])], (0,), start.angles_rad)
    while candidates := search.selectable():
        groups = [[c] for c in candidates]
        if search.settings.interference:
            groups = _interfering(candidates)
        # All groups of a level are matched on the voxels that the levels before left.
        choices = [  # step (1), (4)
            best_together([c.bits for c in group], [c.cost for c in group]) for group in groups
        ]
        before = search.pose.angles_rad
        for group, found in zip(groups, choices, strict=True):
            search.decide(group, found.choice, before)
            if not found.exact:
                search.stopped.append(search.groups[-1])
    explained = int(np.bitwise_count(search.taken).sum()) / max(len(search.voxel_set), 1)
    groups = tuple(search.groups), tuple(search.stopped)
    return Match(search.pose, search.score, explained, *groups)


def movable_areas(
    body_volume: BodyVolume, grid: VoxelGrid, occupancy: np.ndarray, pose: Pose
) -> list[LimbArea]:
    """Movable area of every limb but the root's, with its parents placed as in a given pose.

    Args:
        occupancy: (nx, ny, nz) bool, the voxels of one body.
        pose: places the limbs that are decided before each.

    Source: Iiyama, Kameda and Minoh, section 3.
    """
    search = _Search(body_volume, grid, occupancy, pose, MatchSettings())
    root = body_volume.root_limb
    search.decide([search.placements(root, pose.angles_rad[None])], (0,), pose.angles_rad)
    areas = []
    while candidates := search.selectable():
        for group in _interfering(candidates):
            names = tuple(candidate.limb.name for candidate in group)
            for candidate in group:
                own, others = candidate.movable_area, np.zeros_like(search.taken)
                for other in group:
                    if other is not candidate:
                        others |= other.movable_area
                voxels, shared = search.voxel_set.voxels(own), search.voxel_set.voxels(own & others)
                areas.append(LimbArea(candidate.limb, voxels, names, shared))
        for candidate in candidates:  # the first placement is the given pose's
            search.decide([candidate], (0,), pose.angles_rad)
    return areas


class _Search:
    """State of the search: the pose so far, and the voxels that its parts have taken."""

    def __init__(
        self,
        body_volume: BodyVolume,
        grid: VoxelGrid,
        occupancy: np.ndarray,
        pose: Pose,
        settings: MatchSettings,
    ):
        """Starts with no part placed."""
        self.body_volume = body_volume
        self.voxel_set = VoxelSet(grid, occupancy, body_volume.backend)
        self.pose = pose
        self.settings = settings
        self.taken = np.zeros(self.voxel_set.words, np.uint64)
        self.score = 0.0
        self.groups: list[tuple[str, ...]] = []
        self.stopped: list[tuple[str, ...]] = []

    def selectable(self) -> list[LimbPlacements]:
        """Placements of each limb that is not decided yet, but whose parent is."""
        decided = {name for group in self.groups for name in group}
        own = self.pose.angles_rad, self.settings.step_rad, self.body_volume.model.tree
        return [
            self.placements(limb, sample_angles(limb, *own))
            for limb in self.body_volume.limbs
            if limb.name not in decided and limb.parent in decided
        ]

    def placements(self, limb: Limb, angles_rad: np.ndarray) -> LimbPlacements:
        """Placements of a limb at angles (K, D), with the voxels they cover and what they cost."""
        placed = self.body_volume.placements(limb, self.pose, angles_rad)
        bits, empty, inside = self.voxel_set.cover(self.body_volume.points[limb.name], *placed)
        cost = empty + MATCHING.taken_cost * inside
        return LimbPlacements(limb, angles_rad, bits, cost)

    def decide(
        self, group: list[LimbPlacements], choice: Sequence[int], before_rad: np.ndarray
    ) -> None:
        """Places the limbs of a group.

        Args:
            before_rad: (D,) the angles around which the placements were sampled; what other groups
                have changed since then is kept.
        """
        chosen = list(zip(group, choice, strict=True))
        angles = self.pose.angles_rad.copy()
        for placements, k in chosen:
            changed = placements.angles_rad[k] != before_rad
            angles[changed] = placements.angles_rad[k][changed]
        union = np.bitwise_or.reduce([placements.bits[k] for placements, k in chosen])
        # Without interference two groups of one level may claim the same voxel; it counts once.
        explained = int(np.bitwise_count(union & ~self.taken).sum())
        self.score += explained - sum(float(placements.cost[k]) for placements, k in chosen)
        self.taken |= union
        self.voxel_set.take(union)
        self.pose = Pose(self.pose.root_m, self.pose.root_rotation, angles)
        self.groups.append(tuple(placements.limb.name for placements in group))


def _interfering(candidates: list[LimbPlacements]) -> list[list[LimbPlacements]]:
    groups = interference_groups([candidate.movable_area for candidate in candidates])
    return [[candidates[i] for i in group] for group in groups]
