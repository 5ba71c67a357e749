"""voxelpose calibrate intrinsics and extrinsics."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from msgspec import Meta
from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli import arguments
from voxelpose.cli.terminal import Progress, plain, rich_console

if TYPE_CHECKING:
    from calib.camera import Rig
    from calib.extrinsics import Extrinsics
    from silhouette_core.progress import Reporter
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

    groups: ClassVar = arguments.CALIBRATION_GROUPS
    pictures: Annotated[Positional[tuple[Path, ...]], arguments.optional("PICTURES")]
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
        arguments.refuse_existing(self._written(), self.overwrite)
        with Progress() as progress:
            lenses = self.calibrate(progress)
        print_lenses(lenses)
        self.write(lenses)
        print(
            f"{self.out}: lenses of {len(lenses)} cameras, without their positions (next:"
            " voxelpose calibrate extrinsics)"
        )
        print(f"{self._written()[1]}: where boards were seen")

    def calibrate(self, reporter: Reporter) -> list[Lens]:
        """Lenses of the cameras that have one, and notes on the others. InputError where none has,
        or there are no pictures.
        """
        reporter.stage("opening")
        from voxelpose.calibration.board_views import cameras_in
        from voxelpose.calibration.lenses import calibrate_lenses

        board = self.to_board()
        cameras = cameras_in(self.pictures)
        if (selected := arguments.camera_names(self.cameras)) is not None:
            if missing := [name for name in selected if name not in cameras]:
                raise InputError(
                    f"no pictures of {', '.join(missing)}: there are {', '.join(cameras)}"
                )
            cameras = {name: cameras[name] for name in selected}
        earlier = earlier_rig(self.out)
        return calibrate_lenses(board, cameras, self.model, self.frames, reporter, earlier)

    def write(self, lenses: list[Lens]) -> None:
        """Writes what `calibrate` found: the lenses, where boards were seen, and a report."""
        from voxelpose.calibration.lenses import lens_notes, lens_report, lens_rig
        from voxelpose.calibration.pictures import coverage_picture, write_calibration

        out, picture, report = self._written()
        notes, image = {"intrinsics": lens_notes(lenses)}, coverage_picture(lenses)
        text = lens_report(lenses)
        write_calibration(lens_rig(lenses), out, notes, (picture, image), (report, text))

    def _written(self) -> tuple[Path, Path, Path]:
        """Files: the lenses, a picture, a report."""
        from voxelpose.calibration.pictures import beside

        return self.out, beside(self.out, "coverage.png"), beside(self.out, "lenses.json")


def earlier_rig(out: Path) -> Rig | None:
    """The calibration that a new one replaces; None where there is none that can be read."""
    from calib.files import read_rig

    try:
        return read_rig(out, lenses=True) if out.exists() else None
    except InputError:
        return None


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
            intrinsics.camera.matrix.diagonal()[:2],
            intrinsics.focal_error_px,
            intrinsics.camera.matrix[:2, 2],
        )
        console.print(
            f"  {len(lens.used())} of {len(pictures)} pictures, {intrinsics.rms_px:.3f} px; focal"
            f" lengths {focal[0]:.1f} ± {error[0]:.1f}, {focal[1]:.1f} ± {error[1]:.1f} px, centre"
            f" {centre[0]:.1f}, {centre[1]:.1f} px, distortion"
            f" {' '.join(f'{term:.4f}' for term in intrinsics.camera.distortion)}"
        )
        if lens.before_px is not None:
            console.print(f"  the lens as it was before: {lens.before_px:.3f} px")
        for advice in intrinsics.advice:
            console.print(f"  [yellow]{plain(advice)}[/yellow]")


@dataclass(frozen=True, kw_only=True)
class CalibrateExtrinsics(arguments.OptionalBoard):
    """Calibrates positions and directions of cameras.

    They are determined from a board that is carried through the view of all cameras, or from a list
    of points. RECORDING: a folder with a video per camera, recorded at the same time and named as
    in the calibration of the lenses. Cameras that are out of step, or film at different rates, need
    timestamps.csv there: `voxelpose calibrate sync RECORDING --by board` makes it. Let the board
    lie on the floor for a moment and give that frame as --floor: its first corner becomes the
    origin of the world, with z up. Next to OUT, an image of the cameras and a report in JSON are
    written.

      voxelpose calibrate extrinsics board_walk --intrinsics lenses.toml --board 8x5 --square 0.029 \\
        --floor 0 --out calibration.toml
      voxelpose calibrate extrinsics --points points.csv --intrinsics lenses.toml \\
        --out calibration.toml
    """  # noqa: E501

    groups: ClassVar = arguments.CALIBRATION_GROUPS
    recording: Annotated[Positional[Path | None], arguments.optional("RECORDING")] = None
    """Folder with a video (or an image) of the board per camera."""
    intrinsics: Annotated[Path, arg(metavar="FILE")]
    """Calibration of the lenses; positions in it do not count, and may be missing."""
    out: Annotated[Path, arg(metavar="OUT")]
    """Calibration to be written; .toml preserves most."""
    floor: Annotated[int | None, arguments.optional("FRAME")] = None
    """Frame (of the first camera) in which the board lies on the floor. Default: the first camera
    is the world."""
    points: arguments.OptionalFile = None
    """CSV of camera,point,x_px,y_px,x_m,y_m,z_m instead of a board; metres only where known."""
    refine_lenses: bool = False
    """Adjust the lenses too, if they were not calibrated with boards at such distances."""
    moments: Annotated[int, Meta(ge=1, le=10_000), arg(metavar="N")] = 150
    """Maximum number of time steps used of the recording."""
    cameras: arguments.Cameras = None
    unit: arguments.Unit = None
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Calibrates positions and directions."""
        arguments.refuse_existing(self._written(), self.overwrite)
        with Progress() as progress:
            extrinsics = self.calibrate(progress)
        print_extrinsics(extrinsics, "points" if self.points is not None else "boards")
        self.write(extrinsics)
        print(f"{self.out}: {len(extrinsics.rig)} cameras with their positions, in metres")
        print(
            f"{self._written()[1]}: the rig from above and from the side; does it look like the"
            " room?"
        )
        from calib.upright import axis_name, other_up

        up = other_up(extrinsics.rig)
        if not self._grounded:
            direction = "z" if up is None else axis_name(up)
            print(
                "note: without --floor the world is the first camera's frame, in which up is"
                f" {direction} by how the cameras stand: `fit` and `track` turn it by themselves"
            )
        elif up is not None:
            print(
                f"note: the cameras stand as if {axis_name(up)} were up, not z (z into the floor is"
                " usual for OpenCV's boards; points may be mirrored): `fit` and `track` turn the"
                " world by themselves; for others `voxelpose calibrate convert --up cameras`"
            )

    def calibrate(self, reporter: Reporter) -> Extrinsics:
        """Positions and directions, from a board or from points. InputError where something is
        missing, or they are not determined.
        """
        reporter.stage("opening")
        from calib.files import read_rig

        lenses = read_rig(self.intrinsics, self.unit, lenses=True)
        if (self.points is None) == (self.recording is None):
            raise InputError(
                "give either RECORDING, a folder of videos of a board, or --points, a list of"
                " points"
            )
        if self.points is not None:
            from calib.points import calibrate_from_points, measured_errors, read_points

            points = read_points(self.points)
            names = arguments.camera_names(self.cameras) or [
                name for name in lenses.names if name in points.cameras()
            ]
            extrinsics = calibrate_from_points(lenses.select(names), points)
            earlier = earlier_rig(self.out)
            before = {} if earlier is None else measured_errors(earlier, points)
            return replace(extrinsics, before_px=before)
        from voxelpose.calibration.extrinsics import ExtrinsicsSettings, extrinsics_from_recording

        board = self.to_board()
        if board is None or self.recording is None:
            raise InputError(
                "what does the board look like? give --board, as in 8x5, and --square in metres, as"
                " in 0.029"
            )
        settings = ExtrinsicsSettings(
            self.floor,
            self.moments,
            arguments.camera_names(self.cameras),
            self.refine_lenses,
            earlier_rig(self.out),
        )
        return extrinsics_from_recording(board, lenses, self.recording, settings, reporter)

    def write(self, extrinsics: Extrinsics) -> None:
        """Writes what `calibrate` found: the calibration, a picture of the rig, and a report."""
        from calib.files.anipose import read_notes
        from voxelpose.calibration.extrinsics import extrinsics_notes, extrinsics_report
        from voxelpose.calibration.pictures import rig_picture, write_calibration

        out, picture, report = self._written()
        notes = read_notes(self.intrinsics) | {"extrinsics": extrinsics_notes(extrinsics)}
        image, text = rig_picture(extrinsics.rig, self._grounded), extrinsics_report(extrinsics)
        write_calibration(extrinsics.rig, out, notes, (picture, image), (report, text))

    @property
    def _grounded(self) -> bool:
        """Whether the world is the floor's."""
        return self.points is not None or self.floor is not None

    def _written(self) -> tuple[Path, Path, Path]:
        """Files: the calibration, a picture, a report."""
        from voxelpose.calibration.pictures import beside

        return self.out, beside(self.out, "rig.png"), beside(self.out, "places.json")


def print_extrinsics(extrinsics: Extrinsics, unit: str) -> None:
    """Prints the cameras, how many boards or points (`unit`) pairs of them share, and advice."""
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
    if extrinsics.before_px:
        before = ", ".join(f"{name} {px:.2f}" for name, px in extrinsics.before_px.items())
        console.print(f"error of the calibration as it was before, px: {plain(before)}")
    pairs = ", ".join(f"{a}-{b} {count}" for (a, b), count in extrinsics.shared_boards.items())
    console.print(f"{unit} that pairs of cameras share: {plain(pairs)}")
    for advice in extrinsics.advice:
        console.print(f"[yellow]{plain(advice)}[/yellow]")
