"""Paper B: a posture from voxels, part by part and breadth first, with interfering parts matched
together.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from silhouette_core.refinement.pose import Pose
from voxelpose.carving.grid import VoxelGrid
from voxelpose.matching.body_volume import BodyVolume
from voxelpose.matching.joint_search import best_together
from voxelpose.matching.kernels.bits import count_common
from voxelpose.matching.limbs import LIMBS, TORSO, Limb, sample_angles
from voxelpose.matching.voxel_set import VoxelSet


@dataclass(frozen=True)
class MatchSettings:
    """How the matcher searches.

    Attributes: step_rad: distance between sampled angles. around_rad: how far from the given pose
        angles are tried; None: the whole range of every joint. interference: match parts together
        where their movable areas share voxels; False is the paper's plain matcher. empty_cost: cost
        of a voxel's worth of a part in empty space, in explained voxels. taken_cost: the same for
        lying inside a part that is already placed.
    """

    step_rad: float = np.radians(15.0)
    around_rad: float | None = None
    interference: bool = True
    empty_cost: float = 1.0
    taken_cost: float = 0.7


@dataclass(frozen=True, eq=False)
class Match:
    """What the matcher found.

    Attributes:
        pose: with the best sampled angles.
        score: voxels explained less the cost of parts in empty space.
        explained: share of the hull's voxels that some part covers.
        groups: the limbs matched together, in the order in which they were decided.
    """

    pose: Pose
    score: float
    explained: float
    groups: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, eq=False)
class LimbPlacements:
    """The sampled placements of one selectable limb.

    Attributes: limb: which. angles_rad: (K, D), one row a placement. bits: (K, words) uint64, the
        free voxels each covers. cost: (K,) float64, at least 0, for lying in empty space or inside
        a part that is already placed.
    """

    limb: Limb
    angles_rad: np.ndarray
    bits: np.ndarray
    cost: np.ndarray

    @property
    def movable_area(self) -> np.ndarray:
        """(words,) uint64: the free voxels that some placement covers.

        Source: Iiyama, Kameda and Minoh, section 3.
        """
        return np.bitwise_or.reduce(self.bits, axis=0)


@dataclass
class _State:
    """The matching under way: the pose so far, and what has been decided."""

    body_volume: BodyVolume
    voxel_set: VoxelSet
    pose: Pose
    settings: MatchSettings
    taken: np.ndarray
    score: float = 0.0
    covered: int = 0
    groups: list[tuple[str, ...]] = field(default_factory=list)


def match(
    body_volume: BodyVolume,
    grid: VoxelGrid,
    occupancy: np.ndarray,
    start: Pose,
    settings: MatchSettings | None = None,
) -> Match:
    """Estimates the joint angles of a body whose root part is placed.

    Args: body_volume: the body. grid: the voxels' places. occupancy: (nx, ny, nz) bool, the voxels
        of one body. start: places the root part; its other angles are the middle of a local search,
        or only the first guess of a full one. settings: see MatchSettings.

    Source: Iiyama, Kameda and Minoh, sections 2 and 3. Ours: the union score with its cost for
    empty space, the exact joint search; the torso's voxels are taken before the limbs are matched.
    """
    voxel_set = VoxelSet(grid, occupancy)
    state = _State(
        body_volume,
        voxel_set,
        start,
        settings or MatchSettings(),
        np.zeros(voxel_set.words, np.uint64),
    )
    bits, cost = _cover(state, TORSO, start.angles_rad[None])
    _decide(state, [TORSO], [bits[0]], start.angles_rad, float(cost[0]))
    decided = {TORSO.name}
    while True:
        selectable = [limb for limb in LIMBS if limb.name not in decided and limb.parent in decided]
        if not selectable:
            break
        candidates = [candidate_placements(state, limb) for limb in selectable]
        groups = (
            interference_groups(candidates)
            if state.settings.interference
            else [[c] for c in candidates]
        )
        # All groups of one level are judged on the voxels that the levels before left: breadth
        # first.
        found = [
            (group, *best_together([c.bits for c in group], [c.cost for c in group]))
            for group in groups
        ]
        before = state.pose.angles_rad
        for group, choice, _ in found:
            angles = state.pose.angles_rad.copy()
            for candidate, k in zip(group, choice, strict=True):
                # Against the angles that the candidates were sampled from: what other groups have
                # decided since then stays.
                changed = candidate.angles_rad[k] != before
                angles[changed] = candidate.angles_rad[k][changed]
            cost = sum(float(c.cost[k]) for c, k in zip(group, choice, strict=True))
            _decide(
                state,
                [c.limb for c in group],
                [c.bits[k] for c, k in zip(group, choice, strict=True)],
                angles,
                cost,
            )
        decided |= {limb.name for limb in selectable}
    return Match(
        state.pose, state.score, state.covered / max(len(state.voxel_set), 1), tuple(state.groups)
    )


@dataclass(frozen=True, eq=False)
class Reach:
    """Where one limb could be, at the moment at which the matcher would place it.

    Attributes:
        limb: which.
        voxels: (n, 3) int64, its movable area as indices into the grid.
        interferes: the limbs that would be matched together with it, itself among them.
        disputed: (m, 3) int64, the voxels of its area that lie in another one of the group, too.
    """

    limb: Limb
    voxels: np.ndarray
    interferes: tuple[str, ...]
    disputed: np.ndarray


def movable_areas(
    body_volume: BodyVolume,
    grid: VoxelGrid,
    occupancy: np.ndarray,
    pose: Pose,
    settings: MatchSettings | None = None,
) -> list[Reach]:
    """Returns the movable area of every limb but the torso, with what is above it placed as in a
    given pose.

    Args:
        body_volume: the body.
        grid: the voxels' places.
        occupancy: (nx, ny, nz) bool, the voxels of one body.
        pose: places the limbs that are decided before each.
        settings: see MatchSettings.

    Source: Iiyama, Kameda and Minoh, section 3.
    """
    voxel_set = VoxelSet(grid, occupancy)
    state = _State(
        body_volume,
        voxel_set,
        pose,
        settings or MatchSettings(),
        np.zeros(voxel_set.words, np.uint64),
    )
    decided: set[str] = set()
    found = []
    selectable = [TORSO]
    while selectable:
        candidates = [candidate_placements(state, limb) for limb in selectable] if decided else []
        for group in interference_groups(candidates):
            for one in group:
                others = [other.movable_area for other in group if other is not one]
                shared = (
                    one.movable_area & np.bitwise_or.reduce(others)
                    if others
                    else np.zeros(voxel_set.words, np.uint64)
                )
                names = tuple(other.limb.name for other in group)
                found.append(
                    Reach(
                        one.limb,
                        voxel_set.voxels(one.movable_area),
                        names,
                        voxel_set.voxels(shared),
                    )
                )
        for limb in selectable:
            voxel_set.take(_cover(state, limb, pose.angles_rad[None])[0][0])
            decided.add(limb.name)
        selectable = [limb for limb in LIMBS if limb.name not in decided and limb.parent in decided]
    return found


def candidate_placements(state: _State, limb: Limb) -> LimbPlacements:
    """Samples and scores the placements of one selectable limb."""
    angles = sample_angles(
        limb, state.pose.angles_rad, state.settings.step_rad, state.settings.around_rad
    )
    return LimbPlacements(limb, angles, *_cover(state, limb, angles))


def interference_groups(candidates: list[LimbPlacements]) -> list[list[LimbPlacements]]:
    """Groups the limbs whose movable areas share voxels, directly or through others.

    Source: Iiyama, Kameda and Minoh, section 3.
    """
    areas = [candidate.movable_area for candidate in candidates]
    group = list(range(len(candidates)))
    for i in range(len(candidates)):
        for j in range(i):
            if count_common(areas[i], areas[j]):
                old, new = group[i], group[j]
                group = [new if g == old else g for g in group]
    return [
        [c for c, g in zip(candidates, group, strict=True) if g == label]
        for label in sorted(set(group))
    ]


def _cover(state: _State, limb: Limb, angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bits (K, words) and cost (K,) of a limb's placements."""
    placements = state.body_volume.placements(limb, state.pose, angles)
    bits, empty, inside = state.voxel_set.cover(state.body_volume.points[limb.name], *placements)
    return bits, state.settings.empty_cost * empty + state.settings.taken_cost * inside


def _decide(
    state: _State, limbs: list[Limb], bits: list[np.ndarray], angles: np.ndarray, cost: float
) -> None:
    union = np.bitwise_or.reduce(bits)
    # Without interference two groups of one level may claim the same voxel; it counts once.
    explained = int(np.bitwise_count(union & ~state.taken).sum())
    state.taken |= union
    state.pose = Pose(state.pose.root_m, state.pose.root_rotation, angles)
    state.voxel_set.take(union)
    state.score += explained - cost
    state.covered += explained
    state.groups.append(tuple(limb.name for limb in limbs))
