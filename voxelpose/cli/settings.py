"""voxelpose settings."""

import json
from dataclasses import MISSING, dataclass
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import Positional

from calib.errors import InputError
from silhouette_core.setting_types import nearest
from voxelpose.cli import arguments, options

COMMAND = "ShowSettings"
_OF_THE_SUBJECT = {"stature": "stature_m", "chest": "chest_girth_m", "sex": "sex", "body": "body"}
_WITH_SUBJECT = "fit", "track", "live"


@dataclass(frozen=True)
class ShowSettings:
    """Shows the value of every setting, and where it comes from.

    Every option of every command can be set in files called voxelpose.toml: in the recording, in
    the folders above it, and in the user's configuration folder. The nearest counts, and the
    command line before all. Paths are relative to the file. Values of subject.toml are shown, too.

      voxelpose settings walk
      voxelpose settings walk --command track
      voxelpose settings --command "calibrate board" --json

    A voxelpose.toml has a section for each command, with the names of its options:
      [fit]
      stature = 1.75
      smooth = false
      [calibrate.board]
      paper = "a3"
    """

    recording: Annotated[Positional[Path | None], arguments.optional("RECORDING")] = None
    """Folder of the recording. Default: the current folder."""
    command: Annotated[str | None, arguments.optional("COMMAND")] = None
    """Command whose settings are shown. Default: fit, and those that the files have sections of."""
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> None:
        """Prints the settings."""
        from voxelpose.results import as_json

        folder = self.recording or Path()
        if not folder.is_dir():
            raise InputError(f"there is no folder {folder}: give a recording, or no folder")
        sections = dict.fromkeys(["fit", *options.sections_in(folder)])
        if self.command is not None:
            sections = [_section(self.command)]
        tables = {section: _values(section, folder) for section in sections}
        if self.json:
            print(as_json(tables), end="")
        else:
            _print_tables(tables)


def _section(command: str) -> str:
    section = ".".join(command.replace(".", " ").split())
    sections = all_sections()
    if section not in sections:
        suggestion = nearest(section, sections) or f": there are {', '.join(sections)}"
        raise InputError(f"--command {command}: there is no such command{suggestion}")
    return section


def all_sections() -> list[str]:
    """Sections that a voxelpose.toml may have: one of every command and subcommand."""
    from voxelpose.cli import COMMANDS

    return [section for name in COMMANDS for section in options.commands_of(name)]


def _values(section: str, folder: Path) -> dict[str, dict[str, Any]]:
    """Value and source of every option, by name."""
    import msgspec

    in_files = options.folder_settings(section, folder)
    known = _subject_values(folder) if section in _WITH_SUBJECT else {}
    values = {}
    for name, option in options.options_of(options.load_command(section)).items():
        if name in in_files:
            value, source = in_files[name]
        elif name in known:
            value, source = known[name], str(folder / "subject.toml")
        elif option.default is MISSING:
            value, source = None, "to be given"
        else:
            value, source = option.default, "default"
        values[name] = {"value": msgspec.to_builtins(value, enc_hook=str), "from": source}
    return values


def _subject_values(folder: Path) -> dict[str, Any]:
    """What subject.toml of a recording says, by the names of the options."""
    from voxelpose.recording.subject import Subject, read_subject

    subject, unknown = read_subject(folder / "subject.toml"), Subject()
    return {
        name: getattr(subject, field)
        for name, field in _OF_THE_SUBJECT.items()
        if getattr(subject, field) != getattr(unknown, field)
    }


def _print_tables(tables: dict[str, dict[str, dict[str, Any]]]) -> None:
    for section, values in tables.items():
        rows = []
        for name, entry in values.items():
            value = entry["value"]
            text = "-" if value is None else json.dumps(value, ensure_ascii=False)
            rows.append((name, text, entry["from"]))
        wide = [max(map(len, column)) for column in zip(*rows, strict=True)] if rows else []
        print(f"[{section}]")
        for name, text, source in rows:
            print(f"  {name:<{wide[0]}}  {text:<{wide[1]}}  {source}")
