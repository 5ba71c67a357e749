"""The report's page, self-contained in one file."""

import time
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from calib.errors import InputError
from calib.storage.atomic import write_whole
from silhouette_core.motion.anatomical import anatomical_angles
from silhouette_core.motion.conditioning import conditioning_words, filter_warning
from silhouette_core.motion.dynamics import is_person_tree
from silhouette_core.motion.gait import find_gait
from silhouette_core.motion.motion import Motion
from silhouette_core.progress import Reporter, SilentReporter
from voxelpose.findings import Finding
from voxelpose.people_marks import display_name, person_colour, person_names
from voxelpose.recording.frame_reader import read_still
from voxelpose.reliability import LEVELS, verdict_of_people
from voxelpose.report.charts import LEFT, MIDDLE, RIGHT, TimeChart, part_chart, time_chart
from voxelpose.report.expected_errors import error_rows
from voxelpose.report.floor_picture import floor_picture, telling_row
from voxelpose.report.gait_section import gait_section
from voxelpose.report.preview import data_uri, make_preview
from voxelpose.report.verdict import (
    CameraCheck,
    check_cameras,
    findings,
    headline,
    noun_of,
    recording_findings,
)
from voxelpose.result_documents import path_from
from voxelpose.results import FILES, Result, names_of, open_people, people_seconds
from voxelpose.tuning import RELIABILITY
from voxelpose.tuning import REPORT as LIMITS
from voxelpose.view.images.canvas import Image, has_sides
from voxelpose.view.serving.page_words import page_words
from voxelpose.view.viewer.result_scenes import ResultScenes

REPORT = "report.html"
_GENERATOR = '<meta name="generator" content="voxelpose'

# Title, meaning and name of each angle, with {} for both sides.
_ANGLES = (
    ("Hip flexion", "thigh forward", "{}_hip_flexion"),
    ("Knee flexion", "0° is straight", "{}_knee_flexion"),
    ("Ankle dorsiflexion", "toes up", "{}_ankle_dorsiflexion"),
    ("Hip adduction", "thigh inward", "{}_hip_adduction"),
    ("Shoulder elevation", "0° hangs, 90° level", "{}_shoulder_elevation"),
    ("Elbow flexion", "0° is straight", "{}_elbow_flexion"),
    ("Trunk flexion", "bent forward", "trunk_flexion"),
    ("Pelvis tilt", "tipped forward", "pelvis_tilt"),
)
_MOST_CHARTS, _BODY_PX = 24, 720
_SETTINGS = {
    "recording": "folder of the videos, relative to this folder",
    "frames": "first frame, and one past the last",
    "cameras": "cameras that were used",
    "estimator": "method",
    "label": "labels of the person in masks/",
    "stature_m": "height of the person as given, metres",
    "chest_m": "chest girth as given, metres",
    "sex": "whose average proportions were the start",
    "background": "what backgrounds were taken from",
    "network": "whether a pose network that is installed is used",
    "smooth": "whether later frames were used, and the motion filtered",
    "conditioning": "filter of the finished motion, and which gaps are filled",
    "threads": "processor threads",
    "backend": "implementation that scored the poses",
    "options": "the method's own settings",
}


def write_report(
    folder: Path,
    out: Path | None = None,
    recording: Path | None = None,
    overwrite: bool = False,
    reporter: Reporter | None = None,
) -> Path:
    """Writes report.html, one self-contained page, about a result, of one person or several.

    Args:
        out: the file; None: report.html in the result.
        recording: where the recording is now, if it was moved.
        overwrite: whether a file that is not a report may be replaced.

    Raises:
        InputError: it is no result, or the file cannot be written.
    """
    folder, results = Path(folder), open_people(folder)
    out = out or folder / REPORT
    if out.exists() and not overwrite and not _is_report(out):
        raise InputError(
            f"{out} exists and is not a report: give --out another name, or add --overwrite"
        )
    scenes = ResultScenes(folder, recording)
    try:
        contents = _contents(folder, results, scenes, reporter or SilentReporter())
    finally:
        scenes.close()
    write_whole(out, render_page("voxelpose.report", "page.html", contents))
    return out


def render_page(package: str, template: str, contents: Mapping[str, object]) -> str:
    """A page whose texts are escaped, of a template with all its variables."""
    environment = jinja2.Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=jinja2.StrictUndefined
    )
    environment.filters["told"] = lambda words: page_words(words).replace("`", "")
    text = resources.files(package).joinpath(template).read_text("utf-8")
    return environment.from_string(text).render(contents)


def sheet_image(folder: Path) -> Image | None:
    """The contact sheet of a result, BGR; None where there is none."""
    try:
        return read_still(folder / "contact_sheet.png")
    except InputError:
        return None


def _is_report(path: Path) -> bool:
    try:
        return _GENERATOR in path.read_text(encoding="utf-8", errors="replace")[:2000]
    except OSError:
        return False


def _contents(
    folder: Path, results: Sequence[Result], scenes: ResultScenes, reporter: Reporter
) -> dict[str, object]:
    reporter.stage("pictures")
    preview = make_preview(folder, scenes)
    sheet = sheet_image(folder)
    reporter.stage("cameras")
    if scenes.changed:
        reporter.note(scenes.changed)
    cameras = check_cameras(scenes)
    reporter.stage("charts")
    result, people = results[0], _people(results, cameras, scenes.changed)
    summary: Any = result.summary
    settings, files = result.settings, FILES
    common = {name: people[0][name] for name in ("verdict", "sentence")}
    if len(people) > 1:
        common = _overall(results, people, recording_findings(cameras, scenes.changed))
        summary = summary | {"seconds": summary["seconds"] | people_seconds(folder)}
        recording = (result.folder / str(settings["recording"])).resolve()
        settings = {**settings, "recording": path_from(folder.resolve(), recording)}
        files = files | {"person_*": "a result of each person"}
    return {
        "summary": summary,
        "title": summary["recording"],
        "subject": None if scenes.recording is None else scenes.recording.subject,
        "made": time.strftime("%Y-%m-%d %H:%M"),
        "people": people,
        **common,
        "preview": preview,
        "sheet": None if sheet is None else data_uri(sheet, 1500, ".jpg", 82),
        "covered": LIMITS.covered,
        "doubtful": RELIABILITY.agreement,
        "cameras": cameras.lines,
        "agreement": cameras.summary,
        "missing": scenes.missing,
        "stages": _stages(summary["seconds"]),
        "settings": _settings_table(settings),
        "rig": [_camera(camera) for camera in result.rig],
        "files": [
            (pattern, words) for pattern, words in files.items() if any(folder.glob(pattern))
        ],
        "left": LEFT,
        "right": RIGHT,
        "noun": noun_of(result),
        "sided": has_sides(result.motion.model.names),
    }


def _people(results: Sequence[Result], cameras: CameraCheck, changed: str) -> list[dict[str, Any]]:
    """What the page says of each person; of one alone with what the recording says."""
    people, alone = [], len(results) == 1
    for k, (name, result) in enumerate(zip(person_names(len(results)), results, strict=True)):
        assessed = findings(result, cameras, changed) if alone else findings(result, CameraCheck())
        verdict, sentence = headline(result, assessed)
        prefix = "" if alone else f"{name}-"
        angles, quality, parts = _charts(result, prefix)
        people.append(
            {
                "name": name,
                "label": display_name(names_of(results)[k] or name),
                "colour": f"rgb{person_colour(k)}",
                "summary": result.summary,
                "verdict": verdict,
                "sentence": sentence,
                "findings": assessed,
                "angles": angles,
                "quality": quality,
                "parts": parts,
                "part_table": _part_table(result),
                **_movement(result.motion, prefix),
                "conditioning": conditioning_words(result.motion),
                "warning": filter_warning(result.motion),
            }
        )
    return people


def _movement(motion: Motion, prefix: str) -> dict[str, object]:
    """Gait and errors to be expected of a person's motion, and a picture of the body."""
    gait, section, person = None, None, is_person_tree(motion.model.tree)
    if person and (gait := find_gait(motion)) is not None:
        paired = [angle for angle in _ANGLES if "{}" in angle[2]]
        section = gait_section(gait, anatomical_angles(motion), motion.time_s, paired, prefix)
    row = telling_row(motion, gait)
    return {
        "gait": section,
        "errors": error_rows(motion) if person else [],
        "body": data_uri(floor_picture(motion, row), _BODY_PX, ".jpg", 82),
        "body_frame": int(motion.frames[row]),
    }


def _overall(
    results: Sequence[Result], people: Sequence[Mapping[str, Any]], shared: Sequence[Finding]
) -> dict[str, object]:
    levels = [LEVELS.index(person["verdict"].level) for person in people]
    assessed = [*shared, *(finding for person in people for finding in person["findings"])]
    return {
        "verdict": verdict_of_people({person["label"]: person["verdict"] for person in people}),
        "sentence": headline(results[int(np.argmin(levels))], assessed)[1],
        "shared": shared,
    }


def _charts(
    result: Result, prefix: str = ""
) -> tuple[list[tuple[str, str]], list[str], str | None]:
    """Charts of angles with their notes, of quality, and of parts over time; their names in the
    page begin with a prefix.
    """
    motion = result.motion
    person = is_person_tree(motion.model.tree)
    angles = [] if person else _joint_charts(motion, prefix)
    values_deg = anatomical_angles(motion) if person else {}
    for k, (title, note, name) in enumerate(_ANGLES if person else ()):
        sides = {"left": LEFT, "right": RIGHT} if "{}" in name else {"": MIDDLE}
        curves = {side: (values_deg[name.format(side)], colour) for side, colour in sides.items()}
        chart = TimeChart(title, "degrees", curves)
        angles.append((time_chart(chart, motion.time_s, f"{prefix}angle{k}"), note))
    quality = []
    for name, title, below in (
        ("outline_agreement", "Confidence: outlines in common", RELIABILITY.agreement),
        ("unexplained", "Unexplained share of the hull", None),
    ):
        if name in motion.quality:
            values = np.asarray(motion.quality[name], float)
            chart = TimeChart(title, "share", {"": (values, LEFT)}, (0.0, 1.0), below)
            quality.append(time_chart(chart, motion.time_s, prefix + name))
    overlap, parts = motion.quality.get("part_overlap"), None
    if overlap is not None:
        labels = [display_name(name) for name in motion.model.names]
        parts = part_chart(np.asarray(overlap, float), labels, motion.time_s, f"{prefix}parts")
    return angles, quality, parts


def _joint_charts(motion: Motion, prefix: str) -> list[tuple[str, str]]:
    """Charts of the joints of a body that is no person's, with their notes."""
    charts, model = [], motion.model
    for part, name in enumerate(model.names):
        columns = np.flatnonzero((model.tree.dof_part == part) & ~model.tree.dof_fixed)
        if not len(columns) or len(charts) == _MOST_CHARTS:
            continue
        curves = {
            model.tree.dofs[k][1].name: (np.degrees(motion.angles_rad[:, k]), colour)
            for k, colour in zip(columns.tolist(), (MIDDLE, LEFT, RIGHT), strict=False)
        }
        chart = TimeChart(display_name(name), "degrees", curves)
        charts.append(
            (time_chart(chart, motion.time_s, f"{prefix}angle{part}"), "0° is the rest pose")
        )
    return charts


def _part_table(result: Result) -> list[tuple[str, float, float]]:
    """Name, mean fraction inside the hull and fraction of uncovered frames, worst first."""
    names = result.motion.model.names
    values = np.asarray(result.motion.quality.get("part_overlap", np.zeros((0, len(names)))), float)
    rows = [
        (display_name(name), float(np.nanmean(column)), float(np.mean(column < LIMITS.covered)))
        for name, column in zip(names, values.T, strict=True)
        if np.isfinite(column).any()
    ]
    return sorted(rows, key=lambda row: row[1])


def _stages(seconds: Mapping[str, Any]) -> list[tuple[str, float, float | None, float]]:
    """Stage, total seconds, median milliseconds per step, and fraction of the longest."""
    rows = [
        (name, spread["sum"], 1000 * spread["median"] if "median" in spread else None)
        for name, spread in seconds["stages"].items()
    ]
    rows.append(("pictures", seconds["pictures"], None))
    longest = max(row[1] for row in rows) or 1.0
    return [(name, total, median, total / longest) for name, total, median in rows]


def _settings_table(settings: Mapping[str, object]) -> list[tuple[str, str, str]]:
    rows = []
    for name, value in settings.items():
        if isinstance(value, Mapping):
            text = ", ".join(f"{key} = {inner}" for key, inner in value.items()) or "none"
        else:
            text = ", ".join(map(str, value)) if isinstance(value, list) else str(value)
        rows.append((name, text, _SETTINGS.get(name, "")))
    return rows


def _camera(camera: Any) -> dict[str, object]:
    width, height = camera.size
    return {
        "name": camera.name,
        "size": f"{width} × {height}",
        "wide": f"{2 * np.degrees(np.arctan(width / (2 * camera.matrix[0, 0]))):.0f}°",
        "position": ", ".join(f"{value:.2f}" for value in camera.center_m),
        "distorted": not camera.is_pinhole,
    }
