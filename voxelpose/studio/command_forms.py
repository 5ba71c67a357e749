"""Commands as forms: their options in groups, as tables for the page, and commands made of what was
typed into it. They are named by their sections in a voxelpose.toml: fit, calibrate.board, ….
"""

import inspect
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any

from calib.board import Board
from calib.errors import InputError
from silhouette_core.body.presets import body_preset
from silhouette_core.setting_types import choices_of, range_of, types_if_given
from voxelpose.cli.arguments import BoardArguments
from voxelpose.cli.export import Export
from voxelpose.cli.options import (
    Option,
    checked_values,
    folder_settings,
    load_command,
    made_of,
    options_of,
)
from voxelpose.results import SETTINGS, load_settings, people_folders
from voxelpose.studio.projects import StudioFolder
from voxelpose.view.serving.page_words import field_title

# What the page decides by itself: where files lie, cameras, receivers, and the pages of `live`.
_NOT_IN_FORMS = set(
    "to out overwrite verbose intrinsics points source send loop record record_now duration page"
    " host port token browser".split()
)
_FILES = {"body", "library"}  # options whose value may name a file
_METRES = {"stature", "chest"}  # which many type in centimetres
# Options by what results call them.
_OPTIONS = {
    "stature_m": "stature",
    "chest_m": "chest",
    "cutoff_hz": "cutoff",
    "voxel_size_m": "voxel",
}
_INPUTS = {bool: "checkbox", int: "number", float: "number"}


def form_of(command: str, project: Path, result: Path | None = None) -> list[dict[str, Any]]:
    """Settings: `name`, `title`, `group`, `input` (checkbox, number, text, or choice with
    `choices`), the `least` and `most` of a number, whether it is in `metres`, `usual` value and the
    `value` by the files of a project, or that a result was made with, `help`.
    """
    kind = load_command(command)
    order = [*kind.groups, "expert"]
    values = {name: given for name, (given, _) in folder_settings(command, project).items()}
    if result is not None:
        values = _settings_of(result)
    rows = []
    for option in options_of(kind, _NOT_IN_FORMS).values():
        choices = choices_of(option.kind)
        value = values.get(option.name)
        rows.append(
            {
                "name": option.name,
                "title": field_title(option.name),
                "group": option.group,
                "input": "choice" if choices else _input_of(option),
                "least": range_of(option.kind)[0],
                "most": range_of(option.kind)[1],
                "metres": option.field in _METRES,
                "whole": types_if_given(option.kind) == (int,),
                "choices": choices,
                "usual": None if option.default is MISSING else option.default,
                "value": str(value) if isinstance(value, Path) else value,
                "help": option.help,
            }
        )
    return sorted(rows, key=lambda row: order.index(row["group"]))


def _settings_of(result: Path) -> dict[str, Any]:
    """What a result was made with, by the options' names."""
    settings = load_settings(people_folders(result)[0] / SETTINGS)
    tables = [settings.pop(name, {}) for name in ("conditioning", "options")]
    given = {name: value for table in (settings, *tables) for name, value in table.items()}
    for name, between in (("frames", ":"), ("cameras", ","), ("up", ",")):
        if name in given:
            given[name] = between.join(map(str, given[name]))
    given["camera"] = given.get("cameras")
    return {_OPTIONS.get(name, name).replace("_", "-"): value for name, value in given.items()}


def _input_of(option: Option) -> str:
    kind, *others = types_if_given(option.kind)
    return "text" if others else _INPUTS.get(kind, "text")


def filled_in(
    command: str,
    folder: StudioFolder,
    project: Path,
    fixed: Mapping[str, Any],
    given: Mapping[str, Any],
) -> Any:
    """A command that overwrites, of what files say and what is `given`, by options' names, None for
    the usual value, and of fields that are `fixed`; files that settings name are in the studio's
    folder. InputError where a value makes no sense.
    """
    kind = load_command(command)
    options, in_files = options_of(kind), folder_settings(command, project)
    values = {name: setting.value for name, setting in in_files.items() if name not in given}
    in_form = options_of(kind, _NOT_IN_FORMS)
    typed = {key: value for key, value in given.items() if value is not None or key not in in_form}
    values |= checked_values(in_form, typed, project, "")
    values = {options[name].field: value for name, value in values.items()}
    for field in _FILES & values.keys():
        value = str(values[field])
        if field == "library" or (values[field] is not None and body_preset(value) is None):
            path = folder.file_inside(project, str(given.get(field, value)))
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
        raise InputError(f"--{' and --'.join(missing)} must be known: fill that in")
    return made_of(kind, values)


@contextmanager
def errors_at_fields(command: str) -> Iterator[None]:
    """Errors that begin with a setting in words, as "a cut-off of", stand at its field."""
    try:
        yield
    except InputError as error:
        line = str(error).removeprefix("a ").replace("-", "")
        names = options_of(load_command(command))
        named = (name for name in names if line.startswith(f"{field_title(name)} "))
        error.field = error.field or next(named, "")
        raise


def board_in(project: Path) -> Board | None:
    """The board that the files of a project describe; None where they do not. InputError where
    there is no such board.
    """
    settings = folder_settings("calibrate.intrinsics", project)
    like = {field.name for field in fields(BoardArguments)}
    known = {name: settings[name].value for name in like & settings.keys()}
    return BoardArguments(**known).to_board() if {"board", "square"} <= known.keys() else None


def export_formats() -> dict[str, str]:
    """What `export` writes, by the names of the formats, as its help says."""
    return dict(re.findall(r"^  (\w+)  (.+)$", inspect.getdoc(Export) or "", re.MULTILINE))
