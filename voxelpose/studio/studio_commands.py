"""What the page needs of the program's commands."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Protocol

from msgspec import Meta

from calib.board import Board
from silhouette_core.progress import Reporter
from voxelpose.setup_page.setup_session import SettingValues
from voxelpose.view.serving.page_answers import Name

Typed = dict[Name, bool | int | float | Annotated[str, Meta(max_length=1000)] | None]
"""Settings as they are typed in, by their names; None: the usual value."""


class Commands(Protocol):
    """The program's commands as the command line knows them, which stands above the page, by their
    sections in a voxelpose.toml: fit, track, calibrate.board, ….
    """

    def form(self, command: str, project: Path) -> list[dict[str, Any]]:
        """Settings in their groups, with their values by the files of a project."""
        ...

    def command(
        self,
        command: str,
        project: Path,
        fixed: Mapping[str, Any],
        given: Mapping[str, Any],
        inside: Callable[[str], Path],
    ) -> Any:
        """A command that overwrites, of what files say, what is `given`, where None is the usual
        value, and fields that are `fixed`; `inside` finds a file that a setting names. InputError
        where a value makes no sense.
        """
        ...

    def shares(self, command: Any) -> Mapping[str, float] | None:
        """Shares of the time of the stages of an estimation."""
        ...

    def work(self, command: str) -> Callable[[Reporter, Any], Any]:
        """Function of a module that runs a command and returns what it found: of an estimation the
        results, of a calibration what its `calibrate` says, of `live` the session.
        """
        ...

    def values(self, command: str, project: Path) -> SettingValues:
        """Settings of a command by the files of a project."""
        ...

    def board(self, project: Path) -> Board | None:
        """The board that the files of a project describe; None where they do not. InputError where
        there is no such board.
        """
        ...

    def formats(self) -> dict[str, str]:
        """What is written, by the names of the formats."""
        ...
