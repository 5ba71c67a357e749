"""What a command says at its end."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from voxelpose.results import Result

_FILES = (
    ("contact_sheet.png", "moments of every camera, the fitted body drawn over them: look here first"),
    ("overlay_*.mp4", "the same as video"),
    ("joints.csv", "positions of 15 joints, metres"),
    ("motion.bvh", "the skeleton for Blender, Maya, ..."),
    ("motion.safetensors", "joint angles, root and quality, for programs"),
    ("summary.json", "quality and timings"),
)


def print_result(result: Result) -> None:
    """Says what a fit found, how well, and where the files are."""
    console = Console(highlight=False)
    summary: Any = result.summary
    frames, seconds = summary["frames"], summary["seconds"]
    count = frames["with_pose"] + len(frames["lost"])
    console.print(f"[bold]{frames['with_pose']} of {count} frames[/bold] have a pose; {seconds['total']:.1f} s in all")
    stages = Table("stage", "min ms", "median ms", "max ms", box=None, padding=(0, 2, 0, 0))
    for name, spread in seconds["stages"].items():
        if "median" in spread:
            stages.add_row(name, *(f"{1000 * spread[key]:.1f}" for key in ("min", "median", "max")))
    if stages.row_count:
        console.print(stages)
    for name, spread in summary["quality"].items():
        if "median" in spread:
            console.print(f"{name}: median {spread['median']:.3f}, from {spread['min']:.3f} to {spread['max']:.3f}")
    table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
    for pattern, meaning in _FILES:
        if any(result.folder.glob(pattern)):
            table.add_row(str(result.folder / pattern), f"[dim]{meaning}[/dim]")
    console.print(table, soft_wrap=True)
