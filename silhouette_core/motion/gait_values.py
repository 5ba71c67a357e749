"""Spatio-temporal values of walking, and curves over its strides.

Source: Perry and Burnfield, "Gait analysis: normal and pathological function" (2010); lengths and
widths as of Huxham et al., "Defining spatial parameters for non-linear walking" (Gait and Posture
2006).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from calib.checks import FloatArray, RealArray

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
CYCLE = 101  #: Number of moments of a normalised stride, 0 to 100 %.


@dataclass(frozen=True)
class Stride:
    """From a foot's contact to its next one; the foot's off is between them."""

    side: Side
    contact_s: float
    off_s: float
    end_s: float
    length_m: float
    both_s: float  #: how long both feet are on the ground, seconds.

    @property
    def time_s(self) -> float:
        """Stride time, seconds."""
        return self.end_s - self.contact_s

    @property
    def stance(self) -> float:
        """Share of the stride in which the foot is on the ground, 0 to 1."""
        return (self.off_s - self.contact_s) / self.time_s

    @property
    def double_support(self) -> float:
        """Share of the stride in which both feet are on the ground, 0 to 1."""
        return self.both_s / self.time_s


@dataclass(frozen=True)
class Step:
    """From the other foot's contact to this one's."""

    side: Side  #: of the foot that lands.
    length_m: float  #: how far it lands ahead of the other one, along the stride.
    width_m: float | None
    """How far to its own side of the other foot's stride, negative where feet cross; None where the
    other foot's next contact was not recorded."""


@dataclass(frozen=True)
class Spread:
    """Mean and sample standard deviation of `count` values; None with fewer than two."""

    mean: float
    deviation: float | None
    count: int

    @classmethod
    def from_values(cls, values: Sequence[float]) -> "Spread | None":
        """Spread of some values; None where there are none."""
        if not values:
            return None
        deviation = float(np.std(values, ddof=1)) if len(values) > 1 else None
        return cls(float(np.mean(values)), deviation, len(values))


@dataclass(frozen=True)
class Gait:
    """Walking over the ground: all its bouts."""

    contacts_s: Mapping[Side, tuple[float, ...]]  #: times of the contacts by side, seconds.
    offs_s: Mapping[Side, tuple[float, ...]]  #: times of the offs by side, seconds.
    strides: tuple[Stride, ...]  #: in their order.
    steps: tuple[Step, ...]  #: in their order.
    cadence_per_min: float  #: steps a minute.
    speed_m_s: float  #: of the pelvis along its way.

    def strides_of(self, side: Side) -> tuple[Stride, ...]:
        """The strides of a side."""
        return tuple(stride for stride in self.strides if stride.side == side)

    def stride_time_s(self, side: Side) -> Spread | None:
        """Stride time, seconds."""
        return Spread.from_values([stride.time_s for stride in self.strides_of(side)])

    def stride_length_m(self, side: Side) -> Spread | None:
        """Stride length, metres."""
        return Spread.from_values([stride.length_m for stride in self.strides_of(side)])

    def stance(self, side: Side) -> Spread | None:
        """Share of the stride in stance, 0 to 1."""
        return Spread.from_values([stride.stance for stride in self.strides_of(side)])

    def double_support(self, side: Side) -> Spread | None:
        """Share of the stride in double support, 0 to 1."""
        return Spread.from_values([stride.double_support for stride in self.strides_of(side)])

    def step_length_m(self, side: Side) -> Spread | None:
        """Step length, metres, of steps that end with the contact of a side."""
        return Spread.from_values([step.length_m for step in self.steps if step.side == side])

    def step_width_m(self) -> Spread | None:
        """Step width, metres, of both sides."""
        return Spread.from_values([one.width_m for one in self.steps if one.width_m is not None])


def normalised_cycles(
    values: RealArray, time_s: FloatArray, strides: Sequence[Stride]
) -> FloatArray:
    """Values (n, 101) at 0 to 100 % of n strides, of values (T,) at times (T,), s."""
    share = np.linspace(0, 1, CYCLE)
    times = [one.contact_s + share * one.time_s for one in strides]
    return np.array([np.interp(moments, time_s, values) for moments in times]).reshape(-1, CYCLE)
