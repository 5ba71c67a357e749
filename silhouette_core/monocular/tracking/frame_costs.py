"""Costs of the pose hypotheses of one frame, in nats, named and summed in one place.

Beyond paper A. A term is a deviation in sigmas, squared and halved; each saturates
where its reason may not hold. `CostSettings` is their table.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from calib.checks import FloatArray
from silhouette_core.monocular.tracking.observed_frame import FrameProposal
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import STEPS


@dataclass(frozen=True)
class CostSettings:
    """Sigma, unit and source of every term. Tuned ones: one camera, seeds 1 to 40."""

    silhouette: float = 0.04
    """Sigma of a refined pose's silhouette distance, 1, relative to the silhouette's weight."""
    sunk_m: float = 0.03  #: sigma of the lowest point below the floor, m: soles and noise.
    hovering_m: float = 0.06  #: sigma of the lowest point above it, m: who walks lifts the heels.
    most_off_floor: float = 3.0  #: Of these sigmas, more costs no more: somebody may jump.
    near_floor_m: float = 0.20
    """Median distance of the lowest point from z = 0 up to which that is the floor."""
    floor_frames: int = 90  #: frames of that median.


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """K pose hypotheses of a frame."""

    poses: list[Pose]
    joints: FloatArray  #: (K, 15, 3) float64, in the world, m.
    distance: FloatArray  #: (K,) float64, silhouette distances.
    surface: Surface
    proposal: FrameProposal


class FrameCosts:
    """The terms of a frame's hypotheses, and their sum.

    Attributes:
        terms: name -> cost (K,) float64, nats, of a frame's K hypotheses.
    """

    def __init__(self, settings: CostSettings):
        self.settings = settings
        self._lowest: deque[float] = deque(maxlen=settings.floor_frames)
        self.terms: dict[str, Callable[[Hypotheses], FloatArray]] = {
            "silhouette": self._silhouette,
            "floor": self._floor,
            "proposal": lambda given: given.proposal.cost(given.joints),
        }

    def __call__(self, given: Hypotheses) -> FloatArray:
        """Cost (K,) float64, nats, of a frame's hypotheses."""
        return np.sum([term(given) for term in self.terms.values()], axis=0)

    @property
    def stood_on(self) -> bool:
        """Whether the body of the latest frames stands on z = 0."""
        return bool(self._lowest) and (
            float(np.median(np.abs(self._lowest))) < self.settings.near_floor_m
        )

    def _silhouette(self, given: Hypotheses) -> FloatArray:
        """The silhouette distance, eq. (10): Gaussian."""
        return 0.5 * (given.distance / self.settings.silhouette) ** 2

    def _floor(self, given: Hypotheses) -> FloatArray:
        """Hovering above the floor or sinking into it, as a leg at a wrong depth does.

        The world's z = 0 counts as the floor as long as the person has mostly stood near it.
        """
        points = given.surface.posed_many(PoseArrays.from_poses(given.poses)).points
        lowest = points[..., 2].min(axis=1)
        self._lowest.append(float(np.median(lowest)))
        if not self.stood_on:
            return np.zeros(len(lowest))
        settings = self.settings
        off = np.where(lowest < 0, -lowest / settings.sunk_m, lowest / settings.hovering_m)
        return 0.5 * np.minimum(off, settings.most_off_floor) ** 2


@dataclass(frozen=True)
class TrackerSettings:
    """How many hypotheses are tracked, and how they are scored."""

    costs: CostSettings = field(default_factory=CostSettings)
    carried: int = 1
    """Number of hypotheses of the previous frame that are carried on: a worse one may be right."""
    most: int = 8  #: number of hypotheses kept per frame.
    surface_points: int = 500  #: Number of the surface's points that are fitted to outlines.
    reduction: int = 2  #: how many times smaller than the window poses are drawn.
    different_m: float = 0.07
    """Mean distance of the joints within which two hypotheses that are carried explain a silhouette
    alike, m."""
    same_m: float = 0.035  #: the same within which two hypotheses are one pose, m.
    restart: float = STEPS.restart
    """Largest cost of a step from frame to frame, nats; what costs more is no movement."""
    temperature: float = 17.0  #: of the hypotheses' probabilities, see `Beam.probabilities`.
    steadiness: float = 1.0  #: factor on the usual steps of joints.
    both_ways: bool = False
    """Whether frames are also tracked from the last to the first, if later ones are waited for."""

    @classmethod
    def of_given_body(cls, length_m: float) -> "TrackerSettings":
        """Settings for a body of a length that is no person's: nobody knows which poses it usually
        takes, its surface is known exactly, and its steps are stated wide.
        """
        return cls(
            CostSettings(silhouette=0.015),
            carried=12,
            most=24,
            reduction=1,
            different_m=0.025 * length_m,
            same_m=0.011 * length_m,
            restart=15.0,
            temperature=6.0,
            steadiness=0.4,
            both_ways=True,
        )

    def coarser(self) -> "TrackerSettings":
        """Settings that keep up with a camera."""
        return replace(self, surface_points=350)
