"""Table and pictures of the arm-swing experiment."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from papers.arm_swing import Row, sample_angles, sample_costs, window_of
from papers.swing_film import SwingFilm
from papers.swings import VERDICTS, split_swings
from silhouette_core.monocular.tree.pose_library import PoseLibrary
from silhouette_core.monocular.tree.rendering import SIZES_PX

if TYPE_CHECKING:
    from papers.swing_study import Side

_TRUE, _ESTIMATED, _WRONG = "#30343b", "#2f86d6", "#d53e14"
_COLOURS = (_WRONG, _ESTIMATED)
_SHOWN_SWINGS = 6
_BIN_DEG = 6.0


def swing_table(sides: Sequence["Side"]) -> str:
    """Rows as a Markdown table, all films of a side together, with the paper's counts of 24."""
    lines = [
        "| arm | (4) | method | σ | Fail | Error | Success | paper, of 24 | mean error, deg:"
        " all films, least, most |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for side in sides:
        for rows in side.rows:
            case, paper = rows[0].case, " / ".join(map(str, rows[0].case.method.paper))
            counts = " | ".join(str(sum(row.counts[one] for row in rows)) for one in VERDICTS)
            errors = [row.error_deg for row in rows]
            lines.append(
                f"| {'near' if side.near else 'far'} | {case.model} | {case.method} |"
                f" {case.sigma:g} | {counts} | {paper} |"
                f" {np.mean(errors):.1f}, {min(errors):.1f}, {max(errors):.1f} |"
            )
    return "\n".join(lines) + "\n"


def draw_angles(rows: Sequence[Row], film: SwingFilm, fps: float, path: Path) -> None:
    """Plots the true and the estimated angle over the first few swings, a panel per row.

    Args:
        rows: results on the film.
        film: with its truth.
        fps: frames per second.
        path: the PNG.
    """
    swings, truth_deg = split_swings(film.truth_deg)[:_SHOWN_SWINGS], film.truth_deg
    shown = slice(swings[0].start, swings[-1].stop)
    time_s = np.arange(len(truth_deg))[shown] / fps
    figure = Figure(figsize=(9, 1.5 * len(rows) + 0.6), layout="constrained", dpi=110)
    panels = figure.subplots(len(rows), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for panel, row in zip(panels, rows, strict=True):
        counts = ", ".join(f"{row.counts[verdict]} {verdict}" for verdict in VERDICTS)
        true, estimated = truth_deg[shown], row.angles_deg[shown]
        dots = {"marker": ".", "ms": 3, "label": "estimated"}
        panel.plot(time_s, true, color=_TRUE, lw=1.4, label="true")
        panel.plot(time_s, estimated, color=_ESTIMATED, lw=1.2, **dots)
        panel.fill_between(time_s, true, estimated, color=_WRONG, alpha=0.15, lw=0)
        panel.set_title(f"{row.case}: {counts}", loc="left", fontsize=9)
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(alpha=0.15)
    panels[0].legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), fontsize=8, ncols=2, frameon=False
    )
    panels[-1].set_xlabel("seconds")
    figure.supylabel("right upper arm, degrees forward", fontsize=9)
    figure.savefig(path)


def draw_costs(
    films: Mapping[str, SwingFilm], libraries: Mapping[str, PoseLibrary], path: Path
) -> None:
    """Plots the silhouette distance over the arm's angle, relative to that of the true angle: a
    column per film, of which the first frame counts, and a row per level, coarsest and finest.

    Args:
        films: by a description.
        libraries: by the weighting of their trees.
        path: the PNG.
    """
    figure = Figure(figsize=(3.4 * len(films), 5.4), layout="constrained", dpi=110)
    panels = figure.subplots(2, len(films), sharex=True, sharey="row", squeeze=False)
    for (name, film), column in zip(films.items(), panels.T, strict=True):
        for level, panel in zip((0, -1), column, strict=True):
            for (weighting, library), colour in zip(libraries.items(), _COLOURS, strict=True):
                line = {"color": colour, "marker": ".", "ms": 3, "lw": 1.2}
                curve = cost_curve(film, library, level)
                panel.plot(*curve, **line, label=weighting.replace("xor", "XOR"))
            panel.axvline(film.truth_deg[0], color=_TRUE, lw=1.0, ls=":")
            size = "{} x {}".format(*SIZES_PX[level])
            panel.set_title(f"{name}, {size}", loc="left", fontsize=9)
            panel.spines[["top", "right"]].set_visible(False)
            panel.grid(alpha=0.15)
    panels[0, 0].legend(fontsize=8, frameon=False)
    figure.supxlabel("right upper arm of the pose, degrees forward (dotted: true)", fontsize=9)
    figure.supylabel("distance over that of the true angle", fontsize=9)
    figure.savefig(path)


def cost_curve(
    film: SwingFilm, library: PoseLibrary, level: int = -1
) -> tuple[np.ndarray, np.ndarray]:
    """Least distance of a film's first silhouette from poses by the angle of the right upper arm,
    over that of the true angle: angles (K,), degrees, and ratios (K,).
    """
    angles = sample_angles(library)
    costs = sample_costs(window_of(film, 0, library), library, level)
    away = np.rint((angles - film.truth_deg[0]) / _BIN_DEG).astype(int)
    bins = np.unique(away)
    least = np.array([costs[away == one].min() for one in bins])
    return film.truth_deg[0] + _BIN_DEG * bins, least / least[bins == 0]
