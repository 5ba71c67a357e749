"""What `voxelpose calibrate` says of its results."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape

if TYPE_CHECKING:
    from calib.extrinsics import Extrinsics
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
            verdict = (
                "used" if line.left_out is None else f"[red]left out: {escape(line.left_out)}[/red]"
            )
            console.print(
                f"  {escape(f'{line.picture:<{width}}')}  {line.corners or '':>7}  {error:>8} "
                f" {verdict}"
            )
        for reason, count in Counter(
            line.left_out for line in found.pictures if line not in lines
        ).most_common():
            console.print(f"  {count} more frames left out: {reason}")
        focal, error, centre = (
            found.matrix.diagonal()[:2],
            found.focal_error_px,
            found.matrix[:2, 2],
        )
        console.print(
            f"  {len(lens.used())} of {len(found.pictures)} pictures, {found.rms_px:.3f} px; focal"
            f" lengths {focal[0]:.1f} ± {error[0]:.1f}, {focal[1]:.1f} ± {error[1]:.1f} px, centre"
            f" {centre[0]:.1f}, {centre[1]:.1f} px, distortion"
            f" {' '.join(f'{term:.4f}' for term in found.distortion)}"
        )
        for advice in found.advice:
            console.print(f"  [yellow]{advice}[/yellow]")


def print_extrinsics(found: Extrinsics, what: str) -> None:
    """Prints a table of cameras, how many boards (or points) each pair shares, and what is odd.

    Args:
        found: What was found.
        what: "boards" or "points".
    """
    console = Console(highlight=False, soft_wrap=True)
    width = max(6, *(len(line.camera) for line in found.table))
    console.print(
        f"[dim]{'camera':<{width}}  {what}  error px  position ± mm  rotation ± deg      x       y "
        "      z  m[/dim]"
    )
    for camera, line in zip(found.rig, found.table, strict=True):
        sure = (
            f"{line.position_mm:>13.2f}  {line.rotation_deg:>14.3f}"
            if line.position_mm == line.position_mm
            else f"{'reference':>13}  {'':>14}"
        )
        place = " ".join(f"{value:7.3f}" for value in camera.center_m)
        console.print(
            f"{escape(f'{line.camera:<{width}}')}  {line.seen:>{len(what)}}  {line.rms_px:>8.2f} "
            f" {sure}  {place}"
        )
    console.print(f"{found.rms_px:.3f} px in all")
    pairs = ", ".join(f"{a}-{b} {count}" for (a, b), count in found.shared_boards.items())
    console.print(f"{what} that pairs of cameras share: {escape(pairs)}")
    for advice in found.advice:
        console.print(f"[yellow]{escape(advice)}[/yellow]")
