"""Sentences of pages: no option of the command line in them, and no file of docs."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import voxelpose
from voxelpose.view.serving.page_words import field_at_fault, in_page_words, page_words

ROOT = Path(voxelpose.__file__).parent.parent
FOREIGN = re.compile(r"(?<![\w-])--[a-z]|docs/|\w\.md\b")
MODULES = sorted(
    path
    for name in ("calib", "silhouette_core", "voxelpose")
    for path in (ROOT / name).rglob("*.py")
)
# What no page shows: what is printed, and what other programs are called with.
UNSEEN = {"cli", "batch", "network_install.py", "machine_checks.py", "page_words.py"}


def sentences(path: Path) -> Iterator[str]:
    """Texts of a module with words in them, but for its docstrings."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        inner = [
            each
            for each in ast.iter_child_nodes(node)
            if not isinstance(node, ast.Expr | ast.JoinedStr)
        ]
        for each in inner:
            if isinstance(each, ast.JoinedStr):
                yield "".join(
                    getattr(value, "value", "X") if isinstance(value, ast.Constant) else "X"
                    for value in each.values
                )
            elif isinstance(each, ast.Constant) and isinstance(each.value, str):
                yield each.value


def test_no_error_names_an_option_or_a_document_to_a_page():
    foreign = [
        f"{path.name}: {page_words(text)}"
        for path in MODULES
        if not UNSEEN & {*path.parts}
        for text in sentences(path)
        if " " in text and FOREIGN.search(page_words(text))
    ]
    assert foreign == []


def test_no_page_names_an_option_or_a_document():
    pages = [
        path for path in (ROOT / "voxelpose").rglob("page/*") if path.suffix in (".js", ".html")
    ]
    texts = [
        (path.name, text)
        for path in pages
        for text in re.findall(r'"[^"\n]* [^"\n]*"|`[^`]* [^`]*`', path.read_text())
    ]
    assert len(texts) > 500
    assert [each for each in texts if FOREIGN.search(each[1])] == []


@pytest.mark.parametrize(
    ("line", "words", "field"),
    [
        ("give --gap-limit 3, or --no-smooth", "give `gap limit` 3, or `smooth` off", "gap-limit"),
        ("--up=sideways is none", "`up` sideways is none", "up"),
        ("make one (docs/calibration.md)", "make one", ""),
        (
            "`voxelpose calibrate sync a --by board` aligns; or --fps",
            "Calibrate, part 4 aligns; or `fps`",
            "fps",
        ),
        ("only `view --open3d` needs it", "only `view` needs it", ""),
        ("walk--1.mp4 is text", "walk--1.mp4 is text", ""),
    ],
)
def test_a_line_in_the_words_of_a_page(line, words, field):
    assert page_words(line) == words
    assert field_at_fault(line) == field


def test_sentences_are_changed_and_names_are_not():
    sent = {
        "name": "a --b",
        "notes": ["give --fps"],
        "found": [{"words": "--up z"}, {"n": 1}],
        "x": [1.5],
    }
    changed = {
        "name": "a --b",
        "notes": ["give `fps`"],
        "found": [{"words": "`up` z"}, {"n": 1}],
        "x": [1.5],
    }
    assert in_page_words(sent) == changed
