"""Tables of a batch: table.csv, table.md, and index.html with pictures and links."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from calib.storage.atomic import write_whole
from voxelpose.batch.run import Outcome
from voxelpose.evaluation import markdown_rows
from voxelpose.reliability import LEVELS
from voxelpose.report.page import REPORT, render_page, sheet_image
from voxelpose.report.preview import data_uri
from voxelpose.version import __version__

_SCORES = ("root_mm", "mpjpe_mm", "pa_mm", "joint_angle_deg", "flips", "lost")


def write_tables(outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """Writes the three tables, of several people with a row for each; returns their paths.
    InputError where one cannot be written.
    """
    rows = sorted(outcomes, key=lambda row: (LEVELS.index(row.verdict.level), row.job.name))
    cells = [_lines(outcome) for outcome in rows]
    lines = [line for cell in cells for line in cell]
    columns = [name for name in lines[0] if any(line[name] for line in lines)]
    contents = {
        "table.csv": _csv(lines, columns),
        "table.md": markdown_rows([columns, *([line[name] for name in columns] for line in lines)]),
        "index.html": _page(rows, cells, folder),
    }
    for name, text in contents.items():
        write_whole(folder / name, text)
    return [folder / name for name in contents]


def _lines(outcome: Outcome) -> list[dict[str, str]]:
    """Rows of a recording: one, or one of each of several people."""
    if not outcome.people:
        return [_line(outcome, outcome.job.name)]
    return [_line(one, f"{one.job.name}/{name}") for name, one in outcome.people.items()]


def _line(outcome: Outcome, name: str) -> dict[str, str]:
    verdict, frames = outcome.verdict, outcome.summary.get("frames", {})
    posed, lost = frames.get("with_pose"), frames.get("lost", ())
    stature_m = outcome.summary.get("body", {}).get("stature_m")
    scores = {name: _number(outcome.score.get(name)) for name in _SCORES}
    return {
        "recording": name,
        "verdict": verdict.level,
        "reason": verdict.reason,
        "frames": "" if posed is None else f"{posed} of {posed + len(lost)}",
        "stature_m": "" if stature_m is None else f"{stature_m:.3f}",  # not of other bodies
        "seconds": f"{outcome.seconds:.1f}",
        **scores,
    }


def _number(value: float | None) -> str:
    """A measure in a cell; empty where it is not known, or not one of this body's."""
    return "" if value is None or not np.isfinite(value) else f"{value:.3g}"


def _csv(lines: Sequence[dict[str, str]], columns: Sequence[str]) -> str:
    file = io.StringIO()
    writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return file.getvalue()


def _page(rows: Sequence[Outcome], cells: Sequence[list[dict[str, str]]], folder: Path) -> str:
    cards = []
    for outcome, lines in zip(rows, cells, strict=True):
        name, sheet = outcome.job.name, sheet_image(folder / outcome.job.name)
        files = (f"{name}/{file}" for file in (REPORT, "contact_sheet.png", "summary.json"))
        cards.append(
            {
                "verdict": outcome.verdict,
                "name": name,
                "lines": lines,
                "picture": "" if sheet is None else data_uri(sheet, 480, ".webp", 70),
                "link": next((file for file in files if (folder / file).exists()), ""),
            }
        )
    contents = {
        "cards": cards,
        "counts": Counter(outcome.verdict.level for outcome in rows),
        "title": folder.resolve().name,
        "version": __version__,
    }
    return render_page("voxelpose.batch", "index.html", contents)
