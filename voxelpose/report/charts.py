"""Charts as self-contained SVG elements, whose text and colours follow the page."""

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

# RGB, vermilion over yellow to blue: no kind of colour vision confuses the ends.
_RAMP = np.array([[213, 62, 20], [244, 190, 60], [64, 132, 214]])
_UNKNOWN = (150, 150, 150)
# Placeholder for the page's own text colour.
_INK = "#123456"
# Curves of the right side are dashed, too: not everybody sees the colours, nor does every printer.
LEFT, RIGHT, MIDDLE, BAD = "#2f86d6", "#e8701a", "#8a8f98", "#d53e14"
_STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.size": 9,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "text.color": _INK,
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "grid.color": _INK,
}


@dataclass(frozen=True, eq=False)
class TimeChart:
    """Curves over time."""

    title: str  # above the chart
    unit: str
    # Label -> (values (T,), colour).
    curves: Mapping[str, tuple[NDArray[np.floating], str]] = field(default_factory=dict)
    limits: tuple[float, float] | None = None  # of the axis; None: from the values
    below: float | None = None  # values below this are shaded as doubtful; None: none are


@dataclass(frozen=True, eq=False)
class CycleCurve:
    """An angle over the strides of a side."""

    mean: NDArray[np.float64]  # (N,) at 0 to 100 % of the stride
    deviation: NDArray[np.float64]  # (N,) standard deviation between strides
    off: float  # mean share of the stride at which the foot leaves the ground, %
    colour: str


@dataclass(frozen=True, eq=False)
class CycleChart:
    """Curves over the stride, with a band of a standard deviation on either side."""

    title: str  # above the chart
    unit: str
    curves: Mapping[str, CycleCurve]  # by label


def cycle_chart(chart: CycleChart, name: str) -> str:
    """Chart, an svg element, of curves over the stride; arguments as of `time_chart`."""
    with matplotlib.rc_context(_curve_style(name)):
        figure = Figure(figsize=(3.7, 2.1), layout="constrained")
        axes = figure.add_subplot()
        for label, curve in chart.curves.items():
            share = np.linspace(0, 100, len(curve.mean))
            low, high = curve.mean - curve.deviation, curve.mean + curve.deviation
            axes.fill_between(share, low, high, color=curve.colour, alpha=0.22, lw=0)
            axes.plot(share, curve.mean, color=curve.colour, label=label, ls=_dashes(curve.colour))
            axes.axvline(curve.off, color=curve.colour, lw=1, ls=(0, (1, 2)))
        axes.set_title(chart.title, fontsize=10, loc="left")
        axes.set_ylabel(chart.unit)
        axes.set_xlim(0, 100)
        axes.set_xlabel("% of the stride", labelpad=1)
        ranges = ", ".join(
            f"{label} mean from {curve.mean.min():.3g} to {curve.mean.max():.3g} {chart.unit}"
            for label, curve in chart.curves.items()
        )
        return _element(figure, name, f"{chart.title} over the stride: {ranges}")


def time_chart(chart: TimeChart, time_s: NDArray[np.float64], name: str) -> str:
    """Chart, an svg element, of curves over time.

    Args:
        time_s: (T,) seconds; gaps interrupt the curves.
        name: unique in the page.
    """
    with matplotlib.rc_context(_curve_style(name)):
        figure = Figure(figsize=(3.7, 2.1), layout="constrained")
        axes = figure.add_subplot()
        times, gaps = _with_gaps(time_s)
        for label, (values, colour) in chart.curves.items():
            drawn = np.insert(np.asarray(values, float), gaps, np.nan)
            axes.plot(times, drawn, color=colour, label=label, ls=_dashes(colour))
        axes.set_title(chart.title, fontsize=10, loc="left")
        axes.set_ylabel(chart.unit)
        if chart.limits:
            axes.set_ylim(*chart.limits)
        if chart.below is not None:
            axes.axhspan(axes.get_ylim()[0], chart.below, color=BAD, alpha=0.12, lw=0)
        _time_axis(axes, time_s)
        ranges = ", ".join(
            f"{label or chart.title} from {np.nanmin(values):.3g} to {np.nanmax(values):.3g}"
            f" {chart.unit}"
            for label, (values, _) in chart.curves.items()
            if np.isfinite(values).any()
        )
        return _svg(figure, axes, time_s, name, f"{chart.title} over time: {ranges}")


def part_chart(
    overlap: NDArray[np.float64], labels: Sequence[str], time_s: NDArray[np.float64], name: str
) -> str:
    """Chart, an svg element, of every part's fraction (T, P) inside the hull in the colours of the
    viewer, a row per part with its label, over time (T,), s; `name` is unique in the page.
    """
    with matplotlib.rc_context({**_STYLE, "svg.hashsalt": name}):
        # Narrow enough to be read on a phone's screen.
        figure = Figure(figsize=(4.4, 0.17 * len(labels) + 0.7), layout="constrained")
        axes = figure.add_subplot()
        half = 0.5 * (time_s[-1] - time_s[0]) / max(len(time_s) - 1, 1)
        columns = np.searchsorted(time_s, np.linspace(time_s[0], time_s[-1], min(len(time_s), 600)))
        shares = overlap[np.minimum(columns, len(time_s) - 1)].T
        colours = overlap_colours(shares.ravel()).reshape(*shares.shape, 3)
        extent = (time_s[0] - half, time_s[-1] + half + 1e-6, len(labels) - 0.5, -0.5)
        axes.imshow(colours, aspect="auto", interpolation="none", extent=extent)
        axes.set_yticks(range(len(labels)), labels, fontsize=8.5)
        _time_axis(axes, time_s)
        words = "share of every body part inside the carved hull over time; a table follows"
        return _svg(figure, axes, time_s, name, words)


def overlap_colours(overlap: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Colours (n, 3) uint8 RGB of fractions (n,) of parts inside the hull; grey where NaN."""
    position = np.clip(np.nan_to_num(overlap), 0, 1) * (len(_RAMP) - 1)
    low = np.minimum(position.astype(int), len(_RAMP) - 2)
    mixed = _RAMP[low] + (position - low)[:, None] * (_RAMP[low + 1] - _RAMP[low])
    return np.where(np.isfinite(overlap)[:, None], mixed, _UNKNOWN).round().astype(np.uint8)


def _curve_style(name: str) -> dict[Any, Any]:
    style = {"axes.grid": True, "grid.alpha": 0.15, "lines.linewidth": 1.6, "svg.hashsalt": name}
    return {**_STYLE, **style}


def _dashes(colour: str) -> tuple[int, tuple[int, ...]]:
    return (0, (4, 1)) if colour == RIGHT else (0, ())


def _time_axis(axes: Axes, time_s: NDArray[np.float64]) -> None:
    axes.set_xlim(time_s[0], max(time_s[-1], time_s[0] + 1e-3))
    axes.set_xlabel("seconds", labelpad=1)
    axes.axvline(time_s[0], color=_INK, lw=1.2, alpha=0.7, gid="cursor")


def _with_gaps(time_s: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Times with one more in every gap, and the positions of those."""
    steps = np.diff(time_s)
    # A frame without a pose breaks a line.
    gaps = np.flatnonzero(steps > 1.5 * np.median(steps)) + 1 if len(steps) else steps.astype(int)
    return np.insert(time_s, gaps, time_s[gaps - 1]), gaps


def _svg(figure: Figure, axes: Axes, time_s: NDArray[np.float64], name: str, words: str) -> str:
    """Svg element of a chart over time, with the range of the cursor, for the page's player."""
    text = _element(figure, name, words)
    width = axes.get_window_extent().width * 72 / figure.dpi
    span = f'data-from="{time_s[0]:.4f}" data-to="{time_s[-1]:.4f}" data-width="{width:.2f}"'
    return text.replace("<svg ", f"<svg {span} ", 1)


def _element(figure: Figure, name: str, words: str) -> str:
    buffer = io.StringIO()
    metadata = dict.fromkeys(("Date", "Creator", "Format", "Type"))
    figure.savefig(buffer, format="svg", transparent=True, metadata=metadata)
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = re.sub(r' xmlns(:\w+)?="[^"]*"', "", text).replace("xlink:href", "href")
    text = text.replace(_INK, "currentColor").replace('id="cursor"', 'class="cursor"')
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)
    tag = f'<svg role="img" aria-label="{escape(words)}" '
    return text.replace("<svg ", tag, 1).replace("\n", " ")
