"""Tables that `voxelpose calibrate intrinsics` and `extrinsics` print."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from voxelpose.cli.terminal import plain, rich_console

if TYPE_CHECKING:
    from calib.extrinsics import Extrinsics
    from voxelpose.calibration.lenses import Lens

_MAX_LINES = 60  # with more pictures, those left out are counted by reason


def print_lenses(lenses: list[Lens]) -> None:
    """Prints the pictures of every camera, its lens, and advice for a better recording."""
    console = rich_console(soft_wrap=True)
    for lens in lenses:
        intrinsics = lens.intrinsics
        pictures = intrinsics.pictures
        lines = [line for line in pictures if len(pictures) <= _MAX_LINES or line.corners]
        width = max(len(line.picture) for line in lines)
        console.print(f"[bold]{plain(lens.camera)}[/bold]")
        console.print(f"  [dim]{'picture':<{width}}  corners  error px[/dim]")
        for line in lines:
            error = "" if line.corners == 0 else f"{line.rms_px:.2f}"
            verdict = (
                "used" if line.left_out is None else f"[red]left out: {plain(line.left_out)}[/red]"
            )
            console.print(
                f"  {plain(f'{line.picture:<{width}}')}  {line.corners or '':>7}  {error:>8} "
                f" {verdict}"
            )
        for reason, count in Counter(
            line.left_out for line in pictures if line not in lines
        ).most_common():
            console.print(f"  {count} more frames left out: {plain(reason)}")
        focal, error, centre = (
            intrinsics.matrix.diagonal()[:2],
            intrinsics.focal_error_px,
            intrinsics.matrix[:2, 2],
        )
        console.print(
            f"  {len(lens.used())} of {len(pictures)} pictures, {intrinsics.rms_px:.3f} px; focal"
            f" lengths {focal[0]:.1f} ± {error[0]:.1f}, {focal[1]:.1f} ± {error[1]:.1f} px, centre"
            f" {centre[0]:.1f}, {centre[1]:.1f} px, distortion"
            f" {' '.join(f'{term:.4f}' for term in intrinsics.distortion)}"
        )
        for advice in intrinsics.advice:
            console.print(f"  [yellow]{plain(advice)}[/yellow]")


def print_extrinsics(extrinsics: Extrinsics, unit: str) -> None:
    """Prints the cameras, the number of boards (or points) that pairs share, and advice.

    Args:
        unit: "boards" or "points".
    """
    console = rich_console(soft_wrap=True)
    width = max(6, *(len(line.camera) for line in extrinsics.table))
    console.print(
        f"[dim]{'camera':<{width}}  {unit}  error px  position ± mm  rotation ± deg      x       y "
        "      z  m[/dim]"
    )
    for camera, line in zip(extrinsics.rig, extrinsics.table, strict=True):
        errors = (
            f"{line.position_mm:>13.2f}  {line.rotation_deg:>14.3f}"
            if line.position_mm == line.position_mm
            else f"{'reference':>13}  {'':>14}"
        )
        position = " ".join(f"{value:7.3f}" for value in camera.center_m)
        console.print(
            f"{plain(f'{line.camera:<{width}}')}  {line.seen:>{len(unit)}}  {line.rms_px:>8.2f} "
            f" {errors}  {position}"
        )
    console.print(f"{extrinsics.rms_px:.3f} px overall")
    pairs = ", ".join(f"{a}-{b} {count}" for (a, b), count in extrinsics.shared_boards.items())
    console.print(f"{unit} that pairs of cameras share: {plain(pairs)}")
    for advice in extrinsics.advice:
        console.print(f"[yellow]{plain(advice)}[/yellow]")
