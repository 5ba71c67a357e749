"""How many pose hypotheses are tracked, and how they are scored."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from silhouette_core.monocular.tracking.frame_costs import CostSettings
from silhouette_core.refinement.observation import USUAL_SPACING_M


@dataclass(frozen=True)
class TrackerSettings:
    """How many hypotheses are tracked, and how they are scored.

    Attributes:
        carried: number of hypotheses of the previous frame that are carried on; a worse one may
            turn out to be right.
        kept: number of hypotheses kept per frame.
        reaching: number of rounds in which limbs of as many of the best hypotheses are put where
            these leave the silhouette uncovered.
        surface_points: number of points of the body's surface that are fitted to the silhouette.
        spacing_m: distance between points of the contour, on the body, m.
        reduction: how many times smaller than the window poses are drawn.
        different_m: mean distance of the joints within which two hypotheses that are carried
            explain a silhouette alike, m.
        same_m: the same within which two hypotheses are one pose, m.
        restart: largest cost of a step from frame to frame, nats; what costs more is no movement.
        temperature: of the hypotheses' probabilities, see `Beam`.
        steadiness: factor on the usual steps of joints.
        both_ways: whether frames are also tracked from the last to the first, if later ones are
            waited for.
    """

    costs: CostSettings = field(default_factory=CostSettings)
    carried: int = 1
    kept: int = 8
    reaching: int = 2
    surface_points: int = 500
    spacing_m: float = USUAL_SPACING_M
    reduction: int = 2
    different_m: float = 0.07
    same_m: float = 0.035
    restart: float = 45.0
    temperature: float = 17.0
    steadiness: float = 1.0
    both_ways: bool = False

    @classmethod
    def of_given_body(cls, length_m: float) -> TrackerSettings:
        """Settings for a body of a length that is no person's: nobody knows which poses it usually
        takes, its surface is known exactly, and its steps are stated wide.
        """
        return cls(
            CostSettings(silhouette=0.015),
            carried=12,
            kept=24,
            reaching=0,
            reduction=1,
            different_m=0.025 * length_m,
            same_m=0.011 * length_m,
            restart=15.0,
            temperature=6.0,
            steadiness=0.4,
            both_ways=True,
        )

    def coarser(self) -> TrackerSettings:
        """Settings that keep up with a camera."""
        return replace(self, surface_points=350, spacing_m=0.04, reaching=1)
