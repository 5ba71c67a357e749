"""Options of a command: names and types, and their values from files."""

import difflib
import os
import types
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from calib.errors import InputError, check_name

_LOCATED = "body", "segmenter", "source"  # text that may name a file
_WORDS = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path, as text",
}


@dataclass(frozen=True)
class Option:
    """An option of a command.

    Attributes:
        name: as on the command line, without the dashes before it.
        field: its field of the command's class.
        kind: type of the value.
        default: value where none is given; `dataclasses.MISSING` where one must be.
        appended: whether it may be given several times, each time with one more value.
    """

    name: str
    field: str
    kind: Any
    default: Any
    appended: bool

    def value_from(self, given: object, folder: Path, where: str) -> Any:
        """The value that a file gives.

        Args:
            given: as read from the file.
            folder: the file's folder, to which paths are relative.
            where: the file and its section, for messages.

        Raises:
            InputError: the value is none of this option.
        """
        import msgspec

        def path_from(kind: type, text: Any) -> Path:
            if kind is not Path or not isinstance(text, str):
                raise NotImplementedError
            check_name(text)
            return folder / os.path.expanduser(text)  # noqa: PTH111, pathlib's raises

        try:
            value = msgspec.convert(given, self.kind, dec_hook=path_from)
        except (msgspec.ValidationError, NotImplementedError, OverflowError):
            near = nearest(str(given), _choices(self.kind))
            raise InputError(
                f"{where}: {self.name} = {str(given)[:60]!r} must be {_wanted(self.kind)}{near}"
            ) from None
        check_name(value)
        if self.name not in _LOCATED:
            return value
        return (
            tuple(_located(text, folder) for text in value)
            if isinstance(value, tuple)
            else _located(value, folder)
        )


def options_of(command: type) -> dict[str, Option]:
    """Options of a command's class by their names, without arguments that have none."""
    from tyro.conf import Positional, Suppress, UseAppendAction

    marked = get_type_hints(command, include_extras=True)
    kinds = get_type_hints(command)
    options = {}
    for field in fields(command):
        hint = marked[field.name]
        marks = hint.__metadata__ if get_origin(hint) is Annotated else ()
        if Positional not in marks and Suppress not in marks:
            name = field.name.replace("_", "-")
            appended = UseAppendAction in marks
            options[name] = Option(name, field.name, kinds[field.name], field.default, appended)
    return options


def folder_of(command: Any) -> Path:
    """The folder that a command's instance works on: its argument without a name, else the
    current folder.
    """
    named = {option.field for option in options_of(type(command)).values()}
    for field in fields(command):
        value = getattr(command, field.name)
        if isinstance(value, tuple) and len(value) == 1:
            value = value[0]
        if field.name not in named and isinstance(value, Path):
            return value.parent if value.is_file() else value
    return Path()


def nearest(word: str, names: Iterable[str]) -> str:
    """`: did you mean NAME?` where a name is like a word, else nothing."""
    close = difflib.get_close_matches(word, list(names), 1)
    return f": did you mean {close[0]}?" if close else ""


def _inner(kind: Any) -> Any:
    """The type of a value that may be None, or the same type."""
    if get_origin(kind) in (Union, types.UnionType):
        return next(part for part in get_args(kind) if part is not types.NoneType)
    return kind


def _choices(kind: Any) -> tuple[str, ...]:
    return get_args(_inner(kind)) if get_origin(_inner(kind)) is Literal else ()


def _wanted(kind: Any) -> str:
    kind = _inner(kind)
    if choices := _choices(kind):
        return f"one of {', '.join(choices)}"
    if get_origin(kind) is tuple:
        first, *others = get_args(kind)
        if others == [...]:
            return f"a list in brackets, of which each is {_wanted(first)}"
        return f"a list of {len(others) + 1} numbers in brackets"
    return _WORDS[kind]


def _located(text: str, folder: Path) -> str:
    """A path that is relative to a folder, also after NAME=; what is no path stays."""
    name, equals, last = text.rpartition("=")
    path = folder / os.path.expanduser(last)  # noqa: PTH111
    there = last and not last.isdigit() and os.path.exists(path)  # noqa: PTH110
    return f"{name}{equals}{path}" if there else text
