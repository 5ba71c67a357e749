r"""How probable a candidate for the person is: the terms of its cost, and their sum.

.. math:: -\log p = n F \, \overline{\log(e_f / e_0)}
    + \tfrac12 \Bigl(\overline{\log(e_f / e_0)} / \sigma_e\Bigr)^2
    + \tfrac12 d^T \Sigma^{-1} d + \dots

Residuals of the silhouettes have an unknown scale in every frame, whose likeliest value is the
frame's error :math:`e_f`; :math:`n` of a frame's residuals count as independent. The errors of
right bodies, of all recordings, are spread about :math:`e_0`. What is unknown, and objects that are
left out, are no part of an error. The numbers are in `PersonCost`, the terms in `cost_terms`.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from silhouette_core.body.model import BodyModel, read_template
from silhouette_core.body.population import sex_probability, usual_range
from silhouette_core.body.sizes import CHESTS_M, STATURES_M, BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.refinement.adaptation import Stature, stature_of
from silhouette_core.tuning import MEASURING, REFINEMENT
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.tuning import HULL_GIRTH, PERSON_COST, PROPOSALS

_CYLINDER_SAMPLES = 101  # along a side of the square in which its hull is looked for
GIRTH_CAMERAS = 4
"""Fewest cameras whose hull says anything of the girth: that of fewer varies too much."""
POSTURES = "any", "sitting"
"""What a candidate does: anything, or sitting as on a chair in all frames."""


def hull_volume_m3(frame: FrameObservation) -> float:
    """Volume of a frame's visual hull."""
    return float(np.count_nonzero(frame.occupancy) * frame.grid.voxel_size_m**3)


def chest_from_hull(model: BodyModel, hull_m3: float) -> float:
    """Chest girth, m, with which a usual body fills a hull, m³, as far as people's go."""
    usual_m3 = HULL_GIRTH.hull_over_body * model.part_volumes_m3(0.02).sum()
    girth = np.sqrt(hull_m3 / usual_m3)
    return float(np.clip(girth * usual_chest(model.sizes.sex) * model.sizes.stature_m, *CHESTS_M))


@lru_cache
def usual_chest(sex: str) -> float:
    """Chest girth of a sex's template over its stature."""
    sizes = read_template(sex).sizes
    return (sizes.chest_girth_m or np.nan) / sizes.stature_m


@dataclass(frozen=True)
class Candidate:
    """Who may be seen, and how."""

    stature: float  #: height, m.
    girth: float | None  #: chest girth, m; None: usual for the stature.
    template: str  #: "male" or "female".
    posture: str = "any"  #: of `POSTURES`.
    objects: bool = False
    """Whether something that stays beside the person is left out of the silhouettes."""

    @property
    def sizes(self) -> BodySizes:
        """Measurements of the body, as far as people's go."""
        girth = None if self.girth is None else float(np.clip(self.girth, *CHESTS_M))
        return BodySizes(float(np.clip(self.stature, *STATURES_M)), girth, self.template)


@dataclass(frozen=True)
class StatureEvidence:
    """Stature told by the user, m, if any, the usual and largest height of the hull, what of the
    standard deviation of a stature's logarithm about these an unknown distance makes, and the
    stature that cameras propose, if they do.
    """

    told_m: float | None
    hull_m: tuple[float, ...] = ()
    distance_sigma: float = 0.0
    proposed_m: float | None = None

    @classmethod
    def from_frames(
        cls, frames: Mapping[int, FrameObservation], settings: Settings
    ) -> "StatureEvidence":
        """StatureEvidence of some frames by number."""
        heights_m = [hull_height_m(frame) for frame in frames.values()]
        unsure = float(np.median([distance_sigma(frame) for frame in frames.values()]))
        return cls(settings.stature_m, (float(np.median(heights_m)), max(heights_m)), unsure)

    @property
    def is_far_open(self) -> bool:
        """Whether the cameras leave open how far away, and so how tall the person is."""
        return self.distance_sigma > PERSON_COST.hull_sigma

    @property
    def beside_hull(self) -> Stature:
        """Stature without the hull: by people's statures, and what cameras propose."""
        usual, adult = MEASURING.usual_m, PERSON_COST.adult_sigma_m**2
        if self.proposed_m is None:
            return Stature(usual, PERSON_COST.adult_sigma_m)
        share = adult / (adult + (PROPOSALS.stature_sigma * self.proposed_m) ** 2)
        sigma_m = np.sqrt((1 - share) * adult)
        return Stature(usual + share * (self.proposed_m - usual), float(sigma_m))

    def prior(self, metres: float) -> Stature:
        """What adaptation of a candidate's body may do to a stature, m: as far as the distance is
        unknown, what is known beside the hull decides.
        """
        if self.told_m is not None:
            return Stature(metres, PERSON_COST.told_sigma_m)
        unsure, beside = (self.distance_sigma * metres) ** 2, self.beside_hull
        share = unsure / (unsure + beside.sigma_m**2)
        variance = (PERSON_COST.hull_sigma * metres) ** 2 + share * beside.sigma_m**2
        return Stature(metres + share * (beside.metres - metres), float(np.sqrt(variance)))

    def statures_m(self, posture: str) -> tuple[tuple[float, ...], ...]:
        """Statures from which searches in a posture begin, likeliest first; a tuple a search."""
        if self.told_m is not None:
            return ((self.told_m,),)
        usual, largest = self.hull_m
        # Somebody who crouches or jumps is as high as the hull is at times.
        varies = np.log(largest / usual) > 2 * PERSON_COST.hull_sigma
        heights = ((usual, largest) if varies else (usual,),) if posture == "any" else ()
        return (*heights, (self.beside_hull.metres,))


def hull_height_m(frame: FrameObservation) -> float:
    """Height of a frame's visual hull above its middle, m: beside it, where few cameras look the
    same way, are the ends of their cones.
    """
    voxels = np.argwhere(frame.occupancy)
    aside = np.hypot(*(voxels[:, :2] - np.median(voxels[:, :2], axis=0)).T)
    near = aside <= max(PERSON_COST.middle_m / frame.grid.voxel_size_m, float(aside.min()))
    return float(np.ptp(voxels[near, 2]) + 1) * frame.grid.voxel_size_m


def distance_sigma(frame: FrameObservation) -> float:
    """Standard deviation of the logarithm of a person's distance from the cameras, as far as the
    outlines leave it open: what is higher by a factor looks the same farther away by that factor.

    It is that of the hull of an upright cylinder, as wide as a torso, in the middle of the frame's
    hull, before the cameras that have a silhouette; less the cylinder's own. The frame's hull
    itself is longer, too, where silhouettes are wrong, and then leaves nothing open.
    """
    middle_m = np.median(frame.grid.occupied_points(frame.occupancy), axis=0)
    centers_m = frame.views.center_m[[mask.any() for mask in frame.masks], :2]
    rays = middle_m[:2] - centers_m
    far_m = np.linalg.norm(rays, axis=1)
    side = np.linspace(-1, 1, _CYLINDER_SAMPLES) * far_m.min()
    aside = np.stack(np.meshgrid(side, side), axis=2).reshape(-1, 1, 2)
    distances = np.linalg.norm(rays + aside, axis=2)
    across = np.abs(rays[:, 0] * aside[..., 1] - rays[:, 1] * aside[..., 0]) / far_m
    along = ((rays + aside) * rays).sum(axis=2)
    inside = (across <= PERSON_COST.middle_m / far_m * distances) & (along > 0)
    distances = distances[inside.all(axis=1)]
    excess = distances.var(axis=0) - (PERSON_COST.middle_m / 2) ** 2  # that of a disc
    return float(np.mean(np.sqrt(np.maximum(excess, 0.0)) / distances.mean(axis=0)))


@dataclass(frozen=True, eq=False)
class ShapePrior:
    """Prior of a body's proportions."""

    stature: Stature
    expected: np.ndarray  #: (K,) the shape that its measurements alone suggest.
    covariance: np.ndarray | None  #: (K, K); None: the body stays as it is.


def cost_terms(
    candidate: Candidate,
    model: BodyModel,
    prior: ShapePrior,
    errors: Sequence[float],
    evidence: StatureEvidence,
    proposed: Sequence[float] = (),
) -> dict[str, float]:
    """Terms of the negative logarithm of a candidate's posterior by name, by independent silhouette
    errors, and by the costs, nats, of poses where cameras propose some; their sum is its cost.
    """
    metres = stature_of(model)
    return {
        "silhouettes": PERSON_COST.frame_residuals * len(errors) * log_error(errors),
        "proposed": sum(proposed),
        "noise": 0.5 * sigmas_above_usual(errors) ** 2,
        "shape": _shape(model.shape - prior.expected, prior.covariance),
        "template": -float(np.log(sex_probability(candidate.template, metres))),
        "stature": _stature(metres, evidence),
        "hull": 0.0 if candidate.posture == "sitting" else _hull(metres, evidence),
        "girth": _girth(candidate),
        "posture": _unusual(candidate.posture == "sitting"),
        "objects": _unusual(candidate.objects),
    }


def log_error(errors: Collection[float]) -> float:
    """Mean logarithm of silhouette errors over the usual one; a frame without a pose has 1."""
    return float(np.mean(np.log(np.minimum([*errors], 1.0) / PERSON_COST.usual_error)))


def sigmas_above_usual(errors: Collection[float]) -> float:
    """Standard deviations by which errors are above those of right bodies."""
    return log_error(errors) / PERSON_COST.error_sigma


def is_improbable(errors: Collection[float]) -> bool:
    """Whether errors are larger than a right body's: then costly candidates are tried as well."""
    return sigmas_above_usual(errors) > PERSON_COST.improbable_sigmas


def is_unusual(error: float, usual: float) -> bool:
    """Whether an error is larger than the usual one by more than right bodies' errors differ."""
    return error > np.exp(PERSON_COST.error_sigma) * usual


def _shape(deviation: np.ndarray, covariance: np.ndarray | None) -> float:
    if covariance is None:
        return 0.0
    return 0.5 * float(deviation @ np.linalg.solve(covariance, deviation))


def _stature(metres: float, evidence: StatureEvidence) -> float:
    if evidence.told_m is not None:
        return 0.5 * ((metres - evidence.told_m) / PERSON_COST.told_sigma_m) ** 2
    expected = evidence.beside_hull
    return 0.5 * ((metres - expected.metres) / expected.sigma_m) ** 2


def _hull(metres: float, evidence: StatureEvidence) -> float:
    """Of the height that fits better; 0 where it is as far off as of somebody who sits."""
    if evidence.told_m is not None or not evidence.hull_m:
        return 0.0
    farthest = REFINEMENT.largest_shape
    sigma = np.hypot(PERSON_COST.hull_sigma, evidence.distance_sigma)
    sigmas = np.abs(np.log(metres / np.array(evidence.hull_m))).min() / sigma
    return 0.5 * float(min(sigmas, farthest) ** 2 - farthest**2)


def _girth(candidate: Candidate) -> float:
    """Of a chest as unusual as the waists of people are."""
    if candidate.girth is None:
        return 0.0
    mean_m, sigma_m = usual_range("waist_girth_m", candidate.stature, candidate.template)
    usual_m = usual_chest(candidate.template) * candidate.stature
    return 0.5 * ((candidate.girth / usual_m - 1) * mean_m / sigma_m) ** 2


def _unusual(chosen: bool) -> float:
    return -float(np.log(PERSON_COST.unusual if chosen else 1 - PERSON_COST.unusual))
