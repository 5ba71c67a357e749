"""Pose hypotheses of a frame, and the cheapest past of each."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.checks import BoolArray, FloatArray, IntArray
from silhouette_core.motion.pose import Pose
from silhouette_core.ranking import rounded
from silhouette_core.refinement.landmark_prior import LandmarkPrior


@dataclass(frozen=True, eq=False)
class Beam:
    """Pose hypotheses of one frame, K of them.

    Attributes:
        joints: (K, 15, 3) float64, their joints in the world, m.
        distance: (K,) float64, silhouette distances.
        cost: (K,) float64, nats, of the cheapest past through each.
        back: (K,) int64, hypothesis of the previous frame in that past; -1 at a start.
        restarted: (K,) bool, whether the step from that hypothesis is a restart and no movement.
        alone: (K,) float64, nats, of the frame alone, without the past.
        occluded: (K, 27) bool, occlusion flags of the parts, eq. (3).
        priors: K priors of the joints' positions that the poses were refined with, or None.
    """

    poses: list[Pose]
    joints: FloatArray
    distance: FloatArray
    cost: FloatArray
    back: IntArray
    restarted: BoolArray
    time_s: float
    alone: FloatArray
    occluded: BoolArray
    priors: list[LandmarkPrior | None]

    @classmethod
    def of_frame(
        cls,
        poses: list[Pose],
        joints: FloatArray,
        distance: FloatArray,
        cost: FloatArray,
        time_s: float,
        occluded: BoolArray,
        priors: list[LandmarkPrior | None],
    ) -> "Beam":
        """Hypotheses with the costs of their frame alone; arguments as the attributes."""
        cost, count = rounded(cost), len(poses)
        back, restarted = np.full(count, -1), np.ones(count, np.bool_)
        return cls(poses, joints, distance, cost, back, restarted, time_s, cost, occluded, priors)

    def only(self, k: int) -> "Beam":
        """This beam with hypothesis k alone, as the certain past of what follows.

        The frame before is taken to hold one hypothesis alone, too.
        """
        alone = self.chosen([k])
        return replace(alone, back=np.minimum(alone.back, 0))

    def chosen(self, rows: Sequence[int]) -> "Beam":
        """Some of the hypotheses."""
        rows = list(rows)
        return replace(
            self,
            poses=[self.poses[k] for k in rows],
            priors=[self.priors[k] for k in rows],
            **{
                name: getattr(self, name)[rows]
                for name in ("joints", "distance", "cost", "back", "restarted", "alone", "occluded")
            },
        )

    def probabilities(self, temperature: float) -> tuple[FloatArray, list[Pose]]:
        """Probabilities (K,) of the hypotheses, likeliest first, and their poses.

        Costs are divided by the temperature: those of many pixels, joints and frames are not
        independent.
        """
        order = np.argsort(self.cost, kind="stable")
        odds = np.exp(-(self.cost[order] - self.cost[order[0]]) / temperature)
        return odds / odds.sum(), [self.poses[k] for k in order]

    @property
    def best(self) -> int:
        """Index of the cheapest hypothesis."""
        return int(self.cost.argmin())


def backtrack(beams: list[Beam]) -> list[int]:
    """Hypothesis of every frame along the cheapest past, of consecutive frames."""
    chosen = [beams[-1].best]
    for before, beam in zip(beams[-2::-1], beams[:0:-1], strict=True):
        back = int(beam.back[chosen[-1]])
        # Where a track begins anew, what came before ends with its alone cheapest hypothesis.
        chosen.append(back if back >= 0 else before.best)
    return chosen[::-1]


def select_different(joints: FloatArray, order: IntArray, count: int, least_m: float) -> list[int]:
    """Indices of the first poses in an order that differ from each other.

    Args:
        joints: (K, 15, 3) float64, joints of the poses, m.
        order: indices of the poses, best first.
        count: largest number of poses.
        least_m: mean distance of the joints above which two poses differ.
    """
    chosen: list[int] = []
    for k in order:
        if len(chosen) == count:
            break
        if all(
            np.linalg.norm(joints[k] - joints[other], axis=-1).mean() > least_m for other in chosen
        ):
            chosen.append(int(k))
    return chosen
