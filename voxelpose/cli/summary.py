"""Summaries that commands print at their end."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from silhouette_core.body.joints import LANDMARK_NAMES
from voxelpose.cli.terminal import plain, print_table, rich_console
from voxelpose.reliability import verdict_of
from voxelpose.results import FILES, names_of

if TYPE_CHECKING:
    from voxelpose.evaluation import Score
    from voxelpose.results import Result
    from voxelpose.scan_distance import ScanScore

_OF_ALL = "contact_sheet.png", "overlay_*.webm", "joints.csv"


def print_result(result: Result, verbose: bool = False) -> None:
    """Prints verdict, number of poses and files of a result; if verbose, timings and quality."""
    console = rich_console()
    summary: Any = result.summary
    console.print(_verdict_markup(summary), soft_wrap=True)
    frames, seconds = summary["frames"], summary["seconds"]
    count = frames["with_pose"] + len(frames["lost"])
    missed, absent = (len(frames.get(name, ())) for name in ("not_filmed", "away"))
    console.print(
        f"[bold]{frames['with_pose']} of {count} frames[/bold] have a pose"
        + (f", {absent} more show nobody" if absent else "")
        + (f", {missed} more were not filmed by all cameras" if missed else "")
        + f"; {seconds['total']:.1f} s in total"
    )
    if words := summary.get("conditioning", {}).get("words"):
        console.print(plain(words))
    if verbose or "total" in seconds["stages"]:  # of an estimator that times whole frames
        _print_stages(seconds["stages"])
    if verbose:
        _print_quality(summary["quality"])
    _print_files(result.folder, FILES)


def _verdict_markup(summary: Any) -> str:
    """The verdict in words, its level coloured."""
    verdict = verdict_of(summary)
    colour = "green" if verdict.level == "reliable" else "yellow"
    return f"[bold {colour}]{verdict.level}[/]{plain(str(verdict).removeprefix(verdict.level))}"


def _print_files(folder: Path, files: Mapping[str, str]) -> None:
    console, folder_text = rich_console(soft_wrap=True), plain(folder)
    console.print(f"[bold]{folder_text}[/bold]")
    for pattern, meaning in files.items():
        if any(folder.glob(pattern.replace("N/", "*"))):
            console.print(f"  {pattern:<20}[dim]{meaning}[/dim]")
    console.print(f"to see it in three dimensions: voxelpose view {folder_text}")
    console.print(f"to assess its quality: voxelpose report {folder_text}")


def print_people(folder: Path, results: Sequence[Result]) -> None:
    """Prints the verdict and the number of poses of each of several people, and the files."""
    console = rich_console()
    for name, result in zip(names_of(results), results, strict=True):
        summary: Any = result.summary
        frames = summary["frames"]
        whose = (
            result.folder.name if name == result.folder.name else f"{result.folder.name}, {name}"
        )
        absent = len(frames.get("away", ()))
        console.print(
            f"[bold]{plain(whose)}[/bold], {frames['with_pose']} frames"
            + (f", away in {absent}: " if absent else ": ")
            + _verdict_markup(summary),
            soft_wrap=True,
        )
    files = {name: FILES[name] for name in _OF_ALL}
    _print_files(folder, {**files, "person_N/": "joints.csv, motion.bvh, … of each"})


def _print_stages(stages: Mapping[str, Any]) -> None:
    """Prints the durations of the stages, as Okada and Stenger, Fig. 6."""
    columns = "min", "max", "mean"
    rows = [
        (plain(name), *(f"{1000 * range_s[column]:.1f}" for column in columns))
        for name, range_s in stages.items()
        if "mean" in range_s
    ]
    print_table(rows, "stage", *(f"{column} ms" for column in columns))


def _print_quality(quality: Mapping[str, Any]) -> None:
    for name, values in quality.items():
        if "median" in values:
            low, median, high = (f"{values[key]:.3f}" for key in ("min", "median", "max"))
            rich_console().print(f"{plain(name)}: median {median}, from {low} to {high}")


def print_score(score: Score) -> None:
    """Prints the errors of a result against known joint positions."""
    first, truth_mm = score.joints[0], score.jitter_truth_mm
    measures = (
        (score.joint_angle_deg, "deg", "joint_angle_deg: mean error of the joint angles"),
        (score.root_mm, "mm", f"root_mm: mean joint error relative to the {first}"),
        (score.mpjpe_mm, "mm", "mpjpe_mm: mean joint error in the world"),
        (score.pa_mm, "mm", "pa_mm: mean joint error after the best similarity transform"),
        (100 * score.pck150, "%", f"pck150: joints within 150 mm relative to the {first}"),
        (score.angle_deg, "deg", "angle_deg: mean angular error of the bones"),
        (score.jitter_mm, "mm", f"jitter_mm: third difference (truth: {truth_mm:.1f})"),
        (100 * score.flips, "%", "flips: frames with left and right exchanged"),
        (100 * score.lost, "%", f"lost: frames without a pose or beyond 300 mm, of {score.frames}"),
    )
    print_table(
        (f"[bold]{value:.1f} {unit}[/bold]", plain(meaning))
        for value, unit, meaning in measures
        if np.isfinite(value)
    )
    console = rich_console()
    if score.corrections:
        console.print(f"corrected by hand: {plain(', '.join(score.corrections))}", soft_wrap=True)
    errors = list(zip(score.joint_root_mm, score.joints, strict=False))
    if errors and score.joints == LANDMARK_NAMES:
        worst = sorted(((mm, name) for mm, name in errors if np.isfinite(mm)), reverse=True)[:3]
        console.print("worst joints: " + ", ".join(f"{name} {mm:.0f} mm" for mm, name in worst))
        if unknown := [name for mm, name in errors if not np.isfinite(mm)]:
            console.print(f"not scored, since the truth lacks them: {', '.join(unknown)}")
    elif errors:
        print_table(((plain(name), f"{mm:.1f}") for mm, name in errors), "joint", "root_mm")
        angles = score.each_joint_angle_deg.items()
        print_table(((plain(name), f"{deg:.2f}") for name, deg in angles), "joint angle", "degrees")


def print_scan_score(score: ScanScore) -> None:
    """Prints the distances of body and hull from a scan."""
    console = rich_console()
    for note in score.notes:
        console.print(f"note: {plain(note)}", soft_wrap=True)
    if score.turned_deg or score.moved_mm:
        console.print(
            f"the scan was moved by {score.moved_mm:.0f} mm and turned by {score.turned_deg:.1f}"
            " degrees onto the body: where the body stands is not compared"
        )
    rows = {
        "body to scan": score.body_to_scan,
        "scan to body": score.scan_to_body,
        "hull to scan": score.hull_to_scan,
        "scan to hull": score.scan_to_hull,
    }
    print_table(
        (
            (name, *(f"{value_mm:.1f}" for value_mm in astuple(distance)))
            for name, distance in rows.items()
            if distance is not None
        ),
        f"frame {score.frame}, mm",
        "mean, + outside",
        "RMS",
        "95 %",
        "worst",
    )
