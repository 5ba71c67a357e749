"""Proposals of the poses of a body that is no person's: samples that explain a silhouette."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray, FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.person import Person, area_distance
from silhouette_core.monocular.tracking.observed_frame import FrameProposal, Proposer
from silhouette_core.monocular.tracking.silhouette_weights import relative_weights
from silhouette_core.monocular.tree.descent import SHIFTS_PX, Alignments, Posterior, tree_posterior
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tuning import DISTANCES, FILTER, ROOT_SEARCH
from silhouette_core.monocular.window import look_at
from silhouette_core.motion.dynamics import pose_step_sigma
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import PosePrior, RefineSettings, RefineStart
from silhouette_core.refinement.surface import Surface
from silhouette_core.scoring.backend import Backend, Target
from silhouette_core.tracking.beam import select_different
from silhouette_core.tuning import REFINEMENT

_COUNT = 9  # distances tried
_CONSIDERED, _SEEDS = 150, 16  # samples of a frame
_FROM_LIBRARY = RefineSettings(reaches_m=REFINEMENT.near_reaches_m)


def find_samples(
    library: PoseLibrary,
    camera: Camera,
    mask: BoolArray,
    backend: Backend,
    distance_m: float | None = None,
) -> Posterior:
    """Posterior of a frame if all samples are as likely before.

    Args:
        camera: pinhole camera without distortion.
        mask: (h, w) bool, the silhouette, not empty.
        distance_m: of the body; None: several are tried about that by the silhouette's area.
    """
    px_per_m = STATURE_PX / library.model.length_m
    if distance_m is None:
        usual_m2 = float(np.median(library.areas.sum(axis=1))) / px_per_m**2
        factors = np.exp(np.linspace(-DISTANCES.first_range, DISTANCES.first_range, _COUNT))
        distances_m = area_distance(camera, mask, usual_m2) * factors
    else:
        distances_m = np.array([distance_m])
    windows = tuple(look_at(camera, mask, float(one), px_per_m) for one in distances_m)

    def target_of(reduction: int) -> Target:
        masks, weights = zip(*(relative_weights(one, reduction) for one in windows), strict=True)
        return Target(masks, weights, SHIFTS_PX)  # pixels of the level

    # The pitch of a view is a property of the camera.
    off = (library.views[:, 1] - windows[0].pitch_rad) / np.radians(DISTANCES.pitch_sigma_deg)
    prior = np.exp(-0.5 * off[library.sample_view, None] ** 2)
    alignments = Alignments(windows, SHIFTS_PX, target_of)
    return tree_posterior(library, prior, alignments, FILTER.sigma, backend)


@dataclass(frozen=True, eq=False)
class SampleProposal(FrameProposal):
    """Samples of one frame: nobody knows which poses such a body usually takes."""

    samples: PoseArrays  #: likeliest first, in the world.
    body_distance_m: float  #: distance of the body.
    root: Pose | None  #: place of a root that stands still, with any joint angles; None: it moves.
    different_m: float  #: Mean distance of joints within which samples explain it alike.

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
