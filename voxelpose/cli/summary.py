"""Summaries that commands print at their end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.table import Table

from voxelpose.cli.terminal import plain, rich_console
from voxelpose.reliability import verdict_of

if TYPE_CHECKING:
    from voxelpose.evaluation import Score
    from voxelpose.results import Result

_FILES = (
    ("contact_sheet.png", "look here first: the fitted body over frames of every camera"),
    ("overlay_*.webm", "the fitted body over the videos"),
    ("joints.csv", "positions of 15 joints, metres"),
    ("motion.bvh", "the skeleton for Blender, Maya, ..."),
    ("motion.safetensors", "joint angles, root and quality, for programs"),
    ("summary.json", "quality and timings"),
)


def print_result(result: Result) -> None:
    """Prints the number of poses, timings, quality and files of a result."""
    console = rich_console()
    summary: Any = result.summary
    folder = plain(result.folder)
    frames, seconds = summary["frames"], summary["seconds"]
    count = frames["with_pose"] + len(frames["lost"])
    console.print(
        f"[bold]{frames['with_pose']} of {count} frames[/bold] have a pose; {seconds['total']:.1f}"
        " s in total"
    )
    stages = Table("stage", "min ms", "median ms", "max ms", box=None, padding=(0, 2, 0, 0))
    for name, range_s in seconds["stages"].items():
        if "median" in range_s:
            values = (f"{1000 * range_s[key]:.1f}" for key in ("min", "median", "max"))
            stages.add_row(plain(name), *values)
    if stages.row_count:
        console.print(stages)
    for name, values in summary["quality"].items():
        if "median" in values:
            low, median, high = (f"{values[key]:.3f}" for key in ("min", "median", "max"))
            console.print(f"{plain(name)}: median {median}, from {low} to {high}")
    console.print(f"[bold]{folder}[/bold]", soft_wrap=True)
    for pattern, meaning in _FILES:
        if any(result.folder.glob(pattern)):
            console.print(f"  {pattern:<20}[dim]{meaning}[/dim]", soft_wrap=True)
    verdict = verdict_of(summary)
    console.print(f"to see it in three dimensions: voxelpose view {folder}", soft_wrap=True)
    console.print(f"to assess its quality: voxelpose report {folder}", soft_wrap=True)
    colour = "green" if verdict.level == "reliable" else "yellow"
    words = plain(str(verdict).removeprefix(verdict.level))
    console.print(f"[bold {colour}]{verdict.level}[/]{words}", soft_wrap=True)


def print_score(score: Score) -> None:
    """Prints the errors of a result against known joint positions."""
    from silhouette_core.body.joints import LANDMARK_NAMES

    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for value, meaning in (
        (f"{score.root_mm:.1f} mm", "root_mm: mean joint error relative to the pelvis"),
        (f"{score.mpjpe_mm:.1f} mm", "mpjpe_mm: mean joint error in the world"),
        (f"{score.pa_mm:.1f} mm", "pa_mm: mean joint error after the best similarity transform"),
        (f"{100 * score.pck150:.1f} %", "pck150: joints within 150 mm relative to the pelvis"),
        (f"{score.angle_deg:.1f} deg", "angle_deg: mean angular error of the bones"),
        (
            f"{score.jitter_mm:.1f} mm",
            f"jitter_mm: third difference (truth: {score.jitter_truth_mm:.1f})",
        ),
        (f"{100 * score.flips:.1f} %", "flips: frames with left and right exchanged"),
        (
            f"{100 * score.lost:.1f} %",
            f"lost: frames without a pose or beyond 300 mm, of {score.frames}",
        ),
    ):
        table.add_row(f"[bold]{value}[/bold]", meaning)
    console = rich_console()
    console.print(table)
    if score.joint_root_mm:
        worst = sorted(zip(score.joint_root_mm, LANDMARK_NAMES, strict=True), reverse=True)[:3]
        console.print("worst joints: " + ", ".join(f"{name} {mm:.0f} mm" for mm, name in worst))
