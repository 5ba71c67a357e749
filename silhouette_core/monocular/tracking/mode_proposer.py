"""Proposals of a person's poses: modes of the learned network, frame after frame.

Beyond paper A. The network reads silhouettes through a window at the person's distance, which it
corrects itself, and as soon as the head is found its colours, too.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.camera import Camera, Rig
from calib.checks import FloatArray
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.proposal.pose_proposal import PoseProposal
from silhouette_core.monocular.tracking.body_adaptation import adapted_body
from silhouette_core.monocular.tracking.colour_evidence import ColourEvidence
from silhouette_core.monocular.tracking.pose_modes import MEMORY_S, FrameModes, ModeFinder, ModeView
from silhouette_core.monocular.window import Window
from silhouette_core.progress import StageClock
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.backend import Backend

_COLOURS_EVERY = 5  # without later frames, the head's colours are learned from every fifth


ModeNote = tuple[ModeView, Window | None]
"""What is kept of a frame: what the network reads of it, and the window's picture, if the frame is
decided at once.
"""


class ModeProposer:
    """Proposes a person's poses; see `observed_frame.Proposer`.

    Args:
        camera: pinhole camera without distortion.
        sexes: templates tried when the body is adapted to the person; none: it stays as it is.
        facing: whether the person mostly faces the camera in the first frame.
        smooth: whether frames are decided with knowledge of later ones.
    """

    def __init__(
        self,
        proposal: PoseProposal,
        camera: Camera,
        model: BodyModel,
        sexes: Sequence[str],
        facing: bool,
        smooth: bool,
        clock: StageClock,
        backend: Backend,
    ):
        self.model, self._camera, self._sexes = model, camera, tuple(sexes)
        self._facing, self._smooth, self._clock, self._backend = facing, smooth, clock, backend
        self._finder = ModeFinder(proposal, camera, model.length_m)
        self._colours = ColourEvidence(camera)
        self._views: list[ModeView] = []  # of the last 0.8 s
        self._distance_m = np.nan

    def note(self, time_s: float, person: Person) -> ModeNote:
        """See `observed_frame.Proposer.note`."""
        self._views = [one for one in self._views if time_s - one.time_s <= MEMORY_S]
        if not self._views:
            self._distance_m = self._finder.first_distance(person.mask, time_s, person.joints)
        window = self._finder.window(person.mask, self._distance_m)
        view = self._finder.view(window, time_s, person.joints)
        if not self._smooth:
            view = self._coloured(view, person)
        self._views.append(view)
        if self._smooth:
            self._distance_m = self._finder.distance(self._views)
        return view, None if self._smooth else window

    def propose(
        self, notes: Sequence[ModeNote], people: Sequence[Person], first: bool
    ) -> list[FrameModes]:
        """See `observed_frame.Proposer.propose`; the first time, the body is adapted to them."""
        if not self._smooth:
            modes = self._finder.newest(self._views, self._facing)
            self._distance_m = modes.distance_m
            return [replace(modes, window=notes[-1][1])]
        modes = self._over_time([view for view, _ in notes], people, first)
        if self._sexes:
            masks = [person.mask for person in people]
            views = PinholeViews.from_rig(Rig((self._camera,)))
            with self._clock("body"):
                self.model = adapted_body(
                    self.model, self._sexes, views, masks, modes, self._backend
                )
            self._sexes = ()
        return modes

    def learn(self, number: int, person: Person, joints_m: FloatArray) -> None:
        """See `observed_frame.Proposer.learn`."""
        if number % _COLOURS_EVERY == 0:
            self._colours.learn([person], [joints_m])

    def _over_time(
        self, views: list[ModeView], people: Sequence[Person], first: bool
    ) -> list[FrameModes]:
        """Modes of all frames, with the colours of the head as soon as that is found."""
        facing = self._facing and first
        views = self._finder.corrected(views, [person.mask for person in people])
        modes = self._finder.find(views, facing=facing)
        if not self._colours.learn(people, [one.likeliest for one in modes]):
            return modes
        views = [self._coloured(*pair) for pair in zip(views, people, strict=True)]
        return self._finder.find(views, facing=facing)

    def _coloured(self, view: ModeView, person: Person) -> ModeView:
        """View of a frame with what lies inside the silhouette, if the colours are known."""
        return self._finder.with_inside(view, self._colours.inside(view.window, person))
