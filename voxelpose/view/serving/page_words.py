"""Sentences of the command line as a page says them: options by the names of their fields, commands
by the steps that do their work, and no documents, which nobody can open there.
"""

import re
from typing import Any

_COMMAND = re.compile(r"`voxelpose ((?:(?:calibrate|body|library|network) )?[a-z]+)[^`]*`")
_CODE = re.compile(r"`([^`]+?) --[^`]*`")
_OPTION = re.compile(r"(?<![\w-])--(no-)?([a-z][a-z0-9-]*[a-z0-9])(=(?=\S))?")
_ELSEWHERE = re.compile(r"\s*\((?:see )?(?:docs/\S+|its\s--help)\)")
_STEPS = {
    "fit": "Estimate",
    "track": "Estimate with one camera",
    "view": "View",
    "report": "Export",
    "export": "Export",
    "setup": "Check",
    "calibrate board": "Calibrate, part 1",
    "calibrate intrinsics": "Calibrate, part 2",
    "calibrate extrinsics": "Calibrate, part 3",
    "calibrate sync": "Calibrate, part 4",
    "calibrate check": "Check",
}
# Keys of what a page is sent under which there are sentences.
_SENTENCES = set(
    "error fault formats help lines note notes refused said text verdict words".split()
)


def page_words(line: str) -> str:
    """A sentence of the command line, as of an error or of an option's help, for a page; fields
    are in backticks, by the names that `field_title` gives them.
    """
    line = _COMMAND.sub(lambda match: _STEPS.get(match[1], f"the command {match[1]}"), line)
    line = _CODE.sub(r"`\1`", _ELSEWHERE.sub("", line))
    return _OPTION.sub(
        lambda match: f"`{field_title(match[2])}`{' off' * bool(match[1])}{' ' * bool(match[3])}",
        line,
    )


def field_title(option: str) -> str:
    """Name of an option's field."""
    return option.replace("-", " ")


def field_at_fault(line: str) -> str:
    """The option that an error's line names first, whose field is to be corrected; "": none."""
    match = _OPTION.search(_CODE.sub("", _COMMAND.sub("", line)))
    return match[2] if match else ""


def in_page_words(content: Any) -> Any:
    """What a page is sent, with its sentences in `page_words`; all else is as it was."""
    match content:
        case dict():
            return {
                name: _sentence(value) if name in _SENTENCES else in_page_words(value)
                for name, value in content.items()
            }
        case [dict(), *_]:
            return [in_page_words(each) for each in content]
    return content


def _sentence(value: Any) -> Any:
    match value:
        case str():
            return page_words(value)
        case [str(), *_]:
            return [_sentence(each) for each in value]
        case dict():
            return {name: _sentence(each) for name, each in value.items()}
    return in_page_words(value)
