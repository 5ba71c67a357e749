"""Text, JSON, TOML, XML and CSV of bounded size and depth, whoever wrote the file.

The parsers raise what is in the file as an `InputError`: text that is none, numbers of thousands of
digits, nesting beyond any use, and XML that defines entities, which may expand without end.
"""

import csv
import json
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from calib.errors import InputError
from calib.storage.atomic import is_unfinished

LARGEST_CALIBRATION = 10_000_000
"""Bytes of a calibration; a hundred cameras take a hundredth of it."""
LARGEST_SETTINGS = LARGEST_CALIBRATION // 10
"""Bytes of a file of settings."""
_OTHER_SEPARATORS = {";": "semicolon", "\t": "tab"}
_COMMAS = "separate them by commas, and write numbers with a point, 412.5"
_DEEPEST = 50
_AS_UTF_8 = "give another file, or save it as UTF-8"
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
_BINARY = {
    **{bytes([128, protocol]): "a pickle" for protocol in range(2, 6)},
    b"MATLAB": "a MATLAB file",
    b"\x89HDF": "an HDF5 file",
    b"\x93NUMPY": "a NumPy array",
    b"PK\3\4": "a ZIP file, as .npz and .xlsx are",
}
_LONGEST_INTEGER = 300  # digits; more are no finite float64


def visible_entries(folder: Path) -> list[Path]:
    """Entries of a folder by name, but for hidden ones (a Mac puts ._NAME beside each file on
    other systems' disks) and folders that are not finished. None where there is no such folder.
    InputError where it cannot be listed.
    """
    try:
        entries = [path for path in folder.iterdir() if not path.name.startswith(".")]
        return sorted(path for path in entries if not is_unfinished(path.name))
    except (FileNotFoundError, NotADirectoryError):
        return []
    except OSError as error:
        raise InputError(f"{folder} cannot be read: {error.strerror or error}") from None


def load_bytes(path: Path, largest_bytes: int) -> bytes:
    """Content of a file. InputError where the file cannot be read, or is too large.

    Args:
        largest_bytes: Size beyond which the file is refused.
    """
    try:
        with path.open("rb") as file:
            data = file.read(largest_bytes + 1)
    except (OSError, ValueError) as error:  # a name may hold what no name can
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{path} cannot be read: {reason}") from None
    if len(data) > largest_bytes:
        raise _too_large(path, largest_bytes)
    return data


def load_text(
    path: Path,
    largest_bytes: int = LARGEST_CALIBRATION,
    errors: str = "strict",
    remedy: str = _AS_UTF_8,
) -> str:
    """Text of a file in UTF-8, with or without its mark, lines ended by a newline. InputError where
    the file cannot be read, is too large, or holds bytes that are no text.

    Args:
        largest_bytes: Size beyond which the file is refused.
        errors: "replace" puts a mark in the place of bytes that are no text.
        remedy: What to do about a file that is no text, for messages.
    """
    data = load_bytes(path, largest_bytes)
    _check_start(path, data, remedy)
    try:
        text = data.decode("utf-8-sig", errors)
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not a text file (byte {error.start} is no UTF-8): {remedy}"
        ) from None
    return text.replace("\r\n", "\n")


def parse_json(text: str, path: Path) -> Any:
    """Content of JSON, of a file that messages name; whole numbers that no float64 can hold become
    infinite. InputError where the text is no JSON, or nested too deeply.
    """
    try:
        content = json.loads(text, parse_int=_integer)
    except RecursionError:
        raise _too_deep(path) from None
    except ValueError as error:
        raise InputError(f"{path}: broken JSON: {error}; mend it or make it again") from None
    check_depth(content, path)
    return content


def parse_toml(text: str, path: Path) -> dict[str, Any]:
    """Content of TOML, of a file that messages name. InputError where the text is no TOML, or
    nested too deeply.
    """
    try:
        content = tomllib.loads(text)
    except RecursionError:
        raise _too_deep(path) from None
    except ValueError as error:
        words = str(error)[:200]  # a key may be as long as the file
        raise InputError(f"{path}: no valid TOML: {words}; mend it or make it again") from None
    check_depth(content, path)
    return content


def parse_xml(text: str, path: Path) -> ElementTree.Element:
    """Root element of XML, of a file that messages name. InputError where the text is no XML, is
    nested too deeply, or has a document type, with which entities are defined.
    """
    try:
        # A declaration of an encoding does not count in text that was decoded already.
        parser = ElementTree.XMLParser(target=_BoundedTree(path), encoding="utf-8")
        parser.feed(text.encode())
        return parser.close()
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: broken XML: {error}; mend it or make it again") from None


def _check_start(path: Path, data: bytes, remedy: str) -> None:
    """Checks that bytes do not begin like UTF-16, or like files of programs. InputError where they
    do.
    """
    if data[:2] in _UTF_16 or (len(data) > 3 and data[:4].count(0) == 2):  # with a mark or without
        raise InputError(f"{path} is text in UTF-16: save it as UTF-8")
    for start, kind in _BINARY.items():
        if data.startswith(start):
            raise InputError(f"{path} is {kind}, not text: {remedy}")


def csv_rows(
    path: Path, columns: Sequence[str], largest_bytes: int, optional: Sequence[str] = ()
) -> Iterator[dict[str, str]]:
    """Rows of a table in CSV, one after the other. InputError where the file cannot be read, is too
    large or no text, or lacks a column.

    Args:
        path: The file; its first line names the columns.
        columns: Those that are needed; the table may have others.
        largest_bytes: Size beyond which the file is refused.
        optional: Columns that are returned if there are any.

    Yields:
        The texts of these columns by name, as far as the row has them. Empty lines are left out.
    """
    names = (*columns, *optional)
    remedy = f"its first line must name {','.join(names)}"
    try:
        if path.stat().st_size > largest_bytes:
            raise _too_large(path, largest_bytes)
        with path.open("rb") as file:
            _check_start(path, file.read(16), f"give CSV: {remedy}")
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, skipinitialspace=True)
            header = reader.fieldnames or ()
            if missing := [name for name in columns if name not in header]:
                for sign, name in _OTHER_SEPARATORS.items():
                    if sum(sign in title for title in header) * 2 > len(header):
                        remedy = f"columns are separated by {name}s: {_COMMAS}"
                raise InputError(f"{path}: no column {', '.join(missing)}: {remedy}")
            for row in reader:
                if any(row.get(None) or ()):  # type: ignore[call-overload]
                    raise InputError(
                        f"{path} line {reader.line_num} has more columns than the first: {_COMMAS}"
                    )
                yield {name: row[name] for name in names if row.get(name) is not None}
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(
            f"{path} cannot be read as CSV: {error}: mend it (a stray quote?); {remedy}"
        ) from None


def check_depth(content: Any, path: Path) -> None:
    """Checks that lists and dictionaries are not nested too deeply for whatever follows. InputError
    where they are.
    """
    level = [content]
    for _ in range(_DEEPEST):
        level = [
            inner
            for outer in level
            if isinstance(outer, dict | list)
            for inner in (outer.values() if isinstance(outer, dict) else outer)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return
    raise _too_deep(path)


def _integer(digits: str) -> int | float:
    return int(digits) if len(digits) <= _LONGEST_INTEGER else float(digits)


def _too_large(path: Path, largest_bytes: int) -> InputError:
    return InputError(
        f"{path} is larger than the {largest_bytes / 1e6:,.0f} MB that such a file can have: give"
        " another file, or make it again"
    )


def _too_deep(path: Path) -> InputError:
    return InputError(
        f"{path}: nested more than {_DEEPEST} levels deep, as no such file is: make it again"
    )


class _BoundedTree(ElementTree.TreeBuilder):
    """Builds elements as long as they are not nested too deeply."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path, self._depth = path, 0

    def start(self, tag: str, attrs: Any, /) -> ElementTree.Element:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise _too_deep(self._path)
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ElementTree.Element:
        self._depth -= 1
        return super().end(tag)

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise InputError(
            f"{self._path}: has a document type (<!DOCTYPE {name}>), as no such file has: remove it"
        )
