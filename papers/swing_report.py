"""Table and plot of the arm-swing experiment."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from papers.arm_swing import Row, Truth
from papers.swings import VERDICTS

_TRUE, _ESTIMATED, _WRONG = "#30343b", "#2f86d6", "#d53e14"
_SHOWN_SWINGS = 6


def swing_table(rows: Sequence[Row]) -> str:
    """Rows as a Markdown table, with the paper's counts where the paper has that row."""
    lines = [
        "| silhouettes | method | Fail | Error | Success | paper: Fail / Error / Success |"
        " mean error of the angle, deg |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        paper = " / ".join(map(str, row.paper)) if row.paper else "–"
        counts = " | ".join(str(row.counts[verdict]) for verdict in VERDICTS)
        lines.append(
            f"| {row.degradation} | {row.method} | {counts} | {paper} | {row.error_deg:.1f} |"
        )
    return "\n".join(lines) + "\n"


def draw_angles(rows: Sequence[Row], truth: Truth, fps: float, path: Path) -> None:
    """Plots the true and the estimated angle over the first few swings, a panel per row.

    Args:
        rows: results.
        truth: the true angle and the swings.
        fps: frames per second.
        path: the PNG.
    """
    swings, truth_deg = truth.swings[:_SHOWN_SWINGS], truth.angles_deg
    shown = slice(swings[0].start, swings[-1].stop)
    time_s = np.arange(len(truth_deg))[shown] / fps
    figure = Figure(figsize=(9, 1.7 * len(rows) + 0.6), layout="constrained", dpi=110)
    panels = figure.subplots(len(rows), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, row in zip(panels, rows, strict=True):
        counts = ", ".join(f"{row.counts[verdict]} {verdict}" for verdict in VERDICTS)
        true, estimated = truth_deg[shown], row.angles_deg[shown]
        dots = {"marker": ".", "ms": 3, "label": "estimated"}
        panel.plot(time_s, true, color=_TRUE, lw=1.4, label="true")
        panel.plot(time_s, estimated, color=_ESTIMATED, lw=1.2, **dots)
        panel.fill_between(time_s, true, estimated, color=_WRONG, alpha=0.15, lw=0)
        panel.set_title(f"{row.method}, {row.degradation}: {counts}", loc="left", fontsize=9)
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(alpha=0.15)
    panels[0].legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, ncols=2, frameon=False
    )
    panels[-1].set_xlabel("seconds")
    figure.supylabel("right upper arm, degrees forward", fontsize=9)
    figure.savefig(path)
