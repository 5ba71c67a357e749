"""voxelpose calibrate board, and the arguments that describe a board."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from tyro.conf import arg

from calib.errors import InputError
from voxelpose.cli.arguments import (
    Dictionary,
    MarkerSide,
    OptionalLength,
    OverwriteFile,
    refuse_existing,
    two_numbers,
)

if TYPE_CHECKING:
    from calib.board import Board

_MAX_SQUARE_M = 2


@dataclass(frozen=True, kw_only=True)
class BoardArguments:
    """Arguments that describe a board."""

    board: Annotated[str, arg(metavar="COLUMNSxROWS")]
    """Number of inner corners, where four squares meet, along and down: one fewer than squares."""
    square: Annotated[float, arg(metavar="M")]
    """Side of a square in metres, measured on the print: 0.03 for 30 mm."""
    marker: MarkerSide = None
    dictionary: Dictionary = "DICT_4X4_50"

    def to_board(self) -> Board:
        """Returns the board.

        Raises:
            InputError: the arguments describe no board.
        """
        from calib.board import Board

        if self.square > _MAX_SQUARE_M:
            raise InputError(
                f"--square {self.square:g} are squares of {self.square:g} m: give metres,"
                f" {self.square / 1000:g} for millimetres"
            )
        return Board(*corner_counts(self.board), self.square, self.marker, self.dictionary)


def corner_counts(text: str) -> tuple[int, int]:
    """Reads the value of --board, such as 8x5."""
    return two_numbers(text, "--board", "inner corners along and down, as in 8x5")


@dataclass(frozen=True, kw_only=True)
class CalibrateBoard:
    """Arguments of `voxelpose calibrate board`."""

    help: ClassVar[str] = """Writes a calibration board to scale, as a PDF.

Print it at 100 % ("actual size"), measure the print, and glue it to something flat and stiff.

  voxelpose calibrate board --out board.pdf
  voxelpose calibrate board --board 8x5 --paper a3 --out board.pdf
  voxelpose calibrate board --board 8x5 --square 0.1 --paper large --charuco --out board.pdf
"""

    out: Annotated[Path, arg(metavar="FILE")]
    """PDF to be written."""
    paper: Literal["a4", "a3", "a2", "a1", "a0", "letter", "tabloid", "large"] = "a4"
    """Paper size; large: a page of the size of the board, for a print shop."""
    board: Annotated[str, arg(metavar="COLUMNSxROWS")] = "8x5"
    """Inner corners along and down; one even and one odd, so that the first corner is unique."""
    square: OptionalLength = None
    """Side of a square in metres. Default: as large as the paper allows."""
    charuco: bool = False
    """Put markers into the white squares: boards that are partly visible can then be used."""
    dictionary: Dictionary = "DICT_4X4_50"
    overwrite: OverwriteFile = False

    def run(self) -> int:
        """Writes the PDF and prints what to measure; returns the exit code."""
        from calib.board import Board
        from calib.board_sheet import largest_square_m, write_pdf

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
        if board.is_symmetric:
            print(
                "note: this board looks the same after half a turn: with one even and one odd"
                " number, its first corner is unique"
            )
        return 0
