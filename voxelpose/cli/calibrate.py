"""voxelpose calibrate."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from voxelpose.cli.arguments import camera_names
from voxelpose.cli.calibrate_check import CalibrationCheck
from voxelpose.cli.calibrate_sync import CalibrationSync

if TYPE_CHECKING:
    from calib.board import Board
    from calib.camera import Rig
    from calib.extrinsics import Extrinsics
    from voxelpose.cli.progress import Progress

_LONGEST_SQUARE_M = 2.0


@dataclass(frozen=True, kw_only=True)
class BoardArguments:
    """What the board looks like."""

    board: Annotated[str, arg(metavar="COLUMNSxROWS")]
    """Inner corners along and down: where four squares meet. One fewer than squares each way."""
    square: Annotated[float, arg(metavar="M")]
    """Side of a square in metres, measured on the print: 0.03 for 30 mm."""
    marker: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Side of a marker in metres, for a ChArUco board. Left out: a plain checkerboard."""
    dictionary: Annotated[str, arg(metavar="NAME")] = "DICT_4X4_50"
    """OpenCV's name of a ChArUco board's markers."""

    def made(self) -> Board:
        """Returns the board."""
        from calib.board import Board

        if self.square > _LONGEST_SQUARE_M:
            raise InputError(
                f"--square {self.square:g} are squares of {self.square:g} m: give metres,"
                f" {self.square / 1000:g} for millimetres"
            )
        return Board(*corner_counts(self.board), self.square, self.marker, self.dictionary)


def corner_counts(text: str) -> tuple[int, int]:
    """Reads 8x5."""
    return _two_numbers(text, "--board", "inner corners along and down, as in 8x5")


def _two_numbers(text: str, option: str, meaning: str) -> tuple[int, int]:
    first, _, second = text.lower().partition("x")
    try:
        return int(first), int(second)
    except ValueError:
        raise InputError(f"{option} {text} is not understood: give {meaning}") from None


@dataclass(frozen=True, kw_only=True)
class BoardSheet:
    """The arguments of `voxelpose calibrate board`."""

    help: ClassVar[str] = """Prints a calibration board to scale, as a PDF.

Print it at 100 % ("actual size"), measure it, and glue it to something flat and stiff.

  voxelpose calibrate board --out board.pdf
  voxelpose calibrate board --board 8x5 --paper a3 --out board.pdf
  voxelpose calibrate board --board 8x5 --square 0.1 --paper large --charuco --out board.pdf
"""

    out: Annotated[Path, arg(metavar="FILE")]
    """PDF to be written."""
    paper: Literal["a4", "a3", "a2", "a1", "a0", "letter", "tabloid", "large"] = "a4"
    """Paper, upright or lying as fits better; large: a page as large as the board, for a print
    shop.
    """
    board: Annotated[str, arg(metavar="COLUMNSxROWS")] = "8x5"
    """Inner corners along and down. One even and one odd number, so that the board has a first
    corner.
    """
    square: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Side of a square in metres. Left out: as large as the paper allows."""
    charuco: bool = False
    """Put markers into the white squares: parts of the board then serve too."""
    dictionary: Annotated[str, arg(metavar="NAME")] = "DICT_4X4_50"
    """OpenCV's name of the markers."""
    overwrite: bool = False
    """Replace FILE if it exists."""

    def run(self) -> int:
        """Prints."""
        from calib.board import Board
        from calib.board_sheet import largest_square_m, write_pdf
        from voxelpose.calibration.files import refuse_existing

        refuse_existing([self.out], self.overwrite)
        columns, rows = corner_counts(self.board)
        if self.paper == "large" and self.square is None:
            raise InputError(
                "--paper large has no size of its own: say how large a square is, for example"
                " --square 0.1"
            )
        square = (
            self.square if self.square is not None else largest_square_m(columns, rows, self.paper)
        )
        marker = round(0.75 * square, 5) if self.charuco else None
        board = Board(columns, rows, square, marker, self.dictionary)
        width, height = write_pdf(board, self.out, None if self.paper == "large" else self.paper)
        print(
            f"{self.out}: page of {1000 * width:.0f} x {1000 * height:.0f} mm; print at 100 %"
            " ('actual size'), not 'fit to page'"
        )
        print(
            f"then measure: {columns + 1} squares in a row are {1000 * (columns + 1) * square:g}"
            f" mm, {rows + 1} in a column {1000 * (rows + 1) * square:g} mm; if not, divide what"
            f" you measure by {columns + 1} and give that as --square"
        )
        markers = f" --marker {marker:g} --dictionary {self.dictionary}" if marker else ""
        print(f"in the other commands: --board {columns}x{rows} --square {square:g}{markers}")
        if board.turns_into_itself:
            print(
                "note: half a turn leaves this board as it is: with one even and one odd number it"
                " has a first corner"
            )
        return 0


@dataclass(frozen=True, kw_only=True)
class LensCalibration(BoardArguments):
    """The arguments of `voxelpose calibrate intrinsics`."""

    help: ClassVar[str] = """Finds each camera's lens from pictures of a board.

PICTURES: a folder of stills or a video (one camera), or a folder that holds one of these per camera.
Beside OUT come a picture of where boards were seen and a report as JSON.

  voxelpose calibrate intrinsics boards --board 8x5 --square 0.029 --out lenses.toml
  voxelpose calibrate intrinsics cam_1.mp4 cam_2.mp4 --board 8x5 --square 0.029 --model rational --out lenses.toml
"""

    pictures: Annotated[Positional[tuple[Path, ...]], arg(metavar="PICTURES")]
    """Folders of stills, videos, stills, or a folder of these."""
    out: Annotated[Path, arg(metavar="OUT")]
    """Calibration to be written; .toml keeps most."""
    model: Literal["pinhole", "rational", "fisheye"] = "pinhole"
    """Lens: pinhole with k1 k2 p1 p2; rational with eight terms, for wide lenses; fisheye, from
    about 120 degrees.
    """
    frames: Annotated[int, arg(metavar="N")] = 40
    """Frames of a video to use, at most: those in which the board is still and at different places."""
    cameras: Annotated[str | None, arg(metavar="NAME,NAME", help_behavior_hint="")] = None
    """Cameras to use, by name. Left out: all."""
    overwrite: bool = False
    """Replace OUT if it exists."""

    def run(self) -> int:
        """Calibrates."""
        from voxelpose.cli.progress import Progress

        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.calibration.board_views import cameras_in
            from voxelpose.calibration.coverage import coverage_picture
            from voxelpose.calibration.files import (
                beside,
                png,
                refuse_existing,
                report_json,
                write_calibration,
            )
            from voxelpose.calibration.lenses import (
                calibrate_lenses,
                lens_notes,
                lens_report,
                lens_rig,
            )

            picture, report = beside(self.out, "coverage.png"), beside(self.out, "lenses.json")
            refuse_existing([self.out, picture, report], self.overwrite)
            board = self.made()
            cameras = cameras_in(self.pictures)
            if (chosen := camera_names(self.cameras)) is not None:
                if missing := [name for name in chosen if name not in cameras]:
                    raise InputError(
                        f"no pictures of {', '.join(missing)}: there are {', '.join(cameras)}"
                    )
                cameras = {name: cameras[name] for name in chosen}
            lenses, failures = calibrate_lenses(board, cameras, self.model, self.frames, progress)
        from voxelpose.cli.calibrate_tables import print_lenses

        print_lenses(lenses)
        if failures:
            rest = (
                f" (the {len(lenses)} others are good: leave it out with --cameras)"
                if lenses
                else ""
            )
            raise InputError("; ".join(failures.values()) + rest)
        others = {picture: png(coverage_picture(lenses)), report: report_json(lens_report(lenses))}
        write_calibration(lens_rig(lenses), self.out, {"intrinsics": lens_notes(lenses)}, others)
        print(
            f"{self.out}: lenses of {len(lenses)} cameras, not yet where they stand (next:"
            " voxelpose calibrate extrinsics)"
        )
        print(f"{picture}: where boards were seen")
        return 0


@dataclass(frozen=True, kw_only=True)
class ExtrinsicsCalibration:
    """The arguments of `voxelpose calibrate extrinsics`."""

    help: ClassVar[
        str
    ] = """Finds where the cameras stand, from a board carried about before them or from listed points.

RECORDING: a folder with a video per camera, filmed at the same time, named as in the calibration of the lenses.
Let the board lie on the floor for a moment and say at which frame: its first corner is the world's origin, up is up.
Beside OUT come a picture of the rig and a report as JSON.

  voxelpose calibrate extrinsics board_walk --intrinsics lenses.toml --board 8x5 --square 0.029 --floor 0 --out calibration.toml
  voxelpose calibrate extrinsics --points points.csv --intrinsics lenses.toml --out calibration.toml
"""

    recording: Annotated[
        Positional[Path | None], arg(metavar="RECORDING", help_behavior_hint="")
    ] = None
    """Folder with a video (or a still) of the board per camera."""
    intrinsics: Annotated[Path, arg(metavar="FILE")]
    """Calibration with the lenses."""
    out: Annotated[Path, arg(metavar="OUT")]
    """Calibration to be written; .toml keeps most."""
    board: Annotated[str | None, arg(metavar="COLUMNSxROWS", help_behavior_hint="")] = None
    """Inner corners along and down: where four squares meet."""
    square: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Side of a square in metres, measured on the print."""
    marker: Annotated[float | None, arg(metavar="M", help_behavior_hint="")] = None
    """Side of a marker in metres, for a ChArUco board. Left out: a plain checkerboard."""
    dictionary: Annotated[str, arg(metavar="NAME")] = "DICT_4X4_50"
    """OpenCV's name of a ChArUco board's markers."""
    floor: Annotated[int | None, arg(metavar="FRAME", help_behavior_hint="")] = None
    """Frame at which the board lies on the floor, face up. Left out: the world is the first
    camera's.
    """
    points: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Instead of a board: CSV of camera,point,x_px,y_px,x_m,y_m,z_m; metres only where measured, z
    up.
    """
    refine_lenses: bool = False
    """Adjust the lenses too, from the same boards: where they were not calibrated from nearer ones."""
    moments: Annotated[int, arg(metavar="N")] = 150
    """Moments of the recording to use, at most."""
    cameras: Annotated[str | None, arg(metavar="NAME,NAME", help_behavior_hint="")] = None
    """Cameras to use, by name. Left out: all."""
    unit: Annotated[
        Literal["m", "cm", "mm"] | None, arg(metavar="m|cm|mm", help_behavior_hint="")
    ] = None
    """Unit of the lenses' calibration, where it does not say it."""
    overwrite: bool = False
    """Replace OUT if it exists."""

    def run(self) -> int:
        """Calibrates."""
        from voxelpose.cli.progress import Progress

        with Progress() as progress:
            progress.stage("opening")
            from calib.files import read_rig
            from voxelpose.calibration.extrinsics import extrinsics_notes, extrinsics_report
            from voxelpose.calibration.files import (
                beside,
                notes_of,
                png,
                refuse_existing,
                report_json,
                write_calibration,
            )
            from voxelpose.calibration.rig_picture import rig_picture

            picture, report = beside(self.out, "rig.png"), beside(self.out, "places.json")
            refuse_existing([self.out, picture, report], self.overwrite)
            found = self._found(read_rig(self.intrinsics, self.unit), progress)
        from voxelpose.cli.calibrate_tables import print_extrinsics

        grounded = self.points is not None or self.floor is not None
        print_extrinsics(found, "points" if self.points is not None else "boards")
        others = {
            picture: png(rig_picture(found.rig, grounded)),
            report: report_json(extrinsics_report(found)),
        }
        write_calibration(
            found.rig,
            self.out,
            notes_of(self.intrinsics) | {"extrinsics": extrinsics_notes(found)},
            others,
        )
        print(f"{self.out}: {len(found.rig)} cameras with their places, in metres")
        print(f"{picture}: the rig from above and from the side; does it look like the room?")
        if not grounded:
            print(
                "note: without --floor the world is the first camera's, and z is not up: voxelpose"
                " fit needs z up"
            )
        return 0

    def _found(self, lenses: Rig, progress: Progress) -> Extrinsics:
        """Finds the places, one way or the other."""
        if (self.points is None) == (self.recording is None):
            raise InputError(
                "give either RECORDING, a folder of videos of a board, or --points, a list of"
                " points"
            )
        if self.points is not None:
            from calib.points import calibrate_from_points
            from voxelpose.calibration.points_file import read_points

            points = read_points(self.points)
            names = camera_names(self.cameras) or [
                name for name in lenses.names if name in points.cameras()
            ]
            return calibrate_from_points(lenses.select(names), points)
        from voxelpose.calibration.extrinsics import ExtrinsicsSettings, extrinsics_from_recording

        if self.board is None or self.square is None or self.recording is None:
            raise InputError(
                "what does the board look like? give --board, as in 8x5, and --square in metres, as"
                " in 0.029"
            )
        board = BoardArguments(
            board=self.board, square=self.square, marker=self.marker, dictionary=self.dictionary
        ).made()
        settings = ExtrinsicsSettings(
            self.floor, self.moments, camera_names(self.cameras), self.refine_lenses
        )
        return extrinsics_from_recording(board, lenses, self.recording, settings, progress)


@dataclass(frozen=True)
class Convert:
    """The arguments of `voxelpose calibrate convert`."""

    help: ClassVar[str] = """Turns a calibration into another format; lengths become metres.

Read by their content: TOML of aniposelib, Pose2Sim, Caliscope and FreeMoCap; OpenCV FileStorage; EasyMocap's folder; Qualisys .qca.txt;
JSON of cameras or of 3x4 matrices. The suffix of OUT chooses what is written: .toml, .yml, .xml, .json, .txt (Qualisys), none (EasyMocap).

  voxelpose calibrate convert Calib.qca.txt calibration.toml
  voxelpose calibrate convert freemocap.toml calibration.toml --unit mm
  voxelpose calibrate convert projections.json calibration.yml --unit m --size 780x582 --picture rig.png
"""

    source: Annotated[Positional[Path], arg(metavar="IN")]
    """Calibration to be read: a file or a folder."""
    out: Annotated[Positional[Path], arg(metavar="OUT")]
    """Calibration to be written."""
    unit: Annotated[
        Literal["m", "cm", "mm"] | None, arg(metavar="m|cm|mm", help_behavior_hint="")
    ] = None
    """Unit of IN's lengths, where it does not say it."""
    size: Annotated[str | None, arg(metavar="WIDTHxHEIGHT", help_behavior_hint="")] = None
    """Size of the pictures, px, where IN does not say it."""
    to: Literal["anipose", "easymocap", "json", "opencv", "projections", "qualisys"] | None = None
    """Format of OUT, where its suffix would choose another."""
    picture: Annotated[Path | None, arg(metavar="FILE", help_behavior_hint="")] = None
    """Draw the cameras from above and from the side, as PNG."""
    overwrite: bool = False
    """Replace OUT if it exists."""

    def run(self) -> int:
        """Converts."""
        from calib.files import read_rig, write_rig
        from voxelpose.calibration.files import notes_of, refuse_existing

        refuse_existing(
            [path for path in (self.out, self.picture) if path is not None], self.overwrite
        )
        size = (
            None
            if self.size is None
            else _two_numbers(self.size, "--size", "width and height, as in 1920x1080")
        )
        rig = read_rig(self.source, self.unit, size)
        write_rig(rig, self.out, self.to, notes_of(self.source))
        print(f"{self.out}: {len(rig)} cameras ({', '.join(rig.names)}), in metres")
        if self.picture is not None:
            from voxelpose.calibration.files import write_png
            from voxelpose.calibration.rig_picture import rig_picture

            write_png(rig_picture(rig), self.picture)
            print(f"{self.picture}: the rig from above and from the side")
        return 0


SUBCOMMANDS = {
    "board": BoardSheet,
    "intrinsics": LensCalibration,
    "extrinsics": ExtrinsicsCalibration,
    "convert": Convert,
    "check": CalibrationCheck,
    "sync": CalibrationSync,
}
