"""What the report says of somebody who walks: values, events, and angles over the stride."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from silhouette_core.motion.anatomical import AnatomicalAngles
from silhouette_core.motion.gait_values import SIDES, Gait, Side, Spread, Stride, normalised_cycles
from voxelpose.report.charts import LEFT, RIGHT, CycleChart, CycleCurve, cycle_chart

_COLOURS: dict[Side, str] = {"left": LEFT, "right": RIGHT}
# Strides of a side from which a mean and a standard deviation are drawn.
_LEAST_STRIDES = 2


@dataclass(frozen=True)
class GaitSection:
    """Contents of the section."""

    values: tuple[tuple[str, str], ...]  # of both feet: value and name
    rows: tuple[tuple[str, ...], ...]  # name, left and right
    events: tuple[tuple[str, str, str], ...]  # side, times of contacts and of offs, s
    counts: dict[Side, int]  # strides by side
    charts: tuple[tuple[str, str], ...]  # svg elements and notes


def gait_section(
    gait: Gait,
    angles: AnatomicalAngles,
    time_s: NDArray[np.float64],
    titles: Sequence[tuple[str, str, str]],
    prefix: str,
) -> GaitSection:
    """Section about a gait.

    Args:
        angles: of a motion of T poses.
        time_s: (T,) of these, s.
        titles: title, note and name of each angle, with {} for both sides.
        prefix: begins the charts' names in the page.
    """
    rows = [
        ("Stride time, s", gait.stride_time_s, 1, 2),
        ("Stride length, m", gait.stride_length_m, 1, 2),
        ("Step length, m", gait.step_length_m, 1, 2),
        ("Stance, %", gait.stance, 100, 0),
        ("Double support, %", gait.double_support, 100, 0),
    ]
    values = [
        (f"{gait.cadence_per_min:.0f} steps/min", "cadence"),
        (f"{gait.speed_m_s:.2f} m/s", "speed"),
    ]
    if (width := gait.step_width_m()) is not None:
        values.append((f"{_spread_words(width, 1, 2)} m", f"step width (n = {width.count})"))
    events = [(side, _times(gait.contacts_s[side]), _times(gait.offs_s[side])) for side in SIDES]
    strides = {side: gait.strides_of(side) for side in SIDES}
    enough: list[Side] = [side for side in SIDES if len(strides[side]) >= _LEAST_STRIDES]
    charts = []
    for k, (title, note, name) in enumerate(titles if enough else ()):
        curves = {
            side: _curve(side, angles[name.format(side)], time_s, strides[side]) for side in enough
        }
        chart = CycleChart(title, "degrees", curves)
        charts.append((cycle_chart(chart, f"{prefix}cycle{k}"), note))
    return GaitSection(
        tuple(values),
        tuple(
            (name, *(_words(spread(side), scale, digits) for side in SIDES))
            for name, spread, scale, digits in rows
        ),
        tuple(events),
        {side: len(strides[side]) for side in SIDES},
        tuple(charts),
    )


def _curve(
    side: Side,
    values_deg: NDArray[np.float64],
    time_s: NDArray[np.float64],
    strides: Sequence[Stride],
) -> CycleCurve:
    cycles = normalised_cycles(values_deg, time_s, strides)
    off = 100 * float(np.mean([stride.stance for stride in strides]))
    return CycleCurve(cycles.mean(axis=0), cycles.std(axis=0, ddof=1), off, _COLOURS[side])


def _words(spread: Spread | None, scale: int, digits: int) -> str:
    if spread is None:
        return "–"
    return f"{_spread_words(spread, scale, digits)} (n = {spread.count})"


def _spread_words(spread: Spread, scale: int, digits: int) -> str:
    """Mean ± standard deviation, this where there is one."""
    text = f"{scale * spread.mean:.{digits}f}"
    return text + ("" if spread.deviation is None else f" ± {scale * spread.deviation:.{digits}f}")


def _times(times_s: Sequence[float]) -> str:
    return ", ".join(f"{time:.2f}" for time in times_s) or "–"
