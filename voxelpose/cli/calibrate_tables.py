"""What `voxelpose calibrate` says of its results."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

if TYPE_CHECKING:
    from voxelpose.calibration.lenses import Lens

_MANY = 60  # pictures beyond which those left out are counted by reason


def print_lenses(lenses: list[Lens]) -> None:
    """Prints a table of pictures per camera, the lens, and what a better recording would do."""
    console = Console(highlight=False, soft_wrap=True)
    for lens in lenses:
        found = lens.intrinsics
        lines = [line for line in found.pictures if len(found.pictures) <= _MANY or line.corners]
        width = max(len(line.picture) for line in lines)
        console.print(f"[bold]{lens.camera}[/bold]")
        console.print(f"  [dim]{'picture':<{width}}  corners  error px[/dim]")
        for line in lines:
            error = "" if line.corners == 0 else f"{line.rms_px:.2f}"
            verdict = "used" if line.left_out is None else f"[red]left out: {escape(line.left_out)}[/red]"
            console.print(f"  {escape(f'{line.picture:<{width}}')}  {line.corners or '':>7}  {error:>8}  {verdict}")
        for reason, count in Counter(line.left_out for line in found.pictures if line not in lines).most_common():
            console.print(f"  {count} more frames left out: {reason}")
        focal, error, centre = found.matrix.diagonal()[:2], found.focal_error_px, found.matrix[:2, 2]
        console.print(
            f"  {len(lens.used())} of {len(found.pictures)} pictures, {found.rms_px:.3f} px; "
            f"focal lengths {focal[0]:.1f} ± {error[0]:.1f}, {focal[1]:.1f} ± {error[1]:.1f} px, "
            f"centre {centre[0]:.1f}, {centre[1]:.1f} px, distortion {' '.join(f'{term:.4f}' for term in found.distortion)}"
        )
        for advice in found.advice:
            console.print(f"  [yellow]{advice}[/yellow]")
