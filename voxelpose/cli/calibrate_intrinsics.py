"""voxelpose calibrate intrinsics."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress, plain, rich_console

if TYPE_CHECKING:
    from voxelpose.calibration.lenses import Lens

_MAX_LINES = 60  # with more pictures, those left out are counted by reason


@dataclass(frozen=True, kw_only=True)
class CalibrateIntrinsics(arguments.BoardArguments):
    """Calibrates the lens of every camera from pictures of a board.

    PICTURES: a folder of images or a video (one camera), or a folder that holds one of these per
    camera. Next to OUT, an image of where boards were seen and a report in JSON are written.

      voxelpose calibrate intrinsics boards --board 8x5 --square 0.029 --out lenses.toml
      voxelpose calibrate intrinsics cam_1.mp4 cam_2.mp4 --board 8x5 --square 0.029 --out lenses.toml
    """  # noqa: E501

    pictures: Annotated[Positional[tuple[Path, ...]], arg(metavar="PICTURES")]
    """Folders of images, videos, images, or a folder of these."""
    out: Annotated[Path, arg(metavar="OUT")]
    """Calibration to be written; .toml preserves most."""
    model: Literal["pinhole", "rational", "fisheye"] = "pinhole"
    """Pinhole with k1 k2 p1 p2; rational, for wide lenses; fisheye, from about 120 degrees."""
    frames: Annotated[int, arg(metavar="N")] = 40
    """Maximum number of frames of a video to use: those in which the board stands still."""
    cameras: arguments.Cameras = None
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Calibrates the lenses."""
        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.calibration.board_views import cameras_in
            from voxelpose.calibration.lenses import (
                calibrate_lenses,
                lens_notes,
                lens_report,
                lens_rig,
            )
            from voxelpose.calibration.pictures import beside, coverage_picture, write_calibration

            picture, report = beside(self.out, "coverage.png"), beside(self.out, "lenses.json")
            arguments.refuse_existing([self.out, picture, report], self.overwrite)
            board = self.to_board()
            cameras = cameras_in(self.pictures)
            if (selected := arguments.camera_names(self.cameras)) is not None:
                if missing := [name for name in selected if name not in cameras]:
                    raise InputError(
                        f"no pictures of {', '.join(missing)}: there are {', '.join(cameras)}"
                    )
                cameras = {name: cameras[name] for name in selected}
            lenses, failures = calibrate_lenses(board, cameras, self.model, self.frames, progress)
        print_lenses(lenses)
        if failures:
            advice = f" (the {len(lenses)} others are good: leave it out with --cameras)"
            raise InputError("; ".join(failures.values()) + advice * bool(lenses))
        write_calibration(
            lens_rig(lenses),
            self.out,
            {"intrinsics": lens_notes(lenses)},
            (picture, coverage_picture(lenses)),
            (report, lens_report(lenses)),
        )
        print(
            f"{self.out}: lenses of {len(lenses)} cameras, without their positions (next:"
            " voxelpose calibrate extrinsics)"
        )
        print(f"{picture}: where boards were seen")


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
