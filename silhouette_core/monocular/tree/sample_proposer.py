"""Proposals of the poses of a body that is no person's: samples of the tree filter's posterior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.beam import select_different
from silhouette_core.monocular.tracking.observed_frame import FrameProposal, Proposer
from silhouette_core.monocular.tree.forward import FilterFrame, ForwardFilter, candidates_of, slim
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.monocular.tuning import ROOT_SEARCH
from silhouette_core.motion.dynamics import pose_step_sigma
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart
from silhouette_core.refinement.surface import Surface
from silhouette_core.tuning import REFINEMENT

_ROWS = 150  # samples of a posterior that are considered
_BY_PROBABILITY, _BY_FIT = 8, 8  # seeds: likeliest samples, and those that fit best
_FROM_LIBRARY = RefineSettings(reaches_m=REFINEMENT.near_reaches_m)


@dataclass(frozen=True, eq=False)
class SampleProposal(FrameProposal):
    """Samples of one frame's posterior: nobody knows which poses such a body usually takes.

    Attributes:
        root: place of a root that stands still, with any joint angles; None: it moves.
        different_m: mean distance of the joints within which two samples explain a silhouette
            alike.
    """

    tree: TreeFilter
    frame: FilterFrame
    root: Pose | None
    different_m: float

    @property
    def distance_m(self) -> float:
        """Distance of the body as the filter estimates it."""
        return self.frame.distance_m

    def starts(self, surface: Surface, contour: Observation) -> list[RefineStart]:
        """The likeliest samples, and those of the leaves that fit best, different from each
        other.
        """
        model, sigma = surface.model, _deviations(surface.model, self.root is not None)
        return [
            RefineStart(pose, _FROM_LIBRARY, PosePrior(pose, sigma)) for pose in self._seeds(model)
        ]

    def _seeds(self, model: BodyModel) -> list[Pose]:
        posterior = self.frame.posterior
        by_fit = np.argsort(posterior.distance, kind="stable")[:_ROWS]
        rows = np.unique(np.concatenate([np.arange(min(len(posterior.samples), _ROWS)), by_fit]))
        samples = candidates_of(self.tree, self.frame, rows)
        joints = landmarks(model, *place(model, *samples.arrays))
        least = self.different_m
        chosen = select_different(joints, np.argsort(rows), _BY_PROBABILITY, least)
        by_fit = np.argsort(posterior.distance[rows], kind="stable")
        chosen += select_different(joints, by_fit, _BY_FIT, least, chosen)
        roots = [(samples.root_m[k], samples.root_rotation[k]) for k in chosen]
        if self.root is not None:
            roots = [(self.root.root_m, self.root.root_rotation)] * len(chosen)
        return [Pose(*root, samples.angles_rad[k]) for root, k in zip(roots, chosen, strict=True)]


class SampleProposer(Proposer):
    """Proposes the poses of a body that is no person's, which has no skin."""

    def __init__(self, forward: ForwardFilter, root: Pose | None, different_m: float):
        self.model = forward.tree.library.model
        self._forward, self._root, self._different_m = forward, root, different_m

    def note(self, time_s: float, person: Person) -> FilterFrame:
        """Posterior of the frame, without its pictures."""
        return slim(self._forward.step(time_s, person.mask), _ROWS)

    def propose(
        self, notes: Sequence[FilterFrame], people: Sequence[Person], first: bool
    ) -> list[SampleProposal]:
        """See `observed_frame.Proposer.propose`."""
        tree = self._forward.tree
        return [SampleProposal(tree, frame, self._root, self._different_m) for frame in notes]


def _deviations(model: BodyModel, held: bool) -> NDArray[np.float64]:
    """Deviations (6 + D,) of a pose from the library's; of a held root, those of a step."""
    sigma = np.concatenate(
        [
            [ROOT_SEARCH.sigma_m] * 3,
            [ROOT_SEARCH.sample_turn_rad] * 3,
            np.full(model.dof_count, ROOT_SEARCH.sample_rad),
        ]
    )
    if held:
        sigma[:6] = pose_step_sigma(model.tree)[:6]
    return sigma
