"""Training of the proposal on virtual takes of recorded motion."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from calib.checks import IndexArray
from calib.errors import InputError
from silhouette_core.body.model import BodyModel
from silhouette_core.monocular.making.learning_settings import LearningSettings, TrainingSettings
from silhouette_core.monocular.making.network_training import (
    PictureBatch,
    TrainingBatch,
    train_encoders,
    train_network,
)
from silhouette_core.monocular.making.varied_motion import vary_motion
from silhouette_core.monocular.making.virtual_takes import (
    VirtualBodies,
    VirtualTake,
    film_take,
    mirror_image,
    plan_takes,
)
from silhouette_core.monocular.proposal.mixture_network import MixtureNetwork
from silhouette_core.monocular.proposal.pose_proposal import PoseProposal, SilhouetteEncoding
from silhouette_core.monocular.proposal.silhouette_features import (
    FEET_COMPONENTS,
    FrameFeatures,
    InsideGrids,
    SilhouetteCodes,
    fit_basis,
    inside_images,
    nearby_frames,
    network_inputs,
    outline_images,
)
from silhouette_core.monocular.tuning import TRAINING
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter, SilentReporter
from silhouette_core.read_ahead import side_by_side

Arrays = Mapping[str, NDArray]
_BETWEEN_S = 10  # between takes: no instant that is read lies in another take
_BASIS_GRIDS = 4000
_AT_ONCE = 24  # takes that are filmed side by side
_GRIDS = "coverage", "feet", "skin", "shading"
_CODES = "outline", "feet", "inside", "joints"
_LEAST_STEPS = 200


def learn_proposal(
    motions: Sequence[Motion],
    model: BodyModel,
    settings: LearningSettings | None = None,
    reporter: Reporter | None = None,
    step: Callable[[str, Callable[[], Arrays]], Arrays] | None = None,
    begun: PoseProposal | None = None,
) -> PoseProposal:
    """Proposal that has learned to tell recorded motion from its silhouettes. Raises InputError
    where there is too little motion.

    Args:
        motions: recorded motion, of the body.
        model: the body of the library; random bodies around it are filmed.
        step: keeps the arrays of a named step, made by a function, and gives them again after an
            interruption, such as `Checkpoint.step`; None: nothing is kept.
        begun: what has learned of other motion goes on learning, but for its encoders; None: all is
            learned from the motion.

    Returns:
        The proposal; the same inputs give the same one, for any number of threads.
    """
    settings, reporter = settings or LearningSettings(), reporter or SilentReporter()
    step = step or (lambda _, make: make())
    streams = np.random.SeedSequence(settings.seed).spawn(5)
    plan, film, fit, encode, train = (np.random.default_rng(stream) for stream in streams)
    recorded = sum(round(len(motion) * min(1.0, 30 / motion.fps)) for motion in motions)
    stretches = plan_takes(motions, min(settings.frames, settings.takes * recorded), plan)
    if not stretches:
        raise InputError("a library is learned from motion of at least half a second: give more")
    # How BLAS and LAPACK round depends on their number of threads, on some processors even of short
    # products.
    with threadpool_limits(1, user_api="blas"):
        studio = _Studio(stretches, VirtualBodies(model), settings, film.spawn(len(stretches)))
        ends = np.cumsum([len(stretch) for stretch in stretches])
        first = 0
        if begun is None:
            first = int(np.searchsorted(ends, min(settings.pictures, ends[-1]))) + 1
        groups = studio.film("filming the first takes", range(first), reporter)
        takes = [take for group in groups for take in group]
        encoding = (
            SilhouetteEncoding.from_arrays(
                step(
                    "encoding",
                    lambda: _trained_encoding(takes, settings, (fit, encode), reporter).arrays(),
                )
            )
            if begun is None
            else begun.encoding
        )
        codes = side_by_side(partial(_codes, encoding), takes)
        takes = [_without_grids(take) for take in takes]
        others = range(first, len(stretches))
        for group in studio.film("filming the other takes", others, reporter):
            codes += side_by_side(partial(_codes, encoding), group)
            takes += [_without_grids(take) for take in group]
        features = _joined(takes, codes)
        network = _trained(features, takes, settings, train, reporter, begun and begun.network)
    return PoseProposal(encoding, network)


@dataclass(frozen=True, eq=False)
class _Studio:
    """Films stretches of motion, each with random numbers of its own."""

    stretches: Sequence[Motion]
    bodies: VirtualBodies
    settings: LearningSettings
    streams: Sequence[np.random.Generator]

    def film(self, name: str, numbers: range, reporter: Reporter) -> Iterator[list[VirtualTake]]:
        """Takes of stretches and, if wanted, their mirror images, a few at a time."""
        if not numbers:
            return
        reporter.stage(name, sum(len(self.stretches[number]) for number in numbers))
        for start in range(0, len(numbers), _AT_ONCE):
            takes = side_by_side(self._take, numbers[start : start + _AT_ONCE])
            count = sum(map(len, takes))
            if self.settings.mirror:
                takes = [either for take in takes for either in (take, mirror_image(take))]
            yield takes
            reporter.advance(count)

    def _take(self, number: int) -> VirtualTake:
        motion, rng = self.stretches[number], self.streams[number]
        if self.settings.all_varied or number % 2 == 0:
            motion = vary_motion(motion, self.stretches, rng)
        return film_take(motion, self.bodies, rng)


class FramePool:
    """Frames of several takes, one after the other; nothing is copied before it is asked for."""

    def __init__(self, takes: Sequence[VirtualTake]) -> None:
        self._takes = takes
        self._ends = np.cumsum([len(take) for take in takes])

    def __len__(self) -> int:
        """Number of frames."""
        return int(self._ends[-1])

    def gathered(self, frames: IndexArray, name: str) -> NDArray:
        """An attribute (n, ...) of the takes in frames (n,)."""
        numbers = np.searchsorted(self._ends, frames, side="right")
        return np.stack(
            [
                getattr(self._takes[number], name)[frame - self._ends[number]]
                for number, frame in zip(numbers, frames, strict=True)
            ]
        )


def _codes(encoding: SilhouetteEncoding, take: VirtualTake) -> SilhouetteCodes:
    """Codes of a take, float16: half the memory, and rounded less than the noise in training."""
    codes = encoding.with_inside(
        encoding.codes(take.coverage, take.feet), InsideGrids(take.skin, take.shading)
    )
    codes = replace(codes, joints=take.seen)
    shorter = {name: getattr(codes, name).astype(np.float16) for name in _CODES}
    return replace(codes, **shorter)


def _without_grids(take: VirtualTake) -> VirtualTake:
    """A take without its grids, which would fill the memory."""
    return replace(take, **{name: getattr(take, name)[:0].copy() for name in _GRIDS})


def _joined(takes: Sequence[VirtualTake], codes: Sequence[SilhouetteCodes]) -> FrameFeatures:
    """Features of the frames of all takes, which are 10 s apart."""
    starts = np.cumsum([0.0, *(take.time_s[-1] - take.time_s[0] + _BETWEEN_S for take in takes)])
    return FrameFeatures(
        SilhouetteCodes.joined(codes),
        np.concatenate([take.pitch_rad for take in takes]),
        np.concatenate([take.heading_rad for take in takes]),
        np.concatenate([take.anchor for take in takes]),
        np.concatenate(
            [
                take.time_s - take.time_s[0] + start
                for take, start in zip(takes, starts[:-1], strict=True)
            ]
        ),
    )


def _trained_encoding(
    takes: Sequence[VirtualTake],
    settings: LearningSettings,
    streams: tuple[np.random.Generator, np.random.Generator],
    reporter: Reporter,
) -> SilhouetteEncoding:
    """Basis and encoders, learned from takes, each with random numbers of its own."""
    fit, encode = streams
    pool = FramePool(takes)
    chosen = fit.permutation(len(pool))[:_BASIS_GRIDS]
    feet = fit_basis(pool.gathered(chosen, "feet"), FEET_COMPONENTS)

    def draw(rng: np.random.Generator, samples: int) -> PictureBatch:
        frames = rng.integers(0, len(pool), samples)
        others = (
            feet.encode(pool.gathered(frames, "feet")),
            2 * pool.gathered(frames, "pitch_rad")[:, None],
            pool.gathered(frames, "anchor")[:, 2:],
        )
        return PictureBatch(
            outline_images(pool.gathered(frames, "coverage")),
            inside_images(pool.gathered(frames, "skin"), pool.gathered(frames, "shading")),
            coloured=rng.random(samples) >= TRAINING.withheld,
            samples=TrainingBatch(
                np.concatenate(others, axis=1, dtype=np.float32),
                pool.gathered(frames, "joints"),
                pool.gathered(frames, "offset"),
            ),
        )

    training = _shortened(settings.encoding, settings.passes * len(pool))
    reporter.stage("learning the encoders", training.steps)
    return train_encoders(draw, feet, training, encode, reporter)


def _shortened(training: TrainingSettings, samples: float) -> TrainingSettings:
    """Settings for a number of samples, if that takes fewer steps."""
    steps = max(round(samples / training.batch), _LEAST_STEPS)
    return replace(training, steps=min(training.steps, steps))


def _trained(
    features: FrameFeatures,
    takes: Sequence[VirtualTake],
    settings: LearningSettings,
    rng: np.random.Generator,
    reporter: Reporter,
    begun: MixtureNetwork | None,
) -> MixtureNetwork:
    """Network trained on frames, from the beginning or further."""
    count = len(features)
    training = _shortened(settings.training, settings.passes * count)
    nearby = nearby_frames(features.time_s)
    joints, offset = (
        np.concatenate([getattr(take, name) for take in takes]) for name in ("joints", "offset")
    )

    def draw(rng: np.random.Generator, samples: int) -> TrainingBatch:
        frames = rng.integers(0, count, samples)
        causal = rng.random(samples) < TRAINING.withheld
        coloured, jointed = (rng.random(samples) >= TRAINING.withheld for _ in range(2))
        return TrainingBatch(
            network_inputs(features, frames, nearby[frames], causal, coloured, jointed),
            joints[frames],
            offset[frames],
        )

    network = begun or MixtureNetwork.initial(
        draw(np.random.default_rng(0), 1).inputs.shape[1],
        training.units,
        training.blocks,
        training.modes,
        joints.mean(axis=0),
        rng,
    )
    reporter.stage("learning the proposal", training.steps)
    return train_network(network, draw, training, rng, reporter, further=begun is not None)
