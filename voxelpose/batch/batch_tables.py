"""Tables of a batch: table.csv, table.md, and index.html with pictures and links."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import cv2
import jinja2
import numpy as np

from calib.atomic import replacing
from calib.errors import InputError
from voxelpose.batch.run import Outcome
from voxelpose.recording.frame_reader import read_still
from voxelpose.reliability import Verdict, verdict_of
from voxelpose.report.page import REPORT
from voxelpose.report.preview import data_uri
from voxelpose.version import __version__

INDEX, TABLE = "index.html", "table"
_THUMBNAIL_PX = 480
_SCORES = ("root_mm", "mpjpe_mm", "pa_mm", "joint_angle_deg", "flips", "lost")


def write_tables(outcomes: Sequence[Outcome], folder: Path) -> list[Path]:
    """Writes the three tables.

    Args:
        outcomes: of all jobs.
        folder: the batch's folder.

    Returns:
        Their paths.

    Raises:
        InputError: a file cannot be written.
    """
    order = ("failed", "doubtful", "reliable")
    rows = sorted(
        ((outcome, _verdict(outcome)) for outcome in outcomes),
        key=lambda row: (order.index(row[1].level), row[0].job.name),
    )
    lines = [_line(outcome, verdict) for outcome, verdict in rows]
    columns = [name for name in lines[0] if any(line[name] for line in lines)]
    contents = {
        f"{TABLE}.csv": _csv(lines, columns),
        f"{TABLE}.md": _markdown(lines, columns),
        INDEX: _page(rows, folder),
    }
    for name, text in contents.items():
        with replacing(folder / name) as partial:
            partial.write_text(text, encoding="utf-8", newline="")
    return [folder / name for name in contents]


def _verdict(outcome: Outcome) -> Verdict:
    if outcome.status == "failed":
        return Verdict("failed", outcome.message)
    return verdict_of(outcome.summary)


def _line(outcome: Outcome, verdict: Verdict) -> dict[str, str]:
    """Cells of a row by column."""
    frames = outcome.summary.get("frames", {})
    posed, lost = frames.get("with_pose"), frames.get("lost", ())
    scores = {name: _number(outcome.score.get(name)) for name in _SCORES}
    return {
        "recording": outcome.job.name,
        "verdict": verdict.level,
        "reason": verdict.reason,
        "frames": "" if posed is None else f"{posed} of {posed + len(lost)}",
        "stature_m": _stature(outcome.summary),
        "seconds": f"{outcome.seconds:.1f}",
        **scores,
    }


def _number(value: float | None) -> str:
    """A measure in a cell; empty where it is not known, or not one of this body's."""
    return "" if value is None or not np.isfinite(value) else f"{value:.3g}"


def _stature(summary: Mapping[str, Any] | None) -> str:
    """Stature in metres; empty where there is no result, or the body is no person's."""
    stature_m = summary["body"].get("stature_m") if summary else None
    return "" if stature_m is None else f"{stature_m:.3f}"


def _csv(lines: Sequence[dict[str, str]], columns: Sequence[str]) -> str:
    file = io.StringIO()
    writer = csv.DictWriter(file, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(lines)
    return file.getvalue()


def _markdown(lines: Sequence[dict[str, str]], columns: Sequence[str]) -> str:
    rows = [list(columns), ["---"] * len(columns)]
    rows += [[line[name].replace("|", "\\|") for name in columns] for line in lines]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _page(rows: Sequence[tuple[Outcome, Verdict]], folder: Path) -> str:
    template = resources.files("voxelpose.batch").joinpath(INDEX).read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    cards = [
        {
            "verdict": verdict,
            "line": _line(outcome, verdict),
            "score": outcome.score,
            "picture": _thumbnail(folder / outcome.job.name),
            "link": next(
                (
                    f"{outcome.job.name}/{name}"
                    for name in (REPORT, "contact_sheet.png", "summary.json")
                    if (folder / outcome.job.name / name).exists()
                ),
                "",
            ),
        }
        for outcome, verdict in rows
    ]
    counts = {
        level: sum(verdict.level == level for _, verdict in rows)
        for level in ("failed", "doubtful", "reliable")
    }
    return environment.from_string(template).render(
        cards=cards, counts=counts, title=folder.resolve().name, version=__version__
    )


def _thumbnail(folder: Path) -> str:
    """The middle picture of a contact sheet as a data URI; empty where there is none."""
    path = folder / "contact_sheet.png"
    try:
        image = read_still(path)
    except InputError:
        return ""
    scale = _THUMBNAIL_PX / image.shape[1]
    small = cv2.resize(image, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return data_uri(np.asarray(small, np.uint8), ".webp", 70)
