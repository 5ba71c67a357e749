"""Paper B: a posture from voxels, part by part and breadth first, interfering parts jointly."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from silhouette_core.motion.pose import Pose
from silhouette_core.ranking import summable
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.matching.body_volume import BodyVolume, VoxelSet
from voxelpose.multiview.matching.joint_search import (
    best_together,
    interference_groups,
    spare_score,
)
from voxelpose.multiview.matching.limbs import Limb, sample_angles
from voxelpose.multiview.tuning import MATCHING


@dataclass(frozen=True)
class MatchSettings:
    """Settings of the matcher."""

    step_rad: float = np.radians(MATCHING.step_deg)
    interference: bool = True
    """Match parts jointly where their movable areas share voxels; False is the paper's plain
    matcher."""


@dataclass(frozen=True, eq=False)
class Match:
    """Result of the matcher."""

    pose: Pose
    score: float
    """Explained voxels less the cost of parts in empty space; of several bodies matched together,
    of all of them."""
    explained: float  #: fraction of the hull's voxels that some part covers.
    groups: tuple[tuple[str, ...], ...]
    """The limbs matched jointly, in the order in which they were decided; those of other bodies
    with their number, as "left_forearm of 2"."""
    stopped: tuple[tuple[str, ...], ...] = ()
    """Those of the groups whose joint search stopped at a bound, so that a better combination may
    exist."""


@dataclass(frozen=True, eq=False)
class LimbPlacements:
    """The K sampled placements of one selectable limb."""

    limb: Limb
    angles_rad: np.ndarray  #: (K, D), one row a placement.
    bits: np.ndarray  #: (K, words) uint64, the free voxels that each covers.
    cost: np.ndarray
    """(K,) float64, at least 0, for lying in empty space or inside a part that is already
    placed."""
    body: int = 0  #: number of the body whose limb it is, where several are matched.
    spare: float = 0.0  #: of all limbs that are selectable with it, see `spare_score`.

    @property
    def movable_area(self) -> np.ndarray:
        r"""Movable area of a selectable part: (words,) uint64, a set of voxels as bits.

        .. math::
            :label: iiyama-2

            M_p = \bigcup_{\theta \in \Theta_p} V_p(\theta),
            \quad s_p(\theta) \ge \min(0, \max s_p - \delta)

        where :math:`\Theta_p` are the sampled angles of part :math:`p` within its range,
        :math:`V_p(\theta)` the free voxels that it covers at angles :math:`\theta`, and
        :math:`s_p(\theta)` these less its cost (:eq:`iiyama-5`). Where a part would lie mostly in
        empty space or in another part, no voxel is its, unless the best combination could place it
        there (:math:`\delta`, `spare`).

        Source: Iiyama, Kameda and Minoh, step (2): section 3. The area as a set of the hull's
        voxels, and that a part must lie mostly in them, are ours; the paper does not say how it is
        represented.
        """
        scores = np.bitwise_count(self.bits).sum(axis=1) - self.cost
        possible = scores >= min(0.0, float(scores.max()) - self.spare)
        return np.bitwise_or.reduce(self.bits[possible], axis=0)  # step (2)


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
    return match_together([(body_volume, start)], grid, occupancy, settings)[0]


def match_together(
    bodies: Sequence[tuple[BodyVolume, Pose]],
    grid: VoxelGrid,
    occupancy: np.ndarray,
    settings: MatchSettings | None = None,
) -> list[Match]:
    """Joint angles of several bodies whose root parts are placed, as of one tree with a root each.

    The parts of all bodies are matched breadth first; parts whose movable areas interfere are
    decided at once, whether they are of one body or of several.

    Args:
        bodies: each with what places its root part; its other angles are the initial values.
        occupancy: (nx, ny, nz) bool, the voxels of all bodies.

    Returns:
        A match of each body.

    Source: as `match`; that the bodies may be several is ours.
    """
    search = _Search(bodies, grid, occupancy, settings or MatchSettings())
    search.decide_roots()
    while candidates := search.selectable():
        groups = [[c] for c in candidates]
        if search.settings.interference:
            groups = _interfering(candidates)
        # All groups of a level are matched on the voxels that the levels before left.
        choices = [  # step (1), (4)
            best_together([c.bits for c in group], [c.cost for c in group]) for group in groups
        ]
        before = [pose.angles_rad for pose in search.poses]
        for group, best in zip(groups, choices, strict=True):
            search.decide(group, best.choice, before, best.exact)
    explained = int(np.bitwise_count(search.taken).sum()) / max(len(search.voxel_set), 1)
    return [
        Match(pose, search.score, explained, tuple(groups), tuple(stopped))
        for pose, groups, stopped in zip(search.poses, search.groups, search.stopped, strict=True)
    ]


class _Search:
    """State of the search: the poses so far, and the voxels that their parts have taken."""

    def __init__(
        self,
        bodies: Sequence[tuple[BodyVolume, Pose]],
        grid: VoxelGrid,
        occupancy: np.ndarray,
        settings: MatchSettings,
    ):
        """Starts with no part placed."""
        self.volumes = [volume for volume, _ in bodies]
        self.poses = [pose for _, pose in bodies]
        self.voxel_set = VoxelSet(grid, occupancy, self.volumes[0].backend)
        self.settings = settings
        self.taken = np.zeros(self.voxel_set.words, np.uint64)
        self.score = 0.0
        self.groups: list[list[tuple[str, ...]]] = [[] for _ in bodies]
        self.stopped: list[list[tuple[str, ...]]] = [[] for _ in bodies]
        self._decided: list[set[str]] = [set() for _ in bodies]

    def decide_roots(self) -> None:
        """Places every body's root part as it is given."""
        for k, (volume, pose) in enumerate(zip(self.volumes, self.poses, strict=True)):
            angles = [other.angles_rad for other in self.poses]
            roots = self.placements(k, volume.root_limb, pose.angles_rad[None])
            self.decide([roots], (0,), angles)

    def selectable(self) -> list[LimbPlacements]:
        """Placements of each limb that is not decided yet, but whose parent is."""
        parts = []
        for k, (volume, pose) in enumerate(zip(self.volumes, self.poses, strict=True)):
            decided, tree = self._decided[k], volume.model.tree
            for limb in volume.limbs:
                if limb.name not in decided and limb.parent in decided:
                    angles = sample_angles(limb, pose.angles_rad, self.settings.step_rad, tree)
                    parts.append(self.placements(k, limb, angles))
        if not parts or not self.settings.interference:
            return parts
        spare = spare_score([one.bits for one in parts], [one.cost for one in parts])
        return [replace(one, spare=spare) for one in parts]

    def placements(self, body: int, limb: Limb, angles_rad: np.ndarray) -> LimbPlacements:
        """Placements of a limb at angles (K, D), with the voxels they cover and what they cost."""
        volume = self.volumes[body]
        placed = volume.placements(limb, self.poses[body], angles_rad)
        bits, empty, inside = self.voxel_set.cover(volume.points[limb.name], *placed)
        cost = summable(empty + MATCHING.taken_cost * inside)
        return LimbPlacements(limb, angles_rad, bits, cost, body)

    def decide(
        self,
        group: list[LimbPlacements],
        choice: Sequence[int],
        before_rad: Sequence[np.ndarray],
        exact: bool = True,
    ) -> None:
        """Places the limbs of a group.

        Args:
            before_rad: (D,) of each body, the angles around which the placements were sampled; what
                other groups have changed since then is kept.
            exact: whether no combination can be better.
        """
        chosen = list(zip(group, choice, strict=True))
        union = np.bitwise_or.reduce([placements.bits[k] for placements, k in chosen])
        # Without interference two groups of one level may claim the same voxel; it counts once.
        explained = int(np.bitwise_count(union & ~self.taken).sum())
        self.score += explained - sum(float(placements.cost[k]) for placements, k in chosen)
        self.taken |= union
        self.voxel_set.take(union)
        for body in {placements.body: None for placements in group}:
            pose = self.poses[body]
            angles = pose.angles_rad.copy()
            for placements, k in chosen:
                if placements.body == body:
                    self._decided[body].add(placements.limb.name)
                    changed = placements.angles_rad[k] != before_rad[body]
                    angles[changed] = placements.angles_rad[k][changed]
            self.poses[body] = Pose(pose.root_m, pose.root_rotation, angles)
            names = tuple(
                one.limb.name if one.body == body else f"{one.limb.name} of {one.body + 1}"
                for one in group
            )
            self.groups[body].append(names)
            if not exact:
                self.stopped[body].append(names)


def _interfering(candidates: list[LimbPlacements]) -> list[list[LimbPlacements]]:
    groups = interference_groups([candidate.movable_area for candidate in candidates])
    return [[candidates[i] for i in group] for group in groups]
