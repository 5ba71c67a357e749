"""Arguments that several commands share, and the checks and readers of their values."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional, arg

from calib.errors import InputError
from silhouette_core import setting_types

if TYPE_CHECKING:
    from calib.board import Board
    from voxelpose.view.serving.gate import Address, GatedServer

_MAX_SQUARE_M = 2
GROUPS = {
    "basic": "recording folder out overwrite stature people frames camera source record",
    "person": "chest body sex persons start outline_only",
    "camera": "cameras unit fps label up background network loop",
    "output": "smooth filter cutoff filter_order gap_limit gap_method pictures verbose send"
    " record_now private page host port token browser",
}
"""Fields of `fit`, `track` and `live` by the group in which help shows them; others are expert."""
CALIBRATION_GROUPS = {
    "basic": "pictures recording out overwrite board square paper charuco model by floor intrinsics"
    " points",
    "camera": "cameras unit label rates reference",
}
"""Those of `calibrate board`, `intrinsics`, `extrinsics` and `sync`."""


def optional(metavar: str, words: str | None = None) -> Any:
    """Marks an option whose value, where none is given, is not shown in its help."""
    return arg(metavar=metavar, help=words, help_behavior_hint="")


RecordingFolder = Annotated[
    Positional[Path], arg(metavar="RECORDING", help="Folder of the recording.")
]
OptionalFile = Annotated[Path | None, optional("FILE")]
OptionalLength = Annotated[float | None, optional("M")]
OptionalName = Annotated[str | None, optional("NAME")]
Sex = Annotated[setting_types.Sex, arg(help="Sex, for the body's proportions.")]
BodyName = Annotated[
    str | None,
    optional(
        "BODY",
        "The person's body, kept as it is: a name of `voxelpose body list`, a body.toml, an"
        " earlier result of the same person, or a rig. Default: found in the pictures.",
    ),
]
Frames = Annotated[
    str | None, optional("A:B", "First frame and one past the last, as in 0:100. Default: all.")
]
Cameras = Annotated[str | None, optional("NAME,NAME", "Names of the cameras to use. Default: all.")]
Unit = Annotated[
    Literal["m", "cm", "mm"] | None,
    optional("m|cm|mm", "Unit of the calibration's lengths, where the file does not state it."),
]
Label = Annotated[
    str | None,
    optional(
        "N,N",
        "Labels of the person in masks/, numbers or colours as rrggbb; 0: where it is black."
        " Default: found.",
    ),
]
Fps = Annotated[
    float | None,
    optional("N", "Frames per second, where the files do not state it or state it wrongly."),
]
Threads = Annotated[
    setting_types.Threads | None, optional("N", "Number of processor threads. Default: all.")
]
MarkerSide = Annotated[
    float | None,
    optional(
        "M", "Side of a marker in metres, for a ChArUco board. Default: a plain checkerboard."
    ),
]
Dictionary = Annotated[
    str, arg(metavar="NAME", help="OpenCV's name of the markers of a ChArUco board.")
]
OverwriteFile = Annotated[bool, arg(help="Replace existing files.")]
OverwriteResult = Annotated[
    bool, arg(help="Replace an earlier result in OUT, once the new one is complete.")
]


@dataclass(frozen=True, kw_only=True)
class PosingArguments:
    """Arguments of the commands that look for a person in pictures."""

    stature: Annotated[setting_types.Stature | None, optional("M")] = None
    """Height in metres. Default: from subject.toml, else estimated, or 1.70 with one camera."""
    chest: Annotated[setting_types.Chest | None, optional("M")] = None
    """Chest girth in metres. Default: from subject.toml, else average for the stature."""
    sex: Sex = "unknown"
    unit: Unit = None
    fps: Fps = None
    label: Label = None
    up: Annotated[str | None, optional("AXIS")] = None
    """Direction of up in the calibration's world: an axis (z, -z, y ...) or three numbers
    (0,0.1,-1). Default: [metadata] up of the calibration, else found."""
    network: setting_types.NetworkUse = "auto"
    """Pose network as evidence beside the silhouettes, where `voxelpose network install` has put
    one."""
    backend: Annotated[str, arg(metavar="NAME")] = "cpu"
    """Implementation of pose scoring; `voxelpose doctor` lists those that are installed."""


@dataclass(frozen=True, kw_only=True)
class PageArguments:
    """Arguments of the commands that serve a page."""

    host: Annotated[str, arg(metavar="NAME")] = "localhost"
    """Address at which the page is served; any but this machine's own needs --token."""
    port: Annotated[int, arg(metavar="N")] = 8080
    """Port of the page; the next free one if it is taken."""
    token: Annotated[str | None, optional("TEXT")] = None
    """Word without which the page is not shown; part of the address that is printed."""
    browser: bool = True
    """Open the page; --no-browser only prints its address."""

    def address(self) -> Address:
        """Where the page is served, and to whom; to be asked for before the work. InputError where
        that cannot be.
        """
        from voxelpose.view.serving.gate import Address

        return Address(self.host, self.port, self.token)

    def serve(self, title: str, page: GatedServer) -> None:
        """Prints a page's address, opens it, and runs it until Ctrl-C."""
        try:
            print(f"{title}: {page.url} (Ctrl-C ends it)", flush=True)
            self.open_page(page.url)
            page.run()
        except KeyboardInterrupt:
            pass
        finally:
            page.close()

    def open_page(self, url: str) -> None:
        """Opens a page in the browser, unless that is not wanted."""
        if self.browser:
            import webbrowser

            webbrowser.open(url)


def up_direction(text: str | None, setting: str = "--up={}") -> tuple[float, float, float] | None:
    """The direction of up that a text names, as a unit vector; InputError where it is neither an
    axis nor three numbers.
    """
    if text is None:
        return None
    from calib.upright import direction_of

    return tuple(direction_of(text, setting).tolist())


def camera_names(text: str | None) -> tuple[str, ...] | None:
    """The names in a text, between commas; InputError where there is none."""
    if text is None:
        return None
    names = tuple(name.strip() for name in text.split(",") if name.strip())
    if not names:
        raise InputError(
            "--cameras names none: give names with commas between them, as in cam_1,cam_3"
        )
    return names


ESTIMATORS = {"learned": "monocular", "paper": "tree"}
"""Estimators of one camera, by the values of `Method`."""
Method = Annotated[
    Literal["learned", "paper"],
    arg(
        help="What the poses of one camera come from: the network's proposals, refined over the"
        " take, or the filter over a tree of silhouettes of Okada and Stenger, alone, with the"
        " nearest of their 24 bodies."
    ),
]


def unusual(command: Any, named: Mapping[str, str]) -> dict[str, bool | int | float | str]:
    """Options of an estimator by their names, from a command's fields that are `named`, without the
    usual ones, so that an estimator refuses no more than what was asked for.
    """
    given = {name: getattr(command, field) for name, field in named.items()}
    return {
        name: str(value) if isinstance(value, Path) else value
        for name, value in given.items()
        if value != getattr(type(command), named[name])
    }


def two_numbers(text: str, option: str, meaning: str, between: str = "x") -> tuple[int, int]:
    """Reads 8x5; InputError, with the `meaning` and an example, where there are not two numbers."""
    first, _, second = text.lower().partition(between)
    try:
        return int(first), int(second)
    except ValueError:
        raise InputError(f"{option} {text} is not understood: give {meaning}") from None


def refuse_existing(paths: Iterable[Path | None], overwrite: bool, option: str = "--out") -> None:
    """Checks before any work that output files, or None, which an option names, can be written:
    InputError where one must not be replaced, or its folder does not exist.
    """
    for path in paths:
        if path is not None and path.exists() and not overwrite:
            raise InputError(
                f"{path} exists: give {option} another name, or add --overwrite to replace it"
            )
        if path is not None and not path.parent.is_dir():
            raise InputError(
                f"{path} cannot be written: there is no folder {path.parent}: make it, or give"
                f" {option} another name"
            )


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
        """Returns the board; InputError where the arguments describe none."""
        from calib.board import Board

        if self.square > _MAX_SQUARE_M:
            raise InputError(
                f"--square {self.square:g} are squares of {self.square:g} m: give metres,"
                f" {self.square / 1000:g} for millimetres"
            )
        return Board(*corner_counts(self.board), self.square, self.marker, self.dictionary)


@dataclass(frozen=True, kw_only=True)
class OptionalBoard:
    """Arguments that describe a board, where there is one."""

    board: Annotated[str | None, optional("COLUMNSxROWS")] = None
    """Number of inner corners of the board, where four squares meet, along and down."""
    square: OptionalLength = None
    """Side of a square in metres, measured on the print; `sync` needs it with --marker alone."""
    marker: MarkerSide = None
    dictionary: Dictionary = "DICT_4X4_50"

    def to_board(self, square: float | None = None) -> Board | None:
        """The board, of a `square` where none is given; None without --board. InputError where the
        arguments describe none.
        """
        side = square if self.square is None else self.square
        if self.board is None or side is None:
            return None
        return BoardArguments(
            board=self.board, square=side, marker=self.marker, dictionary=self.dictionary
        ).to_board()


def corner_counts(text: str) -> tuple[int, int]:
    """Reads the value of --board, such as 8x5."""
    return two_numbers(text, "--board", "inner corners along and down, as in 8x5")
