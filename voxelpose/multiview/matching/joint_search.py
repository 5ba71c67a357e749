"""Joint matching of several parts: the best combination of placements that compete for voxels.

The score of a group is the number of voxels in the union of its parts, less each part's own cost.
What a part adds to a union never grows with the union, so what it adds to the parts chosen so far
bounds what it can add later: best-first search over partial choices is exact, and stops at the
first complete choice that leaves the queue.

Before the search, placements are discarded that cannot belong to a better choice than a good one
already known; parts that then no longer overlap are decided separately. Only voxels that several
parts still compete for are kept as sets; of two placements, one that is better whatever the other
parts take dominates the other. All of it is exact, unless the search of a large group comes to the
bound of its memory: then the best choice found so far stands, and the result says so.
"""

import heapq
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from voxelpose.multiview.matching.kernels.bits import count_common, count_new, find_dominated
from voxelpose.multiview.tuning import CARVING

MOST_BYTES = 200_000_000
"""Memory that partial choices of one search may take."""
_MOST_EXTENDED = 100_000  # partial choices: minutes
_ENTRY_BYTES = 400  # of a partial choice, beside its voxels


class JointChoice(NamedTuple):
    """Result of a joint search; not exact where it stopped at a bound."""

    choice: tuple[int, ...]
    score: float
    exact: bool


class _Memory:
    """Memory of partial choices and work on them, and whether they did not suffice."""

    def __init__(self, most_bytes: int):
        self.most, self.left, self.extended, self.exceeded = most_bytes, most_bytes, 0, False

    def take(self, taken: np.ndarray) -> None:
        """Counts one partial choice."""
        self.left -= taken.nbytes + _ENTRY_BYTES
        self.exceeded |= self.left < 0

    def give(self, taken: np.ndarray) -> None:
        """Counts one that is done."""
        self.left += taken.nbytes + _ENTRY_BYTES
        self.extended += 1
        self.exceeded |= self.extended > _MOST_EXTENDED


@dataclass(frozen=True, eq=False)
class _Part:
    """The K placements of one part that are still candidates."""

    number: int
    rows: np.ndarray  #: (K,) the placements' original indices, ascending.
    bits: np.ndarray  #: (K, W) uint64, the contested voxels that each covers.
    gain: np.ndarray  #: (K,) float64, uncontested voxels that each covers, less its cost.

    def gains(self, taken: np.ndarray) -> np.ndarray:
        """Increase (K,) float64 of the score by each placement, where voxels `taken` (W,) count."""
        new = np.empty(len(self.bits), np.int64)
        count_new(self.bits, taken, new)
        return self.gain + new

    def only(self, rows: np.ndarray) -> "_Part":
        """The part with a subset of its placements, by mask or index."""
        return _Part(self.number, self.rows[rows], self.bits[rows], self.gain[rows])


def best_together(
    bits: list[np.ndarray], costs: list[np.ndarray], most_bytes: int = MOST_BYTES
) -> JointChoice:
    r"""Best combination of placements of several parts, matched at once.

    .. math::
        :label: iiyama-4

        \hat\theta_G = \arg\max_{\theta_G \in \prod_{p \in G} \Theta_p} s(\theta_G)

    where :math:`G` is a group of interfering parts, :math:`\theta_G` holds the angles of each,
    :math:`\Theta_p` are the sampled angles of part :math:`p`, and :math:`s` is the score
    (:eq:`iiyama-5`). Raises ValueError where there is no part, or one without placements.

    Args:
        bits: for each of n parts (K_i, W) uint64, the voxels that each of its K_i placements
            covers.
        costs: for each part (K_i,) float64, at least 0: what each placement costs by itself.
        most_bytes: memory that partial choices may take; beyond it the search stops.

    Returns:
        The chosen placement of each part, the score, and whether that is exact. Of equally good
        choices always the same; the result does not depend on threads.

    Source: Iiyama, Kameda and Minoh, step (4): section 3. The paper does not say how all
    combinations are searched; the exact search is ours.
    """
    memory = _Memory(most_bytes)
    chosen = _solve(_parts(bits, costs), memory)  # step (4)
    choice = tuple(chosen[i] for i in range(len(bits)))
    return JointChoice(choice, group_score(bits, costs, choice), not memory.exceeded)


def spare_score(bits: list[np.ndarray], costs: list[np.ndarray]) -> float:
    """By how much a part of the best combination can score less than by its best placement: what
    the best placements of all parts, no voxel shared, score beyond a combination that is known.

    Arguments as of `best_together`.
    """
    return _known(_parts(bits, costs))[3]


def group_score(
    bits: Sequence[np.ndarray], costs: Sequence[np.ndarray], choice: Sequence[int]
) -> float:
    r"""Score of one combination of placements: voxels in the union, less the costs.

    .. math::
        :label: iiyama-5

        s(\theta_G) = \Bigl|\bigcup_{p \in G} V_p(\theta_p)\Bigr|
                     - \sum_{p \in G} c_p(\theta_p)

    where :math:`V_p(\theta_p)` are the voxels that part :math:`p` covers at its angles
    :math:`\theta_p`, each of which counts once, and :math:`c_p(\theta_p) \ge 0`, in voxels, is the
    cost of its volume in empty space. Since :math:`|A \cup B| = |A| + |B| - |A \cap B|`,

    .. math::

        s(\theta_G) \le \sum_{p \in G} \bigl(|V_p(\theta_p)| - c_p(\theta_p)\bigr)

    so the scores of single parts bound that of every group; with some parts placed, what each other
    part adds to their union takes the place of its single score.

    Args:
        bits: for each of n parts (K_i, W) uint64, the voxels that each of its placements covers.
        costs: for each part (K_i,) float64.
        choice: n indices, the placement of each part.

    Source: Iiyama, Kameda and Minoh, step (5): section 2, the overlap of voxels. The union, the
    costs and the bound are ours.
    """
    union = np.bitwise_or.reduce([part[k] for part, k in zip(bits, choice, strict=True)])
    cost = sum(float(part[k]) for part, k in zip(costs, choice, strict=True))
    return float(np.bitwise_count(union).sum()) - cost  # step (5)


def interference_groups(areas: Sequence[np.ndarray]) -> list[list[int]]:
    r"""Indices of the parts whose movable areas interfere, directly or through others.

    The movable areas :math:`M_p` of all selectable parts are composed; two parts :math:`p` and
    :math:`q` interfere where theirs overlap:

    .. math::
        :label: iiyama-3

        I_{pq} = M_p \cap M_q \neq \emptyset

    The groups are the connected components of this relation; a part that interferes with none is a
    group by itself.

    Args:
        areas: for each part (W,) uint64, a set of voxels as bits.

    Source: Iiyama, Kameda and Minoh, step (3): section 3. That interference is passed on from part
    to part is ours.
    """
    label = list(range(len(areas)))
    for i in range(len(areas)):
        for j in range(i):
            if count_common(areas[i], areas[j]):  # step (3)
                label = [label[j] if other == label[i] else other for other in label]
    return [[i for i, root in enumerate(label) if root == group] for group in sorted(set(label))]


def _parts(bits: list[np.ndarray], costs: list[np.ndarray]) -> list[_Part]:
    if not bits or any(not len(part) for part in bits):
        raise ValueError("every part needs at least one placement")
    return [
        _Part(i, np.arange(len(rows)), np.ascontiguousarray(rows), -np.asarray(cost, float))
        for i, (rows, cost) in enumerate(zip(bits, costs, strict=True))
    ]


def _solve(parts: list[_Part], memory: _Memory) -> dict[int, int]:
    """Best placement of every part, by the part's number."""
    alone, known, score, spare = _known(parts)
    if len(parts) == 1:
        return {parts[0].number: int(parts[0].rows[known[0]])}
    # Discards placements that, even with the best of all other parts and no voxel shared, are no
    # better than the known choice.
    usable = [gain > gain.max() - spare for gain in alone]
    for mask, k in zip(usable, known, strict=True):
        mask[k] = True
    fewer = [part.only(mask) for part, mask in zip(parts, usable, strict=True)]
    groups = interference_groups([np.bitwise_or.reduce(part.bits, axis=0) for part in fewer])
    if len(groups) > 1:
        solved = [_solve([fewer[i] for i in group], memory) for group in groups]
        return {number: row for group in solved for number, row in group.items()}
    reduced = [_undominated(part) for part in _contested(fewer)]
    left, before = (sum(len(part.rows) for part in one) for one in (reduced, parts))
    if left < CARVING.shrinkage * before:
        return _solve(reduced, memory)
    # The part that can explain most is decided first: its choice restricts the others most.
    empty = np.zeros(reduced[0].bits.shape[1], np.uint64)
    order = sorted(range(len(reduced)), key=lambda i: (-reduced[i].gains(empty).max(), i))
    ordered = [reduced[i] for i in order]
    better = _search(ordered, score, memory)
    if better is not None:
        parts, known = ordered, better
    return {part.number: int(part.rows[k]) for part, k in zip(parts, known, strict=True)}


def _known(parts: list[_Part]) -> tuple[list[np.ndarray], list[int], float, float]:
    """Scores of parts alone, a good choice, its score, and `spare_score`.

    The choice is greedy, the most promising part first, then improved by coordinate ascent.
    """
    choice = [-1] * len(parts)
    covered = np.zeros((len(parts), parts[0].bits.shape[1]), np.uint64)
    alone = [part.gains(covered[0]) for part in parts]
    order = sorted(range(len(parts)), key=lambda i: (-alone[i].max(), i))
    changed = True
    while changed:
        changed = False
        for i in order:
            gains = parts[i].gains(np.bitwise_or.reduce(np.delete(covered, i, axis=0)))
            best = int(gains.argmax())
            if choice[i] < 0 or gains[best] > gains[choice[i]] + 1e-9:
                choice[i], covered[i], changed = best, parts[i].bits[best], True
    score = group_score([p.bits for p in parts], [-p.gain for p in parts], choice)
    return alone, choice, score, sum(float(gain.max()) for gain in alone) - score


def _contested(parts: list[_Part]) -> list[_Part]:
    """The parts with only those voxels as sets that several could cover; others count as gain."""
    once, several = np.zeros_like(parts[0].bits[0]), np.zeros_like(parts[0].bits[0])
    for part in parts:
        area = np.bitwise_or.reduce(part.bits, axis=0)
        several |= once & area
        once |= area
    columns = np.flatnonzero(np.unpackbits(several.view(np.uint8), bitorder="little"))
    words = max((len(columns) + 63) // 64, 1)
    reduced = []
    for part in parts:
        sets = np.zeros((len(part.bits), 64 * words), np.uint8)
        sets[:, : len(columns)] = np.unpackbits(
            part.bits.view(np.uint8), axis=1, bitorder="little"
        )[:, columns]
        packed = np.packbits(sets, axis=1, bitorder="little").view(np.uint64)
        uncontested = np.bitwise_count(part.bits & ~several).sum(1)
        reduced.append(_Part(part.number, part.rows, packed, part.gain + uncontested))
    return reduced


def _undominated(part: _Part) -> _Part:
    """The part without placements that are dominated, whatever the other parts take."""
    dominated = np.zeros(len(part.bits), np.bool_)
    # The likely winners first: they dominate most others.
    order = np.argsort(-part.gains(np.zeros(part.bits.shape[1], np.uint64)), kind="stable")
    find_dominated(np.ascontiguousarray(part.bits[order]), part.gain[order], dominated)
    return part.only(np.sort(order[~dominated]))


def _search(parts: list[_Part], score: float, memory: _Memory) -> list[int] | None:
    """Best-first search: the placements with the best score above the given one, or None."""
    best = None
    ticket = itertools.count()
    start = np.zeros(parts[0].bits.shape[1], np.uint64)
    queue = [(-np.inf, next(ticket), 0.0, [], start)]
    memory.left = memory.most  # nothing is kept of an earlier search
    memory.take(start)
    while queue and not memory.exceeded:
        negative, _, reached, chosen, taken = heapq.heappop(queue)
        memory.give(taken)
        if -negative <= score:
            break
        depth = len(chosen)
        gains = [part.gains(taken) for part in parts[depth:]]
        later = sum(float(gain.max()) for gain in gains[1:])
        bound = reached + float(gains[0].max()) + later  # the bound of step (5)
        if bound <= score:
            continue
        if bound < -negative and queue and bound < -queue[0][0]:
            # The bound inherited from the parent was too high: back into the queue with its own.
            heapq.heappush(queue, (-bound, next(ticket), reached, chosen, taken))
            memory.take(taken)
            continue
        for k in np.argsort(-gains[0], kind="stable"):
            total = reached + float(gains[0][k])
            if total + later <= score:
                break
            if depth + 1 == len(parts):
                best, score = [*chosen, int(k)], total
                break
            union = taken | parts[depth].bits[k]
            heapq.heappush(queue, (-(total + later), next(ticket), total, [*chosen, int(k)], union))
            memory.take(union)
            if memory.exceeded:
                break
    return best
