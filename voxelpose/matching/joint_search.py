"""Several parts at once: the best combination of placements when they may claim the same voxels.

The score of a group is the number of voxels in the union of its parts (a voxel counts once), less each part's own cost for lying in
empty space. Unions grow more slowly than sums, so what a part would add to the parts already chosen bounds what it can add later:
best-first search over partial choices is exact, and stops at the first complete choice that it takes from the queue.
"""

from __future__ import annotations

import heapq
import itertools

import numpy as np

from voxelpose.matching.kernels.bits import count_new


def best_together(bits: list[np.ndarray], costs: list[np.ndarray]) -> tuple[tuple[int, ...], float]:
    """Finds the placements of several parts that together explain most.

    Args:
        bits: for each of n parts (K_i, W) uint64, the voxels that each of its K_i placements covers.
        costs: for each part (K_i,) float64, at least 0: what each placement costs by itself.

    Returns:
        The chosen placement of each part, and the score of the union less the costs. Of equally good choices, the one found first in
        lexicographic order of the search; the result does not depend on threads.

    Raises:
        ValueError: no part, or a part without placements.

    Source: Iiyama, Kameda and Minoh, section 3; the bound is ours (the union of sets is submodular).
    """
    if not bits or any(not len(part) for part in bits):
        raise ValueError("every part needs at least one placement")
    free = np.zeros(bits[0].shape[1], np.uint64)
    alone = [_gains(part, cost, free) for part, cost in zip(bits, costs, strict=True)]
    # The part that can explain most is decided first: its choice narrows the others most.
    order = sorted(range(len(bits)), key=lambda i: (-alone[i].max(), i))
    ordered = [bits[i] for i in order]
    cost = [costs[i] for i in order]
    choice, score = _search(ordered, cost)
    back = [0] * len(bits)
    for place, part in enumerate(order):
        back[part] = choice[place]
    return tuple(back), score


def enumerate_together(bits: list[np.ndarray], costs: list[np.ndarray]) -> tuple[tuple[int, ...], float]:
    """As `best_together`, by trying every combination. The reference for tests; exponential."""
    best: tuple[tuple[int, ...], float] = ((), -np.inf)
    for choice in itertools.product(*(range(len(part)) for part in bits)):
        union = np.bitwise_or.reduce([part[k] for part, k in zip(bits, choice, strict=True)])
        score = float(np.bitwise_count(union).sum()) - sum(cost[k] for cost, k in zip(costs, choice, strict=True))
        if score > best[1]:
            best = (choice, score)
    return best


def _gains(bits: np.ndarray, cost: np.ndarray, taken: np.ndarray) -> np.ndarray:
    new = np.empty(len(bits), np.int64)
    count_new(bits, taken, new)
    return new - cost


def _greedy(bits: list[np.ndarray], costs: list[np.ndarray]) -> tuple[list[int], float]:
    taken, choice, score = np.zeros(bits[0].shape[1], np.uint64), [], 0.0
    for part, cost in zip(bits, costs, strict=True):
        gains = _gains(part, cost, taken)
        choice.append(int(gains.argmax()))
        score += float(gains.max())
        taken = taken | part[choice[-1]]
    return choice, score


def _search(bits: list[np.ndarray], costs: list[np.ndarray]) -> tuple[list[int], float]:
    count = len(bits)
    choice, score = _greedy(bits, costs)
    ticket = itertools.count()
    start = np.zeros(bits[0].shape[1], np.uint64)
    rest = [_gains(part, cost, start).max() for part, cost in zip(bits, costs, strict=True)]
    queue = [(-float(sum(rest)), next(ticket), 0.0, [], start)]
    while queue:
        negative, _, reached, chosen, taken = heapq.heappop(queue)
        if -negative <= score:
            break
        depth = len(chosen)
        gains = [_gains(bits[i], costs[i], taken) for i in range(depth, count)]
        bound = reached + sum(float(gain.max()) for gain in gains)
        if bound <= score:
            continue
        if bound < -negative:
            # The bound inherited from the parent was too high: put the choice back where it belongs.
            heapq.heappush(queue, (-bound, next(ticket), reached, chosen, taken))
            continue
        later = sum(float(gain.max()) for gain in gains[1:])
        for k in np.argsort(-gains[0], kind="stable"):
            total = reached + float(gains[0][k])
            if total + later <= score:
                break
            if depth + 1 == count:
                choice, score = [*chosen, int(k)], total
                break
            heapq.heappush(queue, (-(total + later), next(ticket), total, [*chosen, int(k)], taken | bits[depth][k]))
    return choice, score
