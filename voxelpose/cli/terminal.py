"""Text for a terminal: what comes from files and names cannot control it."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from rich.console import Console

# Control characters but for tab and line feed, separators and those that reorder text.
_CONTROL = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028\u2029\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)
_LONGEST = 1000  # characters of a message


def visible(text: object) -> str:
    r"""Text in which control characters and what is no Unicode are written as \x1b, for example."""
    encoded = str(text).encode("utf-8", "backslashreplace").decode("utf-8")
    return _CONTROL.sub(lambda match: ascii(match[0])[1:-1], encoded)


def message(text: object) -> str:
    """A message as one visible line, cut where it is too long to be read."""
    line = visible(" ".join(str(text).split()))
    return line if len(line) <= _LONGEST else f"{line[:_LONGEST]} ... ({len(line)} characters)"


def plain(text: object) -> str:
    """Text from outside for rich, which would take [words in brackets] for its own markup."""
    from rich.markup import escape

    return escape(visible(text))


class VisibleStream:
    """Stream that writes text to another one, control characters made visible.

    Attributes:
        stream: the other stream, which does all the rest.
    """

    def __init__(self, stream: TextIO):
        """Wraps a stream."""
        self.stream = stream

    def write(self, text: str) -> int:
        """Writes text; returns its length."""
        self.stream.write(visible(text))
        return len(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def rich_console(stderr: bool = False, soft_wrap: bool = False) -> Console:
    """Console of rich on a standard stream, which writes its own control characters."""
    from rich.console import Console

    stream = sys.stderr if stderr else sys.stdout
    file = stream.stream if isinstance(stream, VisibleStream) else stream
    return Console(file=file, highlight=False, soft_wrap=soft_wrap)
