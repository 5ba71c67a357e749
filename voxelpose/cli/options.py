"""Options of a command: names and types, and their values from voxelpose.toml of a recording, the
folders above, the user.
"""

import importlib
import os
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, make_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

from calib.errors import InputError, check_name
from calib.storage.documents import LARGEST_SETTINGS, load_text, parse_toml
from silhouette_core.setting_types import checked, nearest, range_of, types_if_given, unmarked

_LOCATED = "body", "source"  # text that may name a file
# Commands that stand above this folder, since they run others.
_ABOVE = {
    "batch": "voxelpose.batch.batch_command",
    "setup": "voxelpose.setup_page.setup_command",
    "studio": "voxelpose.studio.studio_command",
}


@dataclass(frozen=True)
class Option:
    """An option of a command."""

    name: str  # as on the command line, without the dashes before it
    field: str  # its field of the command's class
    kind: Any  # its type, with its marks
    default: Any  # value where none is given; `dataclasses.MISSING` where one must be
    appended: bool  # whether it may be given several times, each time with one more value
    help: str  # as on the command line
    group: str  # of the command's `groups`, else "expert"

    def value_from(self, given: object, folder: Path, where: str) -> Any:
        """The value that a file gives; paths in it are relative to its folder. InputError where the
        value is none of this option; `where` names file and section.
        """

        def path_from(kind: type, text: Any) -> Path:
            if kind is not Path or not isinstance(text, str):
                raise NotImplementedError
            check_name(text)
            return folder / os.path.expanduser(text)  # noqa: PTH111, pathlib's raises

        named = f"{where}: {self.name}" if where else f"--{self.name}"
        value = checked(given, self.kind, named, path_from)
        check_name(value)
        if self.name not in _LOCATED:
            return value
        return (
            tuple(_path_below(text, folder) for text in value)
            if isinstance(value, tuple)
            else _path_below(value, folder)
        )


def options_of(command: type, without: Container[str] = ()) -> dict[str, Option]:
    """Options of a command's class by their names, but for some fields, and arguments that have no
    names.
    """
    from tyro.conf import Positional, Suppress, UseAppendAction

    hints = get_type_hints(command, include_extras=True)
    groups = getattr(command, "groups", {})
    group = {field: name for name, listed in groups.items() for field in listed.split()}
    texts = _attribute_texts(command)
    options = {}
    for field in fields(command):
        _, *marks = unmarked(hints[field.name])
        if Positional not in marks and Suppress not in marks and field.name not in without:
            text = next((mark.help for mark in marks if getattr(mark, "help", None)), "")
            name = field.name.replace("_", "-")
            options[name] = Option(
                name,
                field.name,
                hints[field.name],
                field.default,
                UseAppendAction in marks,
                " ".join(texts.get(field.name, text).split()),
                group.get(field.name, "expert"),
            )
    return options


@cache
def _attribute_texts(command: type) -> dict[str, str]:
    """The docstrings of a class's fields, as tyro reads them."""
    from docstring_parser import parse_from_object

    classes = reversed(command.__mro__[:-1])
    parameters = [each for kind in classes for each in parse_from_object(kind).params]
    return {each.arg_name: each.description for each in parameters if each.description}


def folder_of(command: Any) -> Path:
    """The folder that a command's instance works on: its nameless argument, else this one."""
    named = {option.field for option in options_of(type(command)).values()}
    for field in fields(command):
        value = getattr(command, field.name)
        if isinstance(value, tuple) and len(value) == 1:
            value = value[0]
        if field.name not in named and isinstance(value, Path):
            return value.parent if value.is_file() else value
    return Path()


def _path_below(text: str, folder: Path) -> str:
    """A path that is relative to a folder, also after NAME=; what is no path stays."""
    name, equals, last = text.rpartition("=")
    path = folder / os.path.expanduser(last)  # noqa: PTH111
    exists = last and not last.isdigit() and os.path.exists(path)  # noqa: PTH110
    return f"{name}{equals}{path}" if exists else text


class FolderSetting(NamedTuple):
    """A value of an option's type, and the voxelpose.toml that it is from; paths are absolute."""

    value: Any
    file: str


def commands_of(name: str) -> dict[str, Any]:
    """Classes of a command by their sections in a voxelpose.toml: `fit`, `calibrate.board`, ….

    They are listed in its module's SUBCOMMANDS, or one has the module's name or that in COMMAND.
    """
    module = importlib.import_module(_ABOVE.get(name, f"voxelpose.cli.{name.replace('-', '_')}"))
    if hasattr(module, "SUBCOMMANDS"):
        return {f"{name}.{word}": command for word, command in module.SUBCOMMANDS.items()}
    return {name: getattr(module, getattr(module, "COMMAND", name.title().replace("-", "")))}


def load_command(section: str) -> Any:
    """The class of a command by its section."""
    return commands_of(section.partition(".")[0])[section]


def folder_settings(section: str, folder: Path) -> dict[str, FolderSetting]:
    """What files say about a command's options, by their names, for the folder that it works on;
    the nearest file counts. InputError where a file cannot be read, or has an unknown section,
    option or value.
    """
    from voxelpose.recording.subject import nearest_settings

    options = options_of(load_command(section))

    def read(file: Path) -> dict[str, Any]:
        given = _sections(file).get(section, {})
        return checked_values(options, given, file.parent, f"{file}: [{section}]")

    settings = nearest_settings(folder, read).items()
    return {name: FolderSetting(value, str(file)) for name, (value, file) in settings}


def checked_values(
    options: Mapping[str, Option], given: Mapping[str, Any], folder: Path, where: str
) -> dict[str, Any]:
    """Values of options by their names, of those that are given, in which - may be _, and paths are
    relative to a folder. InputError, which begins with `where`, where one is not understood; "": of
    a page.
    """
    values = {}
    for key, value in given.items():
        name = key.replace("_", "-")
        if name not in options:
            suggestion = nearest(name, options) or f": there are {', '.join(options)}"
            raise InputError(f"{where or 'the page'} has no setting {key[:40]!r}{suggestion}")
        values[name] = options[name].value_from(value, folder, where)
    return values


def sections_in(folder: Path) -> list[str]:
    """Sections of the files that hold settings for a folder. InputError where a file cannot be
    read, or has an unknown section.
    """
    from voxelpose.recording.subject import settings_files

    return list(dict.fromkeys(name for file in settings_files(folder) for name in _sections(file)))


def parse_with_settings(
    section: str, words: Sequence[str], program: str
) -> tuple[Any, dict[str, FolderSetting]]:
    """A command with its arguments, those of files where the command line gives none, and what was
    taken from files. The program's name is for messages. InputError where a file cannot be read, or
    has an unknown section, option or value, or a number is out of its option's range; SystemExit
    where the arguments are wrong (code 2), or help was requested (code 0).
    """
    import tyro

    command = load_command(section)

    def parsed(values: Mapping[str, Any] | None) -> Any:
        default = None if values is None else made_of(command, values)
        names_alone = (tyro.conf.OmitArgPrefixes,)  # of an option, without its group's
        return tyro.cli(
            command, prog=program, description="", args=words, default=default, config=names_alone
        )

    if not {"-h", "--help"}.isdisjoint(words):
        command = _with_groups(command)
        return parsed(None), {}
    options = options_of(command)
    # First for the folder alone: what is missing may be in its files.
    blanks = {
        o.field: types_if_given(o.kind)[0]() for o in options.values() if o.default is MISSING
    }
    typed = parsed(blanks)
    settings = folder_settings(section, folder_of(typed))
    for option in options.values():
        if option.appended and getattr(typed, option.field):
            settings.pop(option.name, None)  # the values would be added to the file's
    given = {options[name].field: setting.value for name, setting in settings.items()}
    done = parsed(given or None)
    for option in options.values():
        if range_of(option.kind) != (None, None):
            checked(getattr(done, option.field), option.kind, f"--{option.name}")
    taken = {
        name: setting
        for name, setting in settings.items()
        if getattr(done, options[name].field) == setting.value
    }
    if "sources" in {field.name for field in fields(command)}:
        done = replace(done, sources={name: setting.file for name, setting in taken.items()})
    return done, taken


def _with_groups(command: Any) -> Any:
    """A class of a command's groups of options, which help shows in a box each, or the command."""
    if not hasattr(command, "groups"):
        return command
    rest = {field.name: field for field in fields(command)}
    groups = []
    for name, listed in {**command.groups, "expert": " ".join(rest)}.items():
        # A subclass of fewer fields, since tyro finds their docstrings in its parents.
        members = {word: rest.pop(word) for word in listed.split() if word in rest}
        group = type(name, (command,), {"__dataclass_fields__": members})
        groups.append((name, group))
    return make_dataclass(command.__name__, groups)


def made_of(command: Any, values: Mapping[str, Any]) -> Any:
    """An instance of a command's class, by its fields, whose other values are the usual ones, or
    missing.
    """
    import tyro

    missing = {
        field.name: tyro.MISSING
        for field in fields(command)
        if field.default is MISSING and field.default_factory is MISSING
    }
    return command(**(missing | dict(values)))


def _sections(file: Path) -> dict[str, dict[str, Any]]:
    """The tables of a file, by their sections: `fit`, `calibrate.board`."""
    from voxelpose.cli import COMMANDS

    content = parse_toml(load_text(file, LARGEST_SETTINGS), file)
    _check_sections(content, COMMANDS, file)
    sections = {}
    for name, table in content.items():
        commands = commands_of(name)
        if name in commands:
            sections[name] = table
            continue
        _check_sections(table, [known.partition(".")[2] for known in commands], file, f"{name}.")
        sections |= {f"{name}.{word}": inner for word, inner in table.items()}
    return sections


def _check_sections(
    content: Mapping[str, Any], known: Iterable[str], file: Path, before: str = ""
) -> None:
    for name, table in content.items():
        section = f"[{before}{name[:40]}]"
        if name not in known:
            suggestion = nearest(name, known) or f": the sections are {', '.join(known)}"
            raise InputError(f"{file}: there is no section {section}{suggestion}")
        if not isinstance(table, dict):
            raise InputError(
                f"{file}: {before}{name} must be a section: write {section}, and each setting on a"
                " line below"
            )
