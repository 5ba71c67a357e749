"""Commands as forms: their options in groups, as tables for a page, and commands made of what was
typed into it.
"""

from __future__ import annotations

import ast
import inspect
import itertools
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, get_origin, get_type_hints

from calib.errors import InputError
from voxelpose.cli.arguments import BoardArguments
from voxelpose.cli.options import (
    Option,
    choices_of,
    folder_settings,
    load_command,
    made_of,
    options_of,
)

if TYPE_CHECKING:
    from calib.board import Board
    from silhouette_core.progress import Reporter
    from voxelpose.cli.fit import EstimationArguments
    from voxelpose.cli.live import Live
    from voxelpose.live.session import LiveSession
    from voxelpose.results import Result

# What the page decides by itself: where files lie, cameras, receivers, and the pages of `live`.
_NOT_IN_FORMS = set(
    "out overwrite verbose intrinsics points source send loop record record_now duration page host"
    " port token browser".split()
)
_FILES = {"body", "library"}  # options whose value may name a file
_INPUTS = {bool: "checkbox", int: "number", float: "number"}


class CalibrationCommand(Protocol):
    """A command that calibrates something, and writes it then."""

    def calibrate(self, reporter: Reporter, /) -> Any:
        """What is found. InputError where something is missing."""
        ...

    def write(self, result: Any, /) -> None:
        """Writes what was found. InputError where it is not good enough."""
        ...


def option_helps(command: type) -> dict[str, str]:
    """Help of a command's options by their fields."""
    helps: dict[str, str] = {}
    for kind in reversed(command.__mro__[:-1]):
        (body,) = ast.parse(textwrap.dedent(inspect.getsource(kind))).body
        statements = getattr(body, "body", [])
        for field, after in itertools.pairwise(statements):
            if isinstance(field, ast.AnnAssign) and isinstance(after, ast.Expr):
                helps[ast.unparse(field.target)] = ast.literal_eval(after.value)
    for field, hint in get_type_hints(command, include_extras=True).items():
        marks = getattr(hint, "__metadata__", ()) if get_origin(hint) is not None else ()
        for mark in marks:
            if text := getattr(mark, "help", None):
                helps.setdefault(field, text)
    return {field: " ".join(text.split()) for field, text in helps.items()}


class CommandForms:
    """Commands for the studio's page, by their sections; see `studio_commands.Commands`."""

    def form(self, command: str, project: Path) -> list[dict[str, Any]]:
        """Settings: `name`, `group`, `input` (checkbox, number, text, or choice with `choices`),
        `usual` value and the `value` by the files of a project, `help`.
        """
        kind = load_command(command)
        helps, values = option_helps(kind), folder_settings(command, project)
        group = {field: name for name, listed in kind.groups.items() for field in listed.split()}
        order = [*kind.groups, "expert"]
        rows = []
        for option in options_of(kind).values():
            if option.field in _NOT_IN_FORMS:
                continue
            choices = choices_of(option.kind)
            value = values[option.name].value if option.name in values else None
            usual = None if option.default is MISSING else option.default
            rows.append(
                {
                    "name": option.name,
                    "group": group.get(option.field, "expert"),
                    "input": "choice" if choices else _input_of(option),
                    "whole": option.kind in (int, int | None),
                    "choices": choices,
                    "usual": usual,
                    "value": str(value) if isinstance(value, Path) else value,
                    "help": helps.get(option.field, ""),
                }
            )
        return sorted(rows, key=lambda row: order.index(row["group"]))

    def command(
        self,
        command: str,
        project: Path,
        fixed: Mapping[str, Any],
        given: Mapping[str, Any],
        inside: Callable[[str], Path],
    ) -> Any:
        """A command that overwrites, of what files say and what is `given`, by options' names, None
        for the usual value, and of fields that are `fixed`; `inside` finds a file that a setting
        names. InputError where a value makes no sense.
        """
        kind = load_command(command)
        options = options_of(kind)
        in_files = folder_settings(command, project)
        values = {options[name].field: setting.value for name, setting in in_files.items()}
        for name, value in given.items():
            if name not in options or options[name].field in _NOT_IN_FORMS:
                raise InputError(f"{command} has no setting {name[:40]!r} on this page")
            option = options[name]
            values.pop(option.field, None)
            if value is not None:
                values[option.field] = option.value_from(value, project, "the page")
        for field in _FILES & values.keys():
            if isinstance(values[field], str | Path) and not _is_name(field, str(values[field])):
                path = inside(str(given.get(field, values[field])))
                values[field] = path if field == "library" else str(path)
        taken = {name: setting.file for name, setting in in_files.items() if name not in given}
        known = {"overwrite": True, "sources": taken, **fixed}
        names = {field.name for field in fields(kind)}
        values |= {name: value for name, value in known.items() if name in names}
        missing = [
            option.name
            for option in options.values()
            if option.default is MISSING and option.field not in values
        ]
        if missing:
            raise InputError(f"{' and '.join(missing)} must be known: fill in the field")
        return made_of(kind, values)

    def shares(self, command: EstimationArguments) -> Mapping[str, float] | None:
        """Shares of the time of a command's stages."""
        from voxelpose.cli.fit import SHARES

        return SHARES.get(command.asked().estimator)

    def work(self, command: str) -> Callable[[Reporter, Any], Any]:
        """Function that runs a command."""
        if command == "live":
            return prepare_session
        return run_calibration if command.startswith("calibrate.") else run_estimation

    def values(self, command: str, project: Path) -> Mapping[str, tuple[Any, str]]:
        """Settings of a command by the files of a project."""
        return folder_settings(command, project)

    def board(self, project: Path) -> Board | None:
        """The board that the files of a project describe; None where they do not. InputError where
        there is no such board.
        """
        settings = folder_settings("calibrate.intrinsics", project)
        like = {field.name for field in fields(BoardArguments)}
        known = {name: settings[name].value for name in like & settings.keys()}
        return BoardArguments(**known).to_board() if {"board", "square"} <= known.keys() else None

    def formats(self) -> dict[str, str]:
        """What `export` writes, by the names of the formats, as its help says."""
        from voxelpose.cli.export import Export

        return dict(re.findall(r"^  (\w+)  (.+)$", inspect.getdoc(Export) or "", re.MULTILINE))


def run_estimation(reporter: Reporter, command: EstimationArguments) -> Sequence[Result]:
    """Runs a command, without a word on the terminal; returns its results."""
    from voxelpose.compile_ahead import tell_first_run

    asked = command.asked()
    beside = tell_first_run(reporter, [asked.estimator])
    try:
        return command.estimate(reporter, asked)
    finally:
        if beside is not None:
            beside.terminate()
            beside.wait()


def run_calibration(reporter: Reporter, command: CalibrationCommand) -> Any:
    """Runs a command, without a word on the terminal; returns what it found, which is written."""
    result = command.calibrate(reporter)
    command.write(result)
    return result


def prepare_session(reporter: Reporter, command: Live) -> LiveSession:
    """The session of a command, whose cameras are not running yet."""
    return command.prepare(reporter)


def _input_of(option: Option) -> str:
    kinds = getattr(option.kind, "__args__", (option.kind,))
    return next((_INPUTS[kind] for kind in kinds if kind in _INPUTS), "text")


def _is_name(field: str, value: str) -> bool:
    """Whether a value is a name that the program knows, and no file's."""
    if field == "library":
        return False
    from silhouette_core.body.presets import body_preset

    return body_preset(value) is not None
