"""Several parts at once: the best combination of placements when they may claim the same voxels.

The score of a group is the number of voxels in the union of its parts (a voxel counts once), less
each part's own cost for lying in
empty space. Unions grow more slowly than sums, so what a part adds to the parts already chosen
bounds what it can add later: best-first search over partial choices is exact, and stops at the
first complete choice that it takes from the queue.

Before the search, what cannot be in a better answer than a good one already known is left out;
parts that then no longer touch are decided apart. Only voxels that several parts still want are
kept as sets; of two placements, one that is better whatever the other parts take makes the other
needless. All of it is exact.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

import numpy as np

from voxelpose.matching.kernels.bits import count_common, count_new, find_dominated

# where fewer than this share of the placements are left, they are sifted again before the search
_WORTH_ANOTHER = 0.9


@dataclass(frozen=True, eq=False)
class _Part:
    """The placements of one part that are still in question.

    Attributes: number: which part of the group. rows: (K,) the placements' own numbers, ascending.
        bits: (K, W) uint64, the voxels each covers. gain: (K,) float64, what each earns besides:
        less its cost, with the voxels that no other part wants.
    """

    number: int
    rows: np.ndarray
    bits: np.ndarray
    gain: np.ndarray

    def gains(self, taken: np.ndarray) -> np.ndarray:
        """Returns what each placement would add to the voxels `taken` (W,): (K,) float64."""
        new = np.empty(len(self.bits), np.int64)
        count_new(self.bits, taken, new)
        return self.gain + new

    def only(self, kept: np.ndarray) -> _Part:
        """Returns the part with some of its placements, by mask or index."""
        return _Part(self.number, self.rows[kept], self.bits[kept], self.gain[kept])


def best_together(bits: list[np.ndarray], costs: list[np.ndarray]) -> tuple[tuple[int, ...], float]:
    """Finds the placements of several parts that together explain most.

    Args: bits: for each of n parts (K_i, W) uint64, the voxels that each of its K_i placements
        covers. costs: for each part (K_i,) float64, at least 0: what each placement costs by
        itself.

    Returns: The chosen placement of each part, and the score of the union less the costs. Of
        equally good choices always the same; the result does not depend on threads.

    Raises:
        ValueError: no part, or a part without placements.

    Source: Iiyama, Kameda and Minoh, section 3; the bounds are ours (the union of sets is
    submodular).
    """
    if not bits or any(not len(part) for part in bits):
        raise ValueError("every part needs at least one placement")
    parts = [
        _Part(i, np.arange(len(rows)), np.ascontiguousarray(rows), -np.asarray(cost, float))
        for i, (rows, cost) in enumerate(zip(bits, costs, strict=True))
    ]
    chosen = _solve(parts)
    choice = tuple(chosen[i] for i in range(len(parts)))
    union = np.bitwise_or.reduce([rows[k] for rows, k in zip(bits, choice, strict=True)])
    return choice, float(np.bitwise_count(union).sum()) - sum(
        float(cost[k]) for cost, k in zip(costs, choice, strict=True)
    )


def enumerate_together(
    bits: list[np.ndarray], costs: list[np.ndarray]
) -> tuple[tuple[int, ...], float]:
    """As `best_together`, by trying every combination. The reference for tests; exponential."""
    best: tuple[tuple[int, ...], float] = ((), -np.inf)
    for choice in itertools.product(*(range(len(part)) for part in bits)):
        union = np.bitwise_or.reduce([part[k] for part, k in zip(bits, choice, strict=True)])
        score = float(np.bitwise_count(union).sum()) - sum(
            cost[k] for cost, k in zip(costs, choice, strict=True)
        )
        if score > best[1]:
            best = (choice, score)
    return best


def _solve(parts: list[_Part]) -> dict[int, int]:
    """Returns the best placement of every part, by the part's number."""
    nothing = np.zeros(parts[0].bits.shape[1], np.uint64)
    alone = [part.gains(nothing) for part in parts]
    if len(parts) == 1:
        return {parts[0].number: int(parts[0].rows[alone[0].argmax()])}
    known, score = _good_answer(parts, alone)
    # A placement that even with the best of all others, none in its way, is no better than the
    # known answer: only if it is part of it.
    spare = sum(float(gain.max()) for gain in alone) - score
    kept = [gain > gain.max() - spare for gain in alone]
    for mask, k in zip(kept, known, strict=True):
        mask[k] = True
    fewer = [part.only(mask) for part, mask in zip(parts, kept, strict=True)]
    groups = _touching(fewer)
    if len(groups) > 1:
        return {number: row for group in groups for number, row in _solve(group).items()}
    reduced = [_undominated(part) for part in _contested(fewer)]
    if sum(len(part.rows) for part in reduced) < _WORTH_ANOTHER * sum(
        len(part.rows) for part in parts
    ):
        return _solve(reduced)
    # The part that can explain most is decided first: its choice narrows the others most.
    empty = np.zeros(reduced[0].bits.shape[1], np.uint64)
    order = sorted(range(len(reduced)), key=lambda i: (-reduced[i].gains(empty).max(), i))
    ordered = [reduced[i] for i in order]
    found = _search(ordered, score)
    if found is None:
        return {part.number: int(part.rows[k]) for part, k in zip(parts, known, strict=True)}
    return {part.number: int(part.rows[k]) for part, k in zip(ordered, found, strict=True)}


def _good_answer(parts: list[_Part], alone: list[np.ndarray]) -> tuple[list[int], float]:
    """Chooses greedily, the most promising part first, then lets each part choose again until none
    finds anything better.
    """
    choice = [-1] * len(parts)
    covered = [np.zeros(parts[0].bits.shape[1], np.uint64) for _ in parts]
    order = sorted(range(len(parts)), key=lambda i: (-alone[i].max(), i))
    changed = True
    while changed:
        changed = False
        for i in order:
            taken = np.bitwise_or.reduce([covered[j] for j in range(len(parts)) if j != i])
            gains = parts[i].gains(taken)
            best = int(gains.argmax())
            if choice[i] < 0 or gains[best] > gains[choice[i]] + 1e-9:
                choice[i], covered[i], changed = best, parts[i].bits[best], True
    union = np.bitwise_or.reduce(covered)
    return choice, float(np.bitwise_count(union).sum()) + sum(
        float(part.gain[k]) for part, k in zip(parts, choice, strict=True)
    )


def _touching(parts: list[_Part]) -> list[list[_Part]]:
    """Groups the parts some of whose placements share voxels, directly or through others."""
    areas = [np.bitwise_or.reduce(part.bits, axis=0) for part in parts]
    group = list(range(len(parts)))
    for i in range(len(parts)):
        for j in range(i):
            if group[i] != group[j] and count_common(areas[i], areas[j]):
                old, new = group[i], group[j]
                group = [new if g == old else g for g in group]
    return [
        [part for part, g in zip(parts, group, strict=True) if g == label]
        for label in sorted(set(group))
    ]


def _contested(parts: list[_Part]) -> list[_Part]:
    """Keeps as sets only the voxels that several parts could cover; the others are earned by
    whoever covers them.
    """
    once, several = np.zeros_like(parts[0].bits[0]), np.zeros_like(parts[0].bits[0])
    for part in parts:
        area = np.bitwise_or.reduce(part.bits, axis=0)
        several |= once & area
        once |= area
    columns = np.flatnonzero(np.unpackbits(several.view(np.uint8), bitorder="little"))
    words = max((len(columns) + 63) // 64, 1)
    found = []
    for part in parts:
        sets = np.zeros((len(part.bits), 64 * words), np.uint8)
        sets[:, : len(columns)] = np.unpackbits(
            part.bits.view(np.uint8), axis=1, bitorder="little"
        )[:, columns]
        packed = np.packbits(sets, axis=1, bitorder="little").view(np.uint64)
        own = np.bitwise_count(part.bits & ~several).sum(1)
        found.append(_Part(part.number, part.rows, packed, part.gain + own))
    return found


def _undominated(part: _Part) -> _Part:
    """Leaves out placements to which another one is to be preferred, whatever the other parts take."""
    dominated = np.zeros(len(part.bits), np.bool_)
    # The likely winners first: most others fall to them.
    order = np.argsort(-part.gains(np.zeros(part.bits.shape[1], np.uint64)), kind="stable")
    find_dominated(np.ascontiguousarray(part.bits[order]), part.gain[order], dominated)
    return part.only(np.sort(order[~dominated]))


def _search(parts: list[_Part], score: float) -> list[int] | None:
    """Returns the placements with the best score above the given one, or None."""
    found = None
    ticket = itertools.count()
    start = np.zeros(parts[0].bits.shape[1], np.uint64)
    queue = [(-np.inf, next(ticket), 0.0, [], start)]
    while queue:
        negative, _, reached, chosen, taken = heapq.heappop(queue)
        if -negative <= score:
            break
        depth = len(chosen)
        gains = [part.gains(taken) for part in parts[depth:]]
        later = sum(float(gain.max()) for gain in gains[1:])
        bound = reached + float(gains[0].max()) + later
        if bound <= score:
            continue
        if bound < -negative and queue and bound < -queue[0][0]:
            # The bound inherited from the parent was too high: put the choice back where it
            # belongs.
            heapq.heappush(queue, (-bound, next(ticket), reached, chosen, taken))
            continue
        for k in np.argsort(-gains[0], kind="stable"):
            total = reached + float(gains[0][k])
            if total + later <= score:
                break
            if depth + 1 == len(parts):
                found, score = [*chosen, int(k)], total
                break
            heapq.heappush(
                queue,
                (
                    -(total + later),
                    next(ticket),
                    total,
                    [*chosen, int(k)],
                    taken | parts[depth].bits[k],
                ),
            )
    return found
