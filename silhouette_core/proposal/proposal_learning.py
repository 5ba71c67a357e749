"""Training of the proposal on virtual takes of recorded motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter, SilentReporter
from silhouette_core.proposal.mixture_network import MixtureNetwork
from silhouette_core.proposal.network_training import TrainingBatch, TrainingSettings, train_network
from silhouette_core.proposal.pose_proposal import PoseProposal
from silhouette_core.proposal.silhouette_features import (
    COMPONENTS,
    FEET_COMPONENTS,
    SHADING_COMPONENTS,
    SKIN_COMPONENTS,
    FrameFeatures,
    SilhouetteBasis,
    SilhouetteCodes,
    fit_basis,
    nearby_frames,
    network_inputs,
)
from silhouette_core.proposal.varied_motion import vary_motion
from silhouette_core.proposal.virtual_takes import (
    VirtualBodies,
    VirtualTake,
    film_take,
    mirror_image,
    plan_takes,
)
from silhouette_core.read_ahead import side_by_side

_BETWEEN_S = 10.0  # between takes: no instant that is read lies in another take
_FIRST_TAKES = 120  # takes in random order, from which the basis is made
_BASIS_GRIDS = 4000
_AT_ONCE = 24  # takes that are filmed side by side
_CAUSAL, _COLOURLESS = 1 / 3, 1 / 3  # of the samples
_GRIDS = {
    "coverage": COMPONENTS,
    "feet": FEET_COMPONENTS,
    "skin": SKIN_COMPONENTS,
    "shading": SHADING_COMPONENTS,
}
_LEAST_STEPS = 200


@dataclass(frozen=True)
class LearningSettings:
    """Settings of the proposal.

    Attributes:
        frames: largest number of virtual frames.
        takes: largest number of virtual takes of each recorded frame.
        mirror: whether the mirror image of each frame is learned from as well.
        all_varied: whether the motion of all takes is varied instead of that of every other one.
        passes: how often each virtual frame and mirror image is learned from, if that takes fewer
            steps than `training` allows.
        training: settings of the training.
        seed: seed of everything random.
    """

    frames: int = 800_000
    takes: int = 60
    mirror: bool = True
    all_varied: bool = False
    passes: float = 5.0
    training: TrainingSettings = field(default_factory=TrainingSettings)
    seed: int = 0


@dataclass(frozen=True, eq=False)
class FilmedFrames:
    """Frames of all takes.

    Attributes:
        features: their features; takes are 10 s apart.
        joints: (T, 14, 3) float32, as in `VirtualTake`.
        offset: (T, 3) float32, as in `VirtualTake`.
    """

    features: FrameFeatures
    joints: NDArray[np.float32]
    offset: NDArray[np.float32]


def learn_proposal(
    motions: Sequence[Motion],
    model: BodyModel,
    settings: LearningSettings | None = None,
    reporter: Reporter | None = None,
) -> PoseProposal:
    """Proposal that has learned to tell recorded motion from its silhouettes.

    Args:
        motions: recorded motion, of the body.
        model: the body of the library; random bodies around it are filmed.
        settings: settings; None: the usual ones.
        reporter: informed of the stages.

    Returns:
        The proposal; the same inputs give the same one, for any number of threads.

    Raises:
        InputError: there is too little motion.
    """
    settings, reporter = settings or LearningSettings(), reporter or SilentReporter()
    streams = np.random.SeedSequence(settings.seed).spawn(4)
    plan, film, fit, train = (np.random.default_rng(stream) for stream in streams)
    recorded = sum(round(len(motion) * min(1.0, 30 / motion.fps)) for motion in motions)
    stretches = plan_takes(motions, min(settings.frames, settings.takes * recorded), plan)
    if not stretches:
        raise InputError(
            "the proposal needs motion of at least half a second: give more, or --no-proposal"
        )
    reporter.stage("filming the motion", sum(map(len, stretches)))
    # How BLAS and LAPACK round depends on their number of threads, on some processors even of short
    # products.
    with threadpool_limits(1, user_api="blas"):
        filmed, bases = _film(stretches, VirtualBodies(model), settings, film, fit, reporter)
        return PoseProposal(**bases, network=_trained(filmed, settings, train, reporter))


def _film(
    stretches: Sequence[Motion],
    bodies: VirtualBodies,
    settings: LearningSettings,
    film: np.random.Generator,
    fit: np.random.Generator,
    reporter: Reporter,
) -> tuple[FilmedFrames, dict[str, SilhouetteBasis]]:
    """Frames of all stretches and, if wanted, their mirror images, and the bases of the grids."""
    # Each take has random numbers of its own.
    streams = film.spawn(len(stretches))

    def filmed(number: int) -> VirtualTake:
        motion, rng = stretches[number], streams[number]
        if settings.all_varied or number % 2 == 0:
            motion = vary_motion(motion, stretches, rng)
        return film_take(motion, bodies, rng)

    takes: list[VirtualTake] = []
    codes: list[SilhouetteCodes] = []
    bases: dict[str, SilhouetteBasis] = {}
    groups = [0, *range(_FIRST_TAKES, len(stretches), _AT_ONCE), len(stretches)]
    for first, end in pairwise(groups):
        new = side_by_side(filmed, range(first, end))
        count = sum(map(len, new))
        if settings.mirror:
            new = [either for take in new for either in (take, mirror_image(take))]
        if not bases:
            chosen = fit.permutation(sum(map(len, new)))[:_BASIS_GRIDS]
            for name, components in _GRIDS.items():
                grids = np.concatenate([getattr(take, name) for take in new])
                bases[name] = fit_basis(grids[chosen], components, fit)
        codes += side_by_side(partial(_codes, bases), new)
        # Grids would fill the memory.
        takes += [
            replace(take, **{name: getattr(take, name)[:0].copy() for name in _GRIDS})
            for take in new
        ]
        reporter.advance(count)
    starts = [0.0, *np.cumsum([take.time_s[-1] - take.time_s[0] + _BETWEEN_S for take in takes])]
    time_s = [
        take.time_s - take.time_s[0] + start for take, start in zip(takes, starts[:-1], strict=True)
    ]
    features = FrameFeatures(
        SilhouetteCodes.joined(codes),
        np.concatenate([take.pitch_rad for take in takes]),
        np.concatenate([take.heading_rad for take in takes]),
        np.concatenate([take.anchor for take in takes]),
        np.concatenate(time_s),
    )
    joints, offset = (
        np.concatenate([getattr(take, name) for take in takes]) for name in ("joints", "offset")
    )
    return FilmedFrames(features, joints, offset), bases


def _codes(bases: dict[str, SilhouetteBasis], take: VirtualTake) -> SilhouetteCodes:
    """Codes of a take, float16: half the memory, and rounded less than the noise in training."""
    encoded = {
        name: basis.encode(getattr(take, name)).astype(np.float16) for name, basis in bases.items()
    }
    return SilhouetteCodes(**encoded, coloured=np.ones(len(take), bool))


def _trained(
    filmed: FilmedFrames,
    settings: LearningSettings,
    rng: np.random.Generator,
    reporter: Reporter,
) -> MixtureNetwork:
    """Network trained on frames."""
    training, count = settings.training, len(filmed.features)
    steps = round(settings.passes * count / training.batch)
    training = replace(training, steps=min(training.steps, max(steps, _LEAST_STEPS)))
    nearby = nearby_frames(filmed.features.time_s)

    def draw(rng: np.random.Generator, samples: int) -> TrainingBatch:
        frames = rng.integers(0, count, samples)
        causal = rng.random(samples) < _CAUSAL
        coloured = rng.random(samples) >= _COLOURLESS
        return TrainingBatch(
            network_inputs(filmed.features, frames, nearby[frames], causal, coloured),
            filmed.joints[frames],
            filmed.offset[frames],
        )

    network = MixtureNetwork.initial(
        draw(np.random.default_rng(0), 1).inputs.shape[1],
        training.units,
        training.blocks,
        training.modes,
        filmed.joints.mean(axis=0),
        rng,
    )
    reporter.stage("learning the proposal", training.steps)
    train_network(network, draw, training, rng, reporter)
    return network
