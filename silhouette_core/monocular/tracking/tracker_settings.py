"""How many pose hypotheses are tracked, and how they are scored."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from silhouette_core.image.distance import Weighting
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import USUAL_SPACING_M

_DIFFERENT, _SAME = 0.025, 0.011  # of a given body's length: a turned hand moves few joints


@dataclass(frozen=True)
class TrackerSettings:
    """How many hypotheses are tracked, and how they are scored.

    Attributes:
        refine: False leaves the library's poses as they are.
        weighting: pixel weights of the silhouette distance.
        facing: the person mostly faces the camera in the first frame.
        by_probability: number of seeds from the likeliest samples of the posterior.
        by_fit: number of seeds from the leaves that fit the silhouette best, whatever their prior.
        carried: number of hypotheses of the previous frame that are carried on; a worse one may
            turn out to be right.
        kept: number of hypotheses kept per frame.
        by_mode: number of hypotheses from the modes of the learned proposal, if there is one; then
            fewer are taken from the posterior and carried, see `with_modes`.
        reaching: number of rounds in which limbs of as many of the best hypotheses are put where
            these leave the silhouette uncovered, beside a learned proposal.
        mirrored: number of the best hypotheses whose mirror images in depth are tried, without a
            learned proposal; of a body that is no person's, none are.
        sigma: standard deviation of a refined pose's silhouette distance, relative to the
            silhouette's weight.
        surface_points: number of points of the body's surface that are fitted to the silhouette.
        spacing_m: distance between points of the contour, on the body.
        different_m: mean distance of the joints within which two seeds explain a silhouette alike.
        same_m: the same within which two hypotheses are one pose.
        restart: largest cost of a step from frame to frame, nats; what costs more is no movement.
        temperature: of the hypotheses' probabilities, see `Beam`.
        both_ways: whether frames are also tracked from the last to the first, if later ones are
            waited for.
        root: place of a root that stands still, with any joint angles; None: it moves, or is
            unknown.
    """

    refine: bool = True
    weighting: Weighting = "balanced"
    facing: bool = True
    by_probability: int = 5
    by_fit: int = 3
    carried: int = 8
    kept: int = 16
    by_mode: int = 4
    reaching: int = 2
    mirrored: int = 1
    sigma: float = 0.04
    surface_points: int = 500
    spacing_m: float = USUAL_SPACING_M
    different_m: float = 0.07
    same_m: float = 0.035
    restart: float = 15.0
    temperature: float = 6.0
    both_ways: bool = False
    root: Pose | None = None

    def cost(self, distance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cost (K,), nats, of silhouette distances (K,)."""
        return 0.5 * (distance / self.sigma) ** 2

    def of_given_body(self, length_m: float, root: Pose | None) -> TrackerSettings:
        """Settings for a body that is no person's: nobody knows which poses it usually takes.

        Args:
            length_m: of the body.
            root: place of the root if it stands still.
        """
        return replace(
            self,
            facing=False,
            mirrored=0,
            by_probability=8,
            by_fit=8,
            carried=12,
            kept=24,
            sigma=0.015,
            different_m=_DIFFERENT * length_m,
            same_m=_SAME * length_m,
            both_ways=True,
            root=root,
        )

    def coarser(self) -> TrackerSettings:
        """Settings that keep up with a camera."""
        return replace(self, surface_points=350, spacing_m=0.04, reaching=1)

    def with_modes(self) -> TrackerSettings:
        """Settings beside a learned proposal, which finds most of the hypotheses itself.

        It finds the same again in every frame, so that nobody need turn round all of a sudden.
        """
        return replace(
            self, by_probability=1, by_fit=0, carried=1, kept=8, restart=45.0, temperature=17.0
        )
