"""Stages of one camera, frame by frame, for recordings and for live pictures."""

from dataclasses import dataclass
from pathlib import Path

from calib.camera import Camera
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.monocular.occlusion import standing_areas, usual_areas
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.person_finder import LONG_SIDE_PX
from silhouette_core.monocular.proposal.pose_proposal import PoseProposal
from silhouette_core.monocular.proposal.shipped import shipped_proposal
from silhouette_core.monocular.tracking.frame_costs import TrackerSettings
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker
from silhouette_core.monocular.tracking.mode_proposer import ModeProposer
from silhouette_core.monocular.tracking.observed_frame import Proposer
from silhouette_core.monocular.tracking.trajectory import PendingFrame, PoseTrajectory
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.sample_proposer import SampleProposer
from silhouette_core.monocular.tree.store import read_library
from silhouette_core.motion.body_source import load_body
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.scoring.backend import load_backend
from silhouette_core.setting_types import Start
from silhouette_core.tuning import MEASURING


@dataclass(frozen=True)
class MonocularOptions:
    """Options of this estimator only."""

    library: str = ""  #: Path of a pose library, whose proposal is used; empty: the program's.
    start: Start = "facing"
    outline_only: bool = False  #: whether what lies inside the outline is left out.
    body: str = ""
    """The person's body, as `load_body` names it, which is kept as it is; empty: the body is
    adapted to the person."""


@dataclass(frozen=True, eq=False)
class TrackedPerson:
    """A person to be tracked."""

    model: BodyModel
    proposal: PoseProposal


class PoseStages:
    """From a person to poses: what is kept of each frame, then its estimate.

    With later frames, both may run in a thread each, but take their frames in order.

    Args:
        tracked: the person, or the library of another body.
        settings: of the estimation; `smooth` decides whether later frames are waited for.
        root: place of the root of a body that is no person's, if that stands still.
    """

    def __init__(
        self,
        tracked: TrackedPerson | PoseLibrary,
        camera: Camera,
        settings: Settings,
        options: MonocularOptions,
        clock: StageClock,
        root: Pose | None = None,
    ):
        pinhole = UndistortedView.from_camera(camera, LONG_SIDE_PX).pinhole
        model, backend = tracked.model, load_backend(settings.backend)
        if isinstance(tracked, TrackedPerson):
            tracking = TrackerSettings() if settings.smooth else TrackerSettings().coarser()
            areas = standing_areas(model)
            self.proposer: Proposer = ModeProposer(
                tracked.proposal,
                pinhole,
                model,
                () if options.body else _sexes(settings),
                options.start == "facing",
                settings.smooth,
                clock,
                backend,
            )
        else:
            tracking = TrackerSettings.of_given_body(model.length_m)
            areas = usual_areas(tracked.areas)
            self.proposer = SampleProposer(tracked, pinhole, backend, root, tracking.different_m)
        tracker = HypothesisTracker(model, pinhole, areas, tracking, backend)
        self.trajectory = PoseTrajectory(tracker, self.proposer, settings.smooth, clock)
        self._clock = clock

    def noted(self, number: int, time_s: float, person: Person) -> PendingFrame:
        """What is kept of the next frame that shows a person: its number and time, the person."""
        with self._clock("proposal"):
            note = self.proposer.note(time_s, person)
        return PendingFrame.of(number, time_s, person, note)


def person_for(options: MonocularOptions, settings: Settings, reporter: Reporter) -> TrackedPerson:
    """The person as the settings describe them, and the proposal that the options choose. Raises
    InputError where the library cannot be read or has no proposal, or there is no such body.
    """
    proposal, model = shipped_proposal(), None
    if options.library:
        library = read_library(Path(options.library))
        proposal, model = _learned(library, options.library), library.model
    if options.body:
        return TrackedPerson(load_body(options.body), proposal)
    stature_m = assumed_stature(settings, reporter, model and model.sizes.stature_m)
    if model is not None and settings.chest_m is None and settings.sex == "unknown":
        return TrackedPerson(model.scaled(stature_m), proposal)
    sizes = BodySizes(stature_m, settings.chest_m, settings.sex)
    return TrackedPerson(BodyModel.from_sizes(sizes), proposal)


def assumed_stature(settings: Settings, reporter: Reporter, usual_m: float | None = None) -> float:
    """The stature, m: as told, else a usual one, else what is assumed of anybody and noted."""
    for known_m in (settings.stature_m, usual_m):
        if known_m is not None:
            return known_m
    reporter.note(
        f"nobody said how tall the person is: {MEASURING.usual_m:.2f} m is assumed, and all"
        " lengths with it"
    )
    return MEASURING.usual_m


def _learned(library: PoseLibrary, file: str) -> PoseProposal:
    if library.proposal is None:
        raise InputError(
            f"{file}: the library has no proposal, without which a person is not tracked: make it"
            " again with voxelpose library build"
        )
    return library.proposal


def _sexes(settings: Settings) -> tuple[str, ...]:
    """Templates that are tried for the person's body."""
    return ("male", "female") if settings.sex == "unknown" else (settings.sex,)
