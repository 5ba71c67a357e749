"""What a frame shows, prepared once for all that compares poses with it; what it should show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from calib.checks import BoolArray, FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.silhouette_weights import SignedWeights
from silhouette_core.monocular.window import Window
from silhouette_core.refinement.landmark_prior import LandmarkPrior
from silhouette_core.refinement.observation import Observation
from silhouette_core.refinement.refine import RefineStart
from silhouette_core.refinement.surface import Surface


@dataclass(frozen=True, eq=False)
class ObservedFrame:
    """What a frame shows."""

    mask: BoolArray  #: (h, w) bool, the silhouette in the camera's image.
    weights: SignedWeights  #: signed pixel weights of the silhouette's window.
    contour: Observation  #: points of the contour, and distances from the silhouette.
    time_s: float


class FrameProposal(Protocol):
    """Poses that a frame probably shows. What it may leave out says nothing."""

    @property
    def distance_m(self) -> float:
        """Distance of the body from the camera."""
        ...

    @property
    def window(self) -> Window | None:
        """Window of the silhouette at about that distance, if there is one already."""
        return None

    def starts(self, surface: Surface, contour: Observation) -> list[RefineStart]:
        """Starts of hypotheses that no past is needed for."""
        ...

    def cost(self, landmarks_m: FloatArray) -> FloatArray:
        """Cost (K,) float64, nats, of poses with joints (K, 15, 3) in the world, m."""
        return np.zeros(len(landmarks_m))

    def nearest(self, landmarks_m: FloatArray) -> LandmarkPrior | None:
        """Prior of the joints of the proposed pose that is the nearest to one with joints (15, 3);
        None: proposed poses say nothing about others.
        """
        return None


class Proposer(Protocol):
    """Proposes poses, frame after frame."""

    model: BodyModel  #: the body, which may become another one as more of it is seen.

    def note(self, time_s: float, person: Person) -> Any:
        """What is kept of a frame; independent of what is found in others, unless frames are
        decided at once.

        Args:
            person: silhouette, and its colours if they are known.
        """
        ...

    def propose(
        self, notes: Sequence[Any], people: Sequence[Person], first: bool
    ) -> Sequence[FrameProposal]:
        """Proposals of consecutive frames.

        Args:
            first: whether these are the first frames of all.
        """
        ...

    def learn(self, number: int, person: Person, joints_m: FloatArray) -> None:
        """Learns from a decided frame: its number, silhouette and joints (15, 3), m."""
