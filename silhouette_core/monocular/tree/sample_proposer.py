"""Proposals of the poses of a body that is no person's: samples that explain a silhouette."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.camera import Camera
from calib.checks import FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.observed_frame import FrameProposal, Proposer
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.sample_search import find_samples
from silhouette_core.monocular.tuning import ROOT_SEARCH
from silhouette_core.motion.dynamics import pose_step_sigma
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend
from silhouette_core.tracking.beam import select_different
from silhouette_core.tuning import REFINEMENT

_CONSIDERED, _SEEDS = 150, 16  # samples of a frame
_FROM_LIBRARY = RefineSettings(reaches_m=REFINEMENT.near_reaches_m)


@dataclass(frozen=True, eq=False)
class SampleProposal(FrameProposal):
    """Samples of one frame: nobody knows which poses such a body usually takes."""

    samples: PoseArrays  #: likeliest first, in the world.
    body_distance_m: float  #: distance of the body.
    root: Pose | None  #: place of a root that stands still, with any joint angles; None: it moves.
    different_m: float
    """Mean distance of the joints within which two samples explain a silhouette alike."""

    @property
    def distance_m(self) -> float:
        """Distance of the body."""
        return self.body_distance_m

    def starts(self, surface: Surface, contour: Observation) -> list[RefineStart]:
        """The likeliest samples that are different from each other."""
        model, root = surface.model, self.root
        sigma = _deviations(model, root is not None)
        joints = landmarks(model, *place(model, *self.samples.arrays))
        order = np.arange(len(joints))
        chosen = select_different(joints, order, _SEEDS, self.different_m)
        poses = [self.samples.poses()[k] for k in chosen]
        if root is not None:
            poses = [Pose(root.root_m, root.root_rotation, pose.angles_rad) for pose in poses]
        return [RefineStart(pose, _FROM_LIBRARY, PosePrior(pose, sigma)) for pose in poses]


class SampleProposer(Proposer):
    """Proposes the poses of a body that is no person's, which has no skin."""

    def __init__(
        self,
        library: PoseLibrary,
        camera: Camera,
        backend: Backend,
        root: Pose | None,
        different_m: float,
    ):
        self.model = library.model
        self._library, self._camera, self._backend = library, camera, backend
        self._root, self._different_m = root, different_m

    def note(self, time_s: float, person: Person) -> SampleProposal:
        """The frame's proposal."""
        root, root_distance_m = self._root, None
        if root is not None:
            root_distance_m = float(np.linalg.norm(root.root_m - self._camera.center_m))
        posterior = find_samples(
            self._library, self._camera, person.mask, self._backend, root_distance_m
        )
        likeliest = posterior.poses(slice(_CONSIDERED))
        return SampleProposal(likeliest, posterior.distance_m, root, self._different_m)

    def propose(
        self, notes: Sequence[SampleProposal], people: Sequence[Person], first: bool
    ) -> Sequence[SampleProposal]:
        """See `observed_frame.Proposer.propose`."""
        return notes


def _deviations(model: BodyModel, held: bool) -> FloatArray:
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
