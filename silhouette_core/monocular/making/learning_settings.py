"""Settings of the training of networks, and of what the proposal learns from."""

from dataclasses import dataclass, field


@dataclass(frozen=True)
class TrainingSettings:
    """Settings of a training."""

    steps: int = 16_000  #: number of steps.
    batch: int = 320  #: samples of a step, a multiple of 4.
    rate: float = 2e-3  #: largest learning rate; it falls as a half cosine.
    kept_rate: float = 0.25  #: that of what has learned before, relative to it.
    units: int = 768  #: units of the hidden layers.
    blocks: int = 2  #: residual blocks.
    modes: int = 8  #: modes of the mixture.
    noise: float = 0.03  #: deviation of the noise on the inputs.
    decay: float = 3e-3  #: decay of the weights per unit of rate.


@dataclass(frozen=True)
class LearningSettings:
    """Settings of the proposal."""

    frames: int = 800_000  #: largest number of virtual frames.
    takes: int = 60  #: largest number of virtual takes of each recorded frame.
    mirror: bool = True  #: whether the mirror image of each frame is learned from as well.
    all_varied: bool = False  #: Whether the motion of all takes is varied, not every other's.
    pictures: int = 150_000  #: number of virtual frames from which the encoders learn.
    passes: float = 5.0
    """How often each virtual frame and mirror image is learned from, if that takes fewer steps than
    `encoding` and `training` allow."""
    encoding: TrainingSettings = field(
        default_factory=lambda: TrainingSettings(steps=5_000, batch=256, units=512)
    )
    """Settings of the training of the encoders, and of the network that goes with it."""
    training: TrainingSettings = field(default_factory=TrainingSettings)
    """Settings of the training of the network."""
    seed: int = 0  #: seed of everything random.

    @classmethod
    def of_begun(cls) -> "LearningSettings":
        """For a proposal that has learned of other motion and goes on: an eighth of the frames, a
        sixth of the steps, and a quarter of the rate of what is new.
        """
        return cls(frames=100_000, training=TrainingSettings(steps=2_500))
