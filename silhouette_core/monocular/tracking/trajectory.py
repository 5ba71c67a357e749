"""Trajectory of poses from the posteriors of the frames.

Frames are decided in blocks, so that memory does not grow with the length of a video.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.occlusion import occluded_parts, usual_areas
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.tracking.beam import Beam, backtrack
from silhouette_core.monocular.tracking.body_adaptation import adapted_body
from silhouette_core.monocular.tracking.colour_evidence import ColourEvidence
from silhouette_core.monocular.tracking.hypothesis_tracker import HypothesisTracker
from silhouette_core.monocular.tracking.limb_resampling import LimbResampler, PoseFrame
from silhouette_core.monocular.tracking.observed_frame import ObservedFrame
from silhouette_core.monocular.tracking.pose_modes import FrameModes, ModeFinder, ModeView
from silhouette_core.monocular.tracking.tracker_settings import TrackerSettings
from silhouette_core.monocular.tree.forward import FilterFrame, slim
from silhouette_core.monocular.tree.tree_filter import TreeFilter
from silhouette_core.monocular.window import Window
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import StageClock
from silhouette_core.refinement.trajectory_fit import TrajectorySettings, fit_trajectory
from silhouette_core.scoring.silhouette_error import mask_errors

_BLOCK, _AHEAD = 150, 45  # frames decided together, and frames that must follow them
_LONGEST_GAP_S = 1.0
_ROWS = 150  # samples kept of a frame's posterior
_MEMORY_S = 0.5  # of frames that the proposal reads without later ones
# Weights of earlier pictures in the head's colours; without later frames these are learned from
# every fifth frame.
_BLOCKS_KEPT, _FRAMES_KEPT, _COLOURS_EVERY = 0.5, 0.9, 5


@dataclass(frozen=True, eq=False)
class FrameEstimate:
    """A frame of the trajectory.

    Attributes:
        number: number of the frame in the recording.
        time_s: time of the frame.
        pose: estimated pose.
        error: |XOR| / |OR| of the silhouettes.
        occluded: (27,) bool, occlusion flags of the parts in this pose, eq. (3).
        cut: the border of the image cuts the person.
        lost: the filter had lost the person.
        probability: (n,) float64, of the hypotheses of the frame, likeliest first.
        joints: (n, 15, 3) float64, their joints in the world, m.
    """

    number: int
    time_s: float
    pose: Pose
    error: float
    occluded: NDArray[np.bool_]
    cut: bool
    lost: bool
    probability: NDArray[np.float64]
    joints: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _PendingFrame:
    """A frame that is not decided yet.

    Attributes:
        filter_frame: the frame with its posterior, without its pictures.
        bits: (h, w / 8) uint8, the silhouette, packed.
        window: of the silhouette, if the frame is decided at once.
        view: what the proposal reads of it, if there is one.
    """

    filter_frame: FilterFrame
    bits: NDArray[np.uint8]
    window: Window | None
    view: ModeView | None


class PoseTrajectory:
    """Trajectory of poses, frame by frame.

    Args:
        tree: the tree filter.
        camera: pinhole camera without distortion.
        settings: how hypotheses are tracked.
        smooth: decide frames with knowledge of later ones; otherwise at once, from the past.
        clock: times the stages.
        sexes: templates tried when the body is adapted to the person; none: it stays as it is.

    Attributes:
        distance_m: distance of the person in the latest frame, as far as known without later ones.
    """

    def __init__(
        self,
        tree: TreeFilter,
        camera: Camera,
        settings: TrackerSettings,
        smooth: bool,
        clock: StageClock,
        sexes: Sequence[str] = (),
    ):
        """Prepares tracker and resampler."""
        self.camera, self.settings, self.smooth, self.clock = camera, settings, smooth, clock
        self.tree, self.sexes = tree, tuple(sexes)
        self.tracker = HypothesisTracker(tree, camera, settings)
        proposal = tree.library.proposal if settings.refine else None
        self.finder = (
            None if proposal is None else ModeFinder(proposal, camera, tree.library.model.length_m)
        )
        self._colours = ColourEvidence(camera)
        self._usual_areas = usual_areas(tree.library.areas)
        self.distance_m = np.nan
        self._pending: list[_PendingFrame] = []
        self._views: list[ModeView] = []
        self._past: list[Beam] = []  # of the last two decided frames, the chosen hypothesis alone
        self._decided: list[PoseFrame] = []
        self._resampler: LimbResampler | None = None

    @property
    def model(self) -> BodyModel:
        """The body, adapted to the person once there are frames enough."""
        return self.tracker.model

    def add(self, filter_frame: FilterFrame) -> list[FrameEstimate]:
        """Adds a frame; returns the frames that are decided by it, oldest first."""
        self.distance_m = filter_frame.distance_m
        view = None
        if self.finder is not None:
            with self.clock("proposal"):
                view = self._view(filter_frame)
        bits = np.packbits(filter_frame.person.mask, axis=1)
        window = None if self.smooth or view is None else _nearest_window(filter_frame)
        self._pending.append(_PendingFrame(slim(filter_frame, _ROWS), bits, window, view))
        if not self.smooth:
            return self._decide(1)
        return self._decide(_BLOCK) if len(self._pending) >= _BLOCK + _AHEAD else []

    def finish(self) -> list[FrameEstimate]:
        """Returns the frames still undecided."""
        return self._decide(len(self._pending)) if self._pending else []

    def _view(self, filter_frame: FilterFrame) -> ModeView:
        """What the proposal reads of a frame; corrects the distance from it and its past."""
        assert self.finder is not None
        view = self.finder.view(_nearest_window(filter_frame), filter_frame.time_s)
        if not self.smooth:
            view = self._coloured(view, filter_frame.person)
        self._views = [one for one in self._views if view.time_s - one.time_s <= _MEMORY_S] + [view]
        if self.smooth:
            self.distance_m = self.finder.distance(self._views)
        return view

    def _person(self, frame: _PendingFrame) -> Person:
        mask = np.unpackbits(frame.bits, axis=1, count=self.camera.size[0]).view(bool)
        return replace(frame.filter_frame.person, mask=mask)

    def _decide(self, count: int) -> list[FrameEstimate]:
        people = [self._person(frame) for frame in self._pending]
        modes = self._modes(people)
        with self.clock("several poses"):
            observed = [
                self._observed(frame, person, own)
                for frame, person, own in zip(self._pending, people, modes, strict=True)
            ]
            beams = self._beams(observed, modes)
        chosen = backtrack(beams)
        pose_frames = [
            PoseFrame(beam.poses[k], seen)
            for seen, beam, k in zip(observed, beams, chosen, strict=True)
        ]
        if self.settings.refine:
            with self.clock("refinement"):
                pose_frames = self._refined(pose_frames, beams, chosen)
        if not self.smooth and self._pending[0].filter_frame.number % _COLOURS_EVERY == 0:
            joints = [beam.joints[k] for beam, k in zip(beams, chosen, strict=True)]
            self._colours.learn(people[:1], joints, _FRAMES_KEPT)
        decided = [
            self._estimate(frame, pose_frame, beam, k)
            for frame, pose_frame, beam, k in zip(
                self._pending[:count], pose_frames, beams, chosen, strict=False
            )
        ]
        ends = range(max(count - 2, 0), count)
        self._past = [*self._past, *(beams[k].only(chosen[k]) for k in ends)][-2:]
        self._decided = [*self._decided, *(pose_frames[k] for k in ends)][-2:]
        del self._pending[:count]
        return decided

    def _observed(
        self, frame: _PendingFrame, person: Person, modes: FrameModes | None
    ) -> ObservedFrame:
        """A pending frame, prepared for its hypotheses."""
        filter_frame = frame.filter_frame
        distance_m = filter_frame.distance_m if modes is None else modes.distance_m
        observer = self.tracker.observer
        observed = observer.observe(person.mask, distance_m, filter_frame.time_s, frame.window)
        return replace(observed, skin=self._colours.skin(observed.weights, person))

    def _modes(self, people: list[Person]) -> list[FrameModes] | list[None]:
        """Modes of all pending frames; the first time, the body is adapted to them."""
        if self.finder is None:
            return [None] * len(people)
        with self.clock("proposal"):
            if self.smooth:
                modes = self._modes_over_time(people)
            else:
                modes = [self.finder.newest(self._views, self.settings.facing)]
                self.distance_m = modes[0].distance_m
        if self.sexes and self.smooth:
            masks = [person.mask for person in people]
            with self.clock("body"):
                self.tracker.set_body(
                    adapted_body(self.model, self.sexes, self.tracker.views, masks, modes)
                )
            self.sexes = ()
        return modes

    def _modes_over_time(self, people: list[Person]) -> list[FrameModes]:
        """Modes of all pending frames, with the colours of the head as soon as that is found."""
        assert self.finder is not None
        facing = self.settings.facing and not self._decided
        views = [frame.view for frame in self._pending if frame.view is not None]
        views = self.finder.corrected(views, [person.mask for person in people])
        modes = self.finder.find(views, facing=facing)
        if not self._colours.learn(people, [one.likeliest for one in modes], _BLOCKS_KEPT):
            return modes
        views = [self._coloured(*pair) for pair in zip(views, people, strict=True)]
        return self.finder.find(views, facing=facing)

    def _coloured(self, view: ModeView, person: Person) -> ModeView:
        """View of a frame with what lies inside the silhouette, if the colours are known."""
        assert self.finder is not None
        return self.finder.with_inside(view, self._colours.inside(view.window, person))

    def _beams(
        self, observed: list[ObservedFrame], modes: list[FrameModes] | list[None]
    ) -> list[Beam]:
        """Hypotheses of all pending frames."""
        beams: list[Beam] = []
        for frame, seen, own in zip(self._pending, observed, modes, strict=True):
            filter_frame = frame.filter_frame
            past = [*self._past, *beams[-2:]][-2:]
            if (
                filter_frame.lost
                and past
                and filter_frame.time_s - past[-1].time_s > _LONGEST_GAP_S
            ):
                past = []
            beams.append(self.tracker.step(filter_frame, *_last_two(past), own, seen))
        return (
            self._both_ways(observed, beams) if self.smooth and self.settings.both_ways else beams
        )

    def _both_ways(self, observed: list[ObservedFrame], beams: list[Beam]) -> list[Beam]:
        """Hypotheses tracked back from the last frame as well: what a later frame shows is carried
        to those before it.
        """
        pairs = [
            (one.filter_frame, seen) for one, seen in zip(self._pending, observed, strict=True)
        ]
        backward: list[Beam] = []
        for (frame, seen), known in zip(reversed(pairs), reversed(beams), strict=True):
            before = replace(frame, time_s=-frame.time_s), replace(seen, time_s=-seen.time_s)
            later = _last_two(backward)
            backward.append(self.tracker.step(before[0], *later, None, before[1], known))
        result: list[Beam] = []
        for (frame, seen), known in zip(pairs, reversed(backward), strict=True):
            past = _last_two([*self._past, *result[-2:]])
            result.append(self.tracker.step(frame, *past, None, seen, known, False))
        return result

    def _refined(
        self, pose_frames: list[PoseFrame], beams: list[Beam], chosen: list[int]
    ) -> list[PoseFrame]:
        """Poses refined together; of a person without a proposal, the limbs are resampled first."""
        if self.finder is None and self.model.person is not None:
            before = self._decided[-1] if self._decided else None
            resampler = self._limb_resampler()
            return resampler.refine(resampler.resample(pose_frames, before), before)
        poses = fit_trajectory(
            self.tracker.surface,
            [frame.observed.contour for frame in pose_frames],
            [frame.pose for frame in pose_frames],
            np.array([frame.observed.time_s for frame in pose_frames]),
            [beam.priors[k] for beam, k in zip(beams, chosen, strict=True)],
            self.tracker.costs.on_floor,
            settings=self._trajectory_settings(),
            before=[frame.pose for frame in self._decided],
        )
        return [replace(frame, pose=pose) for frame, pose in zip(pose_frames, poses, strict=True)]

    def _trajectory_settings(self) -> TrajectorySettings:
        settings = TrajectorySettings()
        if self.model.person is None:
            settings = settings.steadier()
        return settings if self.smooth else settings.quicker()

    def _limb_resampler(self) -> LimbResampler:
        if self._resampler is None:
            angles = self.tree.library.base_angles.astype(float)
            self._resampler = LimbResampler(self.model, self.tracker.views, angles)
        return self._resampler

    def _estimate(
        self, frame: _PendingFrame, pose_frame: PoseFrame, beam: Beam, chosen: int
    ) -> FrameEstimate:
        """Result of a frame, whose pose comes from one of its hypotheses."""
        pose, observed = pose_frame.pose, pose_frame.observed
        error = mask_errors(
            self.model, [pose], self.tracker.views, [observed.mask], self.tree.backend
        )[0]
        occluded = beam.occluded[chosen]
        if self.finder is None:  # other limbs have been chosen
            weights = observed.weights
            drawn = weights.part_images(self.model, [pose])
            areas = weights.part_areas(drawn, len(self.model.names))
            occluded = occluded_parts(areas[0], self._usual_areas)
        filter_frame = frame.filter_frame
        probability, joints = beam.probabilities()
        return FrameEstimate(
            filter_frame.number,
            filter_frame.time_s,
            pose,
            error,
            occluded,
            filter_frame.person.cut,
            filter_frame.lost,
            probability,
            joints,
        )


def _last_two(beams: Sequence[Beam]) -> tuple[Beam | None, Beam | None]:
    """The last hypotheses and those before them, where there are any."""
    return beams[-1] if beams else None, beams[-2] if len(beams) > 1 else None


def _nearest_window(filter_frame: FilterFrame) -> Window:
    """The window whose assumed distance is nearest to the estimated one."""
    gap = [abs(np.log(w.distance_m / filter_frame.distance_m)) for w in filter_frame.windows]
    return filter_frame.windows[int(np.argmin(gap))]
