"""voxelpose evaluate."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg


@dataclass(frozen=True)
class Evaluate:
    """The arguments of `voxelpose evaluate`."""

    help: ClassVar[str] = """Scores a result against known joint positions.

TRUTH is a truth.json: {"unit": "m", "joints": {"pelvis": [[x, y, z], ...], ...}},
the 15 joints of joints.csv in world coordinates, one position per frame.

  voxelpose evaluate walk_fit walk/truth.json
  voxelpose evaluate walk_fit walk/truth.json --json
"""

    result: Annotated[Positional[Path], arg(metavar="OUT")]
    """Folder of a fit, or a joints.csv."""
    truth: Annotated[Positional[Path], arg(metavar="TRUTH")]
    """File with the true positions."""
    offset: Annotated[int, arg(metavar="FRAMES")] = 0
    """Added to the result's frame numbers before they are compared."""
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> int:
        """Scores."""
        from json import dumps

        from silhouette_core.body.joints import LANDMARK_NAMES
        from voxelpose.evaluation import read_joints, read_truth, score_motion

        truth = read_truth(self.truth)
        path = self.result / "joints.csv" if self.result.is_dir() else self.result
        score = score_motion(truth, read_joints(path, len(truth), self.offset))
        if self.json:
            numbers = {
                name: round(value, 4) if value == value else None for name, value in asdict(score).items() if name != "joint_root_mm"
            }
            numbers["joint_root_mm"] = {name: round(mm, 1) for name, mm in zip(LANDMARK_NAMES, score.joint_root_mm, strict=False)}
            print(dumps(numbers, indent=1))
            return 0
        from rich.console import Console
        from rich.table import Table

        table = Table(box=None, show_header=False, padding=(0, 2, 0, 0))
        for value, meaning in (
            (f"{score.root_mm:.1f} mm", "root_mm: mean joint error, pelvises put on each other"),
            (f"{score.mpjpe_mm:.1f} mm", "mpjpe_mm: mean joint error in the world"),
            (f"{score.pa_mm:.1f} mm", "pa_mm: mean joint error after the best similarity"),
            (f"{100 * score.pck150:.1f} %", "pck150: joints within 150 mm"),
            (f"{score.angle_deg:.1f} deg", "angle_deg: mean angle between bones"),
            (f"{score.jitter_mm:.1f} mm", f"jitter_mm: third difference (truth: {score.jitter_truth_mm:.1f})"),
            (f"{100 * score.flips:.1f} %", "flips: frames with left and right exchanged"),
            (f"{100 * score.lost:.1f} %", f"lost: frames without a pose or beyond 300 mm, of {score.frames}"),
        ):
            table.add_row(f"[bold]{value}[/bold]", meaning)
        console = Console(highlight=False)
        console.print(table)
        if score.joint_root_mm:
            worst = sorted(zip(score.joint_root_mm, LANDMARK_NAMES, strict=True), reverse=True)[:3]
            console.print("worst joints: " + ", ".join(f"{name} {mm:.0f} mm" for mm, name in worst))
        return 0
