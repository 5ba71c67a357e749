"""Commands of `voxelpose calibrate`: board, convert and check, and the list of all."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from msgspec import Meta
from tyro.conf import Positional, arg

from calib.errors import InputError
from calib.storage.atomic import write_whole
from voxelpose.cli import arguments
from voxelpose.cli.calibrate_cameras import CalibrateExtrinsics, CalibrateIntrinsics
from voxelpose.cli.calibrate_sync import CalibrateSync
from voxelpose.cli.terminal import Progress, plain, print_table, rich_console

if TYPE_CHECKING:
    from calib.board import Board
    from calib.camera import Rig
    from calib.upright import UprightFrame
    from voxelpose.calibration.check import Check


@dataclass(frozen=True, kw_only=True)
class CalibrateBoard:
    """Writes a calibration board to scale, as a PDF.

    Print it at 100 % ("actual size"), measure the print, and glue it to something flat and stiff.

      voxelpose calibrate board --out board.pdf
      voxelpose calibrate board --board 8x5 --paper a3 --out board.pdf
      voxelpose calibrate board --board 8x5 --square 0.1 --paper large --charuco --out board.pdf
    """

    groups: ClassVar = arguments.CALIBRATION_GROUPS
    out: Annotated[Path, arg(metavar="FILE")]
    """PDF to be written."""
    paper: Literal["a4", "a3", "a2", "a1", "a0", "letter", "tabloid", "large"] = "a4"
    """Paper size; large: a page of the size of the board, for a print shop."""
    board: Annotated[str, arg(metavar="COLUMNSxROWS")] = "8x5"
    """Inner corners along and down; one even and one odd, so that the first corner is unique."""
    square: arguments.OptionalLength = None
    """Side of a square in metres. Default: as large as the paper allows."""
    charuco: bool = False
    """Put markers into the white squares: boards that are partly visible can then be used."""
    dictionary: arguments.Dictionary = "DICT_4X4_50"
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Writes the PDF and prints what to measure."""
        arguments.refuse_existing([self.out], self.overwrite)
        board, (width, height) = self.write()
        columns, rows, square = board.columns, board.rows, board.square_m
        print(
            f"{self.out}: page of {1000 * width:.0f} x {1000 * height:.0f} mm; print at 100 %"
            " ('actual size'), not 'fit to page'"
        )
        print(
            f"then measure: {columns + 1} squares in a row are {1000 * (columns + 1) * square:g}"
            f" mm, {rows + 1} in a column {1000 * (rows + 1) * square:g} mm; if not, divide what"
            f" you measure by {columns + 1} and give that as --square"
        )
        marker = board.marker_m
        markers = f" --marker {marker:g} --dictionary {self.dictionary}" if marker else ""
        print(f"in the other commands: --board {columns}x{rows} --square {square:g}{markers}")
        if board.is_symmetric:
            print(
                "note: this board looks the same after half a turn: with one even and one odd"
                " number, its first corner is unique"
            )

    def write(self) -> tuple[Board, tuple[float, float]]:
        """Writes the PDF; returns the board, and the page's width and height, m."""
        from calib.board import Board
        from calib.board_sheet import largest_square_m, write_pdf

        columns, rows = arguments.corner_counts(self.board)
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
        return board, write_pdf(board, self.out, None if self.paper == "large" else self.paper)


@dataclass(frozen=True)
class CalibrateConvert:
    """Converts a calibration into another format; lengths become metres.

    Formats of IN are recognised by content: TOML of aniposelib, Pose2Sim, Caliscope and FreeMoCap;
    OpenCV FileStorage; EasyMocap's folder; Qualisys .qca.txt; Theia3D's; Vicon .xcp; COLMAP's text
    model; nerfstudio's transforms.json; Metashape's XML; OpenCap's JSON; JSON of cameras or of 3x4
    matrices. The suffix of OUT selects the format: .toml, .yml, .xml, .json, .txt (Qualisys), none
    (EasyMocap).

      voxelpose calibrate convert Calib.qca.txt calibration.toml
      voxelpose calibrate convert freemocap.toml calibration.toml --unit mm
      voxelpose calibrate convert projections.json calibration.yml --unit m --size 780x582
      voxelpose calibrate convert board.toml calibration.toml --up cameras
      voxelpose calibrate convert board.toml calibration.toml --up person --result walk_fit
    """

    source: Annotated[Positional[Path], arg(metavar="IN")]
    """Calibration to be read: a file or a folder."""
    out: Annotated[Positional[Path], arg(metavar="OUT")]
    """Calibration to be written."""
    unit: arguments.Unit = None
    size: Annotated[str | None, arguments.optional("WIDTHxHEIGHT")] = None
    """Image size in pixels, where IN does not state it."""
    to: Literal["anipose", "easymocap", "json", "opencv", "projections", "qualisys"] | None = None
    """Format of OUT, where its suffix would select another."""
    up: Annotated[str | None, arguments.optional("AXIS|cameras|person")] = None
    """What becomes z: an axis of IN (-z, y ...), what is up for the cameras, or in --result."""
    result: Annotated[Path | None, arguments.optional("RESULT")] = None
    """Result of a fit with IN, for --up person: up and the floor as found there."""
    cameras: arguments.Cameras = None
    picture: arguments.OptionalFile = None
    """PNG to be written: the cameras from above and from the side."""
    overwrite: arguments.OverwriteFile = False

    def run(self) -> None:
        """Converts the calibration."""
        from calib.files import read_rig, write_rig
        from calib.files.anipose import read_notes
        from calib.upright import axis_name

        arguments.refuse_existing([self.out, self.picture], self.overwrite)
        size = self.size and arguments.two_numbers(
            self.size, "--size", "width and height, as in 1920x1080"
        )
        names = arguments.camera_names(self.cameras)
        rig = read_rig(self.source, self.unit, size or None, names)
        left_out = rig.notes
        if names is not None:
            rig = rig.select(names)
        notes = read_notes(self.source)
        frame = self._upright_frame(rig)
        if frame is not None:
            rig = frame.rig(rig)
            notes["up"] = "z"
        write_rig(rig, self.out, self.to, notes)
        print(f"{self.out}: {len(rig)} cameras ({', '.join(rig.names)}), in metres")
        for note in left_out:
            print(f"note: {note}")
        if frame is not None:
            floor = f", the floor at {frame.floor_m:.2f} m along it" if frame.floor_m else ""
            print(f"z is now up, which was {axis_name(frame.up)}{floor}")
        if self.picture is not None:
            from voxelpose.calibration.pictures import rig_picture
            from voxelpose.view.images.canvas import png

            write_whole(self.picture, png(rig_picture(rig)))
            print(f"{self.picture}: the cameras from above and from the side")

    def _upright_frame(self, rig: Rig) -> UprightFrame | None:
        """Returns the frame that becomes the world; None where IN's world stays."""
        from calib.upright import UprightFrame, up_candidates
        from voxelpose.results import Result

        if (self.up == "person") != (self.result is not None):
            raise InputError(
                "--up person needs --result, the result of a fit with this calibration, and no"
                " other --up does"
            )
        if self.result is not None:
            return Result.open(self.result).motion.upright_frame
        if self.up == "cameras":
            return UprightFrame.from_up(up_candidates(rig)[0])
        up = arguments.up_direction(self.up)
        return None if up is None else UprightFrame.from_up(up)


@dataclass(frozen=True)
class CalibrateCheck:
    """Checks from silhouettes that calibration and videos agree.

    Names a camera that was moved, exchanged with another, cropped, scaled or padded, or is out of
    step, and by how much. No board is needed: a person who moves in view of all cameras is enough.
    Exit code 0: all cameras agree; 1: one does not.

      voxelpose calibrate check walk
      voxelpose calibrate check walk --png check.png
      voxelpose calibrate check walk --repair repaired
    """

    recording: arguments.RecordingFolder
    repair: Annotated[Path | None, arguments.optional("OUT")] = None
    """Folder to be made for a repaired calibration.toml (and timestamps.csv, if needed)."""
    png: arguments.OptionalFile = None
    """PNG to be written: every camera with the outlines that the others predict."""
    moments: Annotated[int, Meta(ge=3, le=10_000), arg(metavar="N")] = 12
    """Number of time steps to check, spread over the recording."""
    most_late: Annotated[int, Meta(ge=0, le=10_000), arg(metavar="FRAMES")] = 12
    """Largest time offset of a camera that is searched for."""
    frames: arguments.Frames = None
    cameras: arguments.Cameras = None
    unit: arguments.Unit = None
    fps: arguments.Fps = None
    label: arguments.Label = None
    overwrite: arguments.OverwriteFile = False

    def run(self) -> int:
        """Checks the recording; returns the exit code."""
        arguments.refuse_existing([self.png], self.overwrite, "--png")
        if self.repair is not None and self.repair.exists():
            raise InputError(f"{self.repair} exists: give --repair another name")
        with Progress() as progress:
            progress.stage("opening")
            from voxelpose.calibration.check import check_recording, write_repair
            from voxelpose.recording.folder import Recording, frame_range

            frames, names = frame_range(self.frames), arguments.camera_names(self.cameras)
            recording = Recording.open(
                self.recording, frames, names, self.unit, self.fps, self.label
            )
            check = check_recording(recording, progress, self.moments, self.most_late)
        print_check(check)
        if self.png is not None:
            from voxelpose.calibration.pictures import draw_check
            from voxelpose.view.images.canvas import png

            write_whole(self.png, png(draw_check(check)))
            print(f"{self.png}: every camera with the outlines that the others predict")
        if self.repair is not None:
            if check.agreement.agrees:
                print("nothing to repair")
            else:
                write_repair(check, recording, self.repair)
                print(
                    f"{self.repair}: repaired; copy its files into a copy of the recording, check"
                    " that, and fit it"
                )
        return 0 if check.agreement.agrees else 1


def print_check(check: Check) -> None:
    """Prints one line per camera, the faults and their remedies."""
    from voxelpose.calibration.check import check_findings, verdict_on

    rows = []
    for line in check.agreement.table:
        verdict = verdict_on(check, line.camera)
        if verdict == "does not agree":
            verdict = f"[red]{verdict}[/red]"
        errors = f"{line.error_px:.1f}", f"{line.others_px:.1f}"
        rows.append((plain(line.camera), *errors, str(line.planes), verdict))
    print_table(rows, "camera", "off by, px", "the others, px", "planes", "")
    console = rich_console(soft_wrap=True)
    for finding in check_findings(check):
        words, remedy = plain(finding.words), plain(finding.remedy)
        line = f"note: {words}" if finding.about == "note" else words
        console.print(f"[bold]{line}[/bold]\n  {remedy}" if remedy else line)


SUBCOMMANDS = {
    "board": CalibrateBoard,
    "intrinsics": CalibrateIntrinsics,
    "extrinsics": CalibrateExtrinsics,
    "convert": CalibrateConvert,
    "check": CalibrateCheck,
    "sync": CalibrateSync,
}
