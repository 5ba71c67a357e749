"""Estimator of paper A, whole: silhouettes, tree, filter, likeliest sample."""

import hashlib
import json
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from platformdirs import user_cache_path

from calib.camera import Camera, Rig
from calib.checks import BoolArray, FloatArray
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.body.presets import nearest_preset
from silhouette_core.estimator import Estimate, FrameSource, Settings, read_options
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.jit import set_threads
from silhouette_core.monocular.body_library import some_silhouettes
from silhouette_core.monocular.monocular_estimator import (
    HypothesisStore,
    check_person,
    person_in,
    upright_frame,
)
from silhouette_core.monocular.monocular_stages import assumed_stature
from silhouette_core.monocular.person import upright_distance
from silhouette_core.monocular.person_finder import LONG_SIDE_PX, PersonFinder
from silhouette_core.monocular.tree.base_poses import base_poses
from silhouette_core.monocular.tree.build import build_library
from silhouette_core.monocular.tree.paper_filter import PaperFilter, initial_prior
from silhouette_core.monocular.tree.pose_library import LibrarySettings, PoseLibrary
from silhouette_core.monocular.tree.rendering import STATURE_PX
from silhouette_core.monocular.tree.store import VERSION, read_library, write_library
from silhouette_core.monocular.tree.transitions import transitions
from silhouette_core.monocular.window import look_at
from silhouette_core.motion.body_source import load_body
from silhouette_core.motion.conditioning import conditioned
from silhouette_core.motion.keyposes import keypose_motions
from silhouette_core.motion.kinematics import centres_of, quaternions
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.pose import Pose, PoseArrays
from silhouette_core.progress import Reporter, StageClock
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.backend import Backend, load_backend
from silhouette_core.scoring.silhouette_error import mask_errors
from silhouette_core.setting_types import Start

_SAMPLES = 24_000  # of a dictionary of the program's own movements
_PITCH_STEP_DEG = 5
_CACHED = 8  # dictionaries in the user's cache, 60 MB each
_HYPOTHESES = 5  # samples that are stored of a frame, at most


@dataclass(frozen=True)
class TreeOptions:
    """Options of this estimator only."""

    library: str = ""
    """Path of a pose library, which is used as it is; empty: one of the program's own movements is
    built for the body, and kept."""
    start: Start = "facing"
    """Either "facing" (a Gaussian about the upright pose that faces the camera) or "any"."""
    body: str = ""
    """The person's body, as `load_body` names it; empty: of the paper's 24 the one nearest in
    stature and chest girth."""


class TreeEstimator:
    """Estimates motion from one camera as paper A does: no refinement, no later frames.

    Source: Okada and Stenger.
    """

    name = "tree"
    takes_body = True
    usual_background = "paper"

    def estimate(self, source: FrameSource, settings: Settings, reporter: Reporter) -> Estimate:
        """See `silhouette_core.estimator.Estimator.estimate`."""
        options = read_options(TreeOptions, settings.options, self.name)
        set_threads(settings.threads)
        frame, name = upright_frame(source.rig, settings, reporter), source.rig.names[0]
        camera = frame.rig(source.rig).cameras[0]
        reporter.stage("background")
        silhouettes = Silhouettes(source, settings.background, LONG_SIDE_PX)
        silhouettes.note(reporter)
        check_person(source, silhouettes, True)
        pinhole, masks = some_silhouettes(source, silhouettes, camera)
        pitches = [look_at(pinhole, mask, 1.0, STATURE_PX).pitch_rad for mask in masks]
        library = library_of(float(np.median(pitches)), settings, options, reporter)
        clock, hypotheses = StageClock(), HypothesisStore(frame)
        reporter.stage("motion model")
        backend = load_backend(settings.backend)
        follower = TreeFollower(library, pinhole, options.start, 1 / source.fps, backend)
        finder, poses, noted, absent = PersonFinder(camera, False), [], [], set[int]()
        reporter.stage("tracking", source.frame_count)
        for step, (number, time_s, frames) in enumerate(source):
            with clock("total"):
                with clock("silhouettes"):
                    person, nobody = person_in(frames[name], name, step, silhouettes, finder)
                if nobody:
                    absent.add(number)
                if person is not None:
                    with clock("estimation"):
                        pose, error, probability, joints = follower.step(time_s, person.mask)
                    hypotheses.put(number, probability, joints)
                    poses.append(pose)
                    noted.append((number, time_s, 1 - error))
            reporter.advance()
        stacked, (numbers, times, agreement) = PoseArrays.from_poses(poses), np.array(noted).T
        motion = Motion(
            source.fps,
            library.model,
            stacked.root_m,
            quaternions(stacked.root_rotation),
            stacked.angles_rad,
            numbers.astype(int),
            times,
            {"outline_agreement": np.clip(agreement, 0.0, 1.0)},
        )
        facts = {
            "stature_given": settings.stature_m is not None,
            "library": {"file": options.library or "the program's movements"}
            | {"samples": len(library), "nodes": [len(level) for level in library.levels]},
            "moving_cameras": silhouettes.moving,
            "by_texture": silhouettes.by_texture,
        }
        stages = {stage: np.array(seconds) for stage, seconds in clock.seconds.items()}
        # A filter without lag would use later frames.
        motion = conditioned(motion, settings.applied_conditioning.chosen("none")).in_world(frame)
        return Estimate(motion, stages, facts, hypotheses, absent_frames=frozenset(absent))


class TreeFollower:
    """Follows somebody from frame to frame by paper A's filter.

    Args:
        pinhole: camera without distortion, z up.
        start: see `TreeOptions`.
        interval_s: time between two frames.
    """

    def __init__(
        self, library: PoseLibrary, pinhole: Camera, start: str, interval_s: float, backend: Backend
    ):
        self._library, self._pinhole, self._facing = library, pinhole, start == "facing"
        self._transitions = transitions(library, True, normalised=False, interval_s=interval_s)
        self._interval_s, self._backend = interval_s, backend
        self._views = PinholeViews.from_rig(Rig((pinhole,)))
        self._filter: PaperFilter | None = None

    def step(self, time_s: float, mask: BoolArray) -> tuple[Pose, float, FloatArray, FloatArray]:
        """The likeliest pose in the next frame, of which the mask (h, w), not empty, is the
        silhouette, and its error; probabilities (n,) and joints (n, 15, 3) of poses, it first.
        """
        if self._filter is None:
            even = np.full(len(self._library), 1 / len(self._library))
            self._filter = PaperFilter(
                self._library,
                self._transitions,
                self._pinhole,
                upright_distance(self._pinhole, mask, self._library.model.length_m),
                initial_prior(self._library) if self._facing else even,
                self._backend,
                interval_s=self._interval_s,
            )
        posterior = self._filter.step(time_s, mask)
        probability = posterior.probability.max(axis=1)[:_HYPOTHESES]
        poses = posterior.poses(slice(_HYPOTHESES)).poses()
        model, likeliest = self._library.model, poses[:1]
        (error,) = mask_errors(model, likeliest, self._views, [mask], self._backend).tolist()
        return poses[0], error, probability / probability.sum(), centres_of(model, poses)


def library_of(
    pitch_rad: float, settings: Settings, options: TreeOptions, reporter: Reporter
) -> PoseLibrary:
    """The library that the options name, else one of the body seen at an angle, rounded so that it
    serves again. Its body is as tall as the person: a larger one farther away looks alike. Raises
    InputError where there is no such body or library, or it is no person's.
    """
    library = read_library(Path(options.library)) if options.library else None
    model = _body(options, settings, reporter) if library is None else library.model
    if model.person is None:
        raise InputError(
            f"{options.library or options.body} is no person's body: leave --method paper out,"
            " samples of the tree lead the search of other bodies anyway"
        )
    if library is None:
        pitch_deg = _PITCH_STEP_DEG * np.rint(np.degrees(pitch_rad) / _PITCH_STEP_DEG)
        library = dictionary(model, float(pitch_deg), reporter)
    if settings.stature_m is None or options.body:
        return library
    return replace(library, model=model.scaled(settings.stature_m))


def dictionary(model: BodyModel, pitch_deg: float, reporter: Reporter) -> PoseLibrary:
    """Library of a body in the program's own movements, seen from a camera's height; it is built
    once and kept in the user's cache.
    """
    settings = LibrarySettings(_SAMPLES, pitches_deg=(min(max(pitch_deg, -60.0), 75.0),))
    digest = hashlib.sha256(json.dumps([VERSION, asdict(settings)]).encode())
    digest.update(np.ascontiguousarray(model.vertices_m).tobytes())
    reporter.stage("pose library")
    motions = keypose_motions(model)
    for motion in motions.values():
        digest.update(np.ascontiguousarray(motion.angles_rad).tobytes())
    file = user_cache_path("voxelpose") / "libraries" / f"{digest.hexdigest()[:16]}.vplib"
    with suppress(InputError):  # it is not there, or damaged
        return read_library(file)
    library = build_library(base_poses(motions, settings), model, settings, reporter)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write_library(library, file)
        cached = sorted(file.parent.glob("*.vplib"), key=lambda one: one.stat().st_mtime)
        for old in cached[:-_CACHED]:
            old.unlink()
    except (OSError, InputError) as error:
        reporter.note(f"the pose library is not kept, since {file} cannot be written: {error}")
    return library


def _body(options: TreeOptions, settings: Settings, reporter: Reporter) -> BodyModel:
    """The body that the options name, else of the paper's 24 the nearest."""
    if options.body:
        return load_body(options.body)
    stature_m = assumed_stature(settings, reporter)
    preset = nearest_preset(stature_m, settings.chest_m, settings.sex)
    reporter.note(f"body: {preset.name} of {preset.standard}, the nearest of 24, scaled")
    return preset.body()
