"""OpenCV's FileStorage in its three syntaxes, read without OpenCV.

OpenCV's own reader does not survive a damaged file: negative rows, sizes beyond memory and deep
nesting end the process. Libraries parse the syntax here, and every value is checked before an array
is made. The dialect: YAML begins with `%YAML:1.0`; a matrix is a map with rows, cols, dt and data
(`!!opencv-matrix` in YAML, `type_id="opencv-matrix"` in XML and JSON), its data listed or in
base64; XML has `<_>` or spaces between the items of a list; `.Nan` and `-.Inf` are numbers.
"""

import base64
import binascii
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from calib.files.fields import brief
from calib.storage.documents import load_text, parse_json, parse_xml

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_SPECIAL = re.compile(r"([-+]?)\.(nan|inf)", re.IGNORECASE)
_HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,8}")
_XML_ITEM = re.compile(r'"([^"]*)"|(\S+)')
_QUOTE = "\ue000"  # stands for a quotation mark within a quoted string of XML
# Strings are matched first, so that nothing within them counts.
_JSON_DIALECT = re.compile(
    r'("(?:[^"\\]|\\.)*")|//[^\n]*|/\*.*?\*/|([-+]?)\.(nan|inf)\b|,(?=\s*[\]}])',
    re.IGNORECASE | re.DOTALL,
)
_ELEMENT = {"u": "u1", "c": "i1", "w": "<u2", "s": "<i2", "i": "<i4", "f": "<f4", "d": "<f8"}
_ELEMENT |= {"h": "<f2"}
_DT = re.compile(r"([1-9]\d?)?([ucwsifdh])")
_MOST_ROWS = 1_000_000
_BASE64 = "$base64$"
_BASE64_HEADER = 24  # bytes of base64 data before the numbers: the element type as text
_REMEDY = "mend the file or write it again with OpenCV"
_DEEPEST = 50


def load_storage(path: Path) -> dict[str, Any]:
    """Content of a file, YAML, XML or JSON by its beginning, as dictionaries, lists, arrays, floats
    and strings. InputError where the file is none of these, too large, nested too deeply, or a
    matrix in it does not have the numbers that it announces.

    Returns:
        Values by key. Numbers are floats; matrices (rows, cols) or (rows, cols, channels) arrays of
        their own dtype, of which numbers may be NaN or infinite.
    """
    text = load_text(path)
    start = text.lstrip()[:1]
    if start == "<":
        root = parse_xml(text.replace("&quot;", _QUOTE), path)
        tree = (_from_xml(root, path) or {}) if root.tag == "opencv_storage" else None
    elif start in ("{", "["):
        tree = parse_json(_JSON_DIALECT.sub(_plain_json, text), path)
    else:
        tree = _from_yaml(text, path)
    if not isinstance(tree, dict):
        raise InputError(f"{path}: not an OpenCV FileStorage of named entries: {_REMEDY}")
    return {key: _value(inner, key, path) for key, inner in tree.items()}


def dump_storage(content: Mapping[str, Any], path: Path) -> None:
    """Writes a file that OpenCV reads. OSError where the file cannot be written.

    Args:
        content: Strings, whole numbers, 2-D float64 arrays, lists of strings, and dictionaries of
            these, by key.
        path: The file; its suffix .xml or .json selects the syntax, else YAML.
    """
    suffix = path.suffix if path.suffix.lower() in (".xml", ".json") else ".yml"
    file = cv2.FileStorage(suffix.lower(), cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    _write(file, content.items())
    path.write_text(file.releaseAndGetString(), encoding="utf-8")


def _write(file: cv2.FileStorage, entries: Iterable[tuple[str, Any]]) -> None:
    for key, value in entries:
        if isinstance(value, Mapping):
            file.startWriteStruct(key, cv2.FileNode_MAP)
            _write(file, value.items())
            file.endWriteStruct()
        elif isinstance(value, list):
            file.startWriteStruct(key, cv2.FileNode_SEQ)
            _write(file, (("", one) for one in value))
            file.endWriteStruct()
        else:
            file.write(key, value)


def _value(node: Any, key: str, path: Path) -> Any:
    """A node of any syntax as plain value: matrices as arrays, numbers as floats."""
    if isinstance(node, dict):
        if node.keys() >= {"rows", "cols", "data"}:
            return _matrix(node, key, path)
        return {name: _value(inner, name, path) for name, inner in node.items()}
    if isinstance(node, list):
        return [_value(inner, key, path) for inner in node]
    return float(node) if isinstance(node, bool | int) else node


def _matrix(node: dict[str, Any], key: str, path: Path) -> NDArray[Any]:
    """Array of a matrix's map, checked before it is made."""
    kind = _DT.fullmatch(str(node.get("dt")))
    if kind is None:
        raise InputError(f"{path}: {key} has dt {brief(node.get('dt'))}, no type: {_REMEDY}")
    counts = [node["rows"], node["cols"]]
    if not all(
        isinstance(count, int | float) and 0 <= count <= _MOST_ROWS and count == int(count)
        for count in counts
    ):
        raise InputError(f"{path}: {key} has rows and cols {brief(counts)}: {_REMEDY}")
    rows, cols = (int(count) for count in counts)
    channels = int(kind[1] or 1)
    dtype = np.dtype(_ELEMENT[kind[2]])
    data = [] if node["data"] is None else node["data"]
    if isinstance(data, str):
        numbers = _decoded(data, dtype)
    else:
        listed = data if isinstance(data, list) else [data]
        known = all(isinstance(one, int | float) for one in listed)
        with np.errstate(all="ignore"):  # a number out of its type's range, as OpenCV takes it
            numbers = np.array([float(one) for one in listed]) if known else None
    if numbers is None or len(numbers) != rows * cols * channels:
        held = "what is no number" if numbers is None else f"{len(numbers)} numbers"
        raise InputError(
            f"{path}: {key} announces {rows} x {cols} x {channels} numbers, its data hold {held}:"
            f" {_REMEDY}"
        )
    if dtype.kind in "iu" and not (
        np.isfinite(numbers).all() and (np.abs(numbers) <= np.iinfo(dtype).max).all()
    ):
        raise InputError(f"{path}: {key} holds numbers beyond its dt {kind[0]}: {_REMEDY}")
    with np.errstate(all="ignore"):
        numbers = numbers.astype(dtype)
    return numbers.reshape((rows, cols) if channels == 1 else (rows, cols, channels))


def _decoded(text: str, dtype: np.dtype[Any]) -> NDArray[Any] | None:
    """Numbers of base64 data; None where they are none."""
    try:
        content = base64.b64decode(text.removeprefix(_BASE64), validate=False)[_BASE64_HEADER:]
        return np.frombuffer(content, dtype)
    except (binascii.Error, ValueError):
        return None


def _scalar(text: str) -> float | str:
    """A value without quotes: a number if it looks like one."""
    if _NUMBER.fullmatch(text):
        return float(text)
    if special := _SPECIAL.fullmatch(text):
        return float(special[1] + special[2])
    if _HEXADECIMAL.fullmatch(text):
        return float(int(text, 16))
    return text


def _from_yaml(text: str, path: Path) -> Any:
    """Tree of the first document; built from events, so that depth and aliases are bounded."""
    import yaml

    # The first line, %YAML:1.0, is not YAML.
    text = re.sub(r"\A\s*%YAML[^\n]*\n?", "", text)
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    try:
        return _from_events(yaml.parse(text, Loader=loader), path)
    except (yaml.YAMLError, UnicodeError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        where = "" if mark is None else f" in line {mark.line + 2}"
        reason = getattr(error, "problem", None) or "not YAML"
        raise InputError(f"{path}: OpenCV cannot read it: {reason}{where}: {_REMEDY}") from None


def _from_events(events: Iterator[Any], path: Path) -> Any:
    import yaml

    root: list[Any] = []
    stack: list[Any] = [root]
    keys: list[str | None] = [None]

    def add(value: Any) -> None:
        if isinstance(stack[-1], list):
            stack[-1].append(value)
        else:
            # OpenCV takes the first of two entries of one name.
            stack[-1].setdefault(keys[-1], value)
            keys[-1] = None

    for event in events:
        if isinstance(event, yaml.DocumentEndEvent):
            break
        if getattr(event, "anchor", None) is not None:
            raise InputError(f"{path}: has anchors or aliases, as OpenCV never writes: {_REMEDY}")
        waits = isinstance(stack[-1], dict) and keys[-1] is None
        if isinstance(event, yaml.ScalarEvent):
            if waits:
                keys[-1] = event.value
            else:
                plain = not event.style and event.tag != "tag:yaml.org,2002:binary"
                truth = {"true": 1.0, "false": 0.0}.get(event.value) if plain else None
                add(truth if truth is not None else _scalar(event.value) if plain else event.value)
        elif isinstance(event, yaml.MappingStartEvent | yaml.SequenceStartEvent):
            if waits or len(stack) > _DEEPEST:
                raise InputError(f"{path}: nested as no FileStorage is: {_REMEDY}")
            value: Any = {} if isinstance(event, yaml.MappingStartEvent) else []
            add(value)
            stack.append(value)
            keys.append(None)
        elif isinstance(event, yaml.MappingEndEvent | yaml.SequenceEndEvent):
            stack.pop()
            keys.pop()
    return root[0] if root else {}


def _from_xml(element: ElementTree.Element, path: Path) -> Any:
    """Tree of an element; `parse_xml` has bounded its depth."""
    children = list(element)
    if children:
        texts = [element.text, *(child.tail for child in children)]
        listed = [child.tag == "_" for child in children]
        if any(text and text.strip() for text in texts) or any(listed) != all(listed):
            raise InputError(f"{path}: <{element.tag}> mixes text, names and items: {_REMEDY}")
        if all(listed):
            return [_from_xml(child, path) for child in children]
        content: dict[str, Any] = {}
        for child in children:
            content.setdefault(child.tag, _from_xml(child, path))
        return content
    text = element.text or ""
    if element.get("type_id") == "binary":
        return text
    items = [
        (_scalar(match[2]) if match[1] is None else match[1].replace(_QUOTE, '"'))
        for match in _XML_ITEM.finditer(text)
    ]
    return items[0] if len(items) == 1 else items or None


def _plain_json(match: re.Match[str]) -> str:
    """What JSON has in place of a part of OpenCV's dialect."""
    if match[1] is not None:
        return match[1]
    if match[3] is None:
        return ""  # a comment, or the comma after the last entry
    number = "NaN" if match[3].lower() == "nan" else "Infinity"
    return f"-{number}" if match[2] == "-" and number != "NaN" else number
