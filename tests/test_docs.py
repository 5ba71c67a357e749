"""The documentation names what exists."""

import pkgutil
import re
import shlex
from pathlib import Path

import pytest

from tests.prose import sentences, words
from voxelpose.cli import COMMANDS, _parse

ROOT = Path(__file__).resolve().parents[1]
PAGES = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").glob("*.md")),
]


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if link.startswith(("http:", "https:", "mailto:")):
            continue
        target, _, anchor = link.partition("#")
        there = (page.parent / target) if target else page
        assert there.exists(), f"{page.name}: {link}"
        assert not anchor or anchor in anchors(there), f"{page.name}: {link}"


def tables(page: Path) -> list[list[list[str]]]:
    """Tables of a page, cells row by row; a line that runs on from a table is a row of it."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    blocks = re.findall(r"^\|.*\n(?:.+\n)*", text + "\n", re.MULTILINE)
    return [[re.split(r"(?<!\\)\|", row) for row in block.splitlines()] for block in blocks]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_rows_of_tables_are_whole(page):
    for head, rule, *rows in tables(page):
        assert rows and all(re.fullmatch(r" ?:?-+:? ?", cell) for cell in rule[1:-1]), head
        for row in (head, rule, *rows):
            assert len(row) == len(head) > 2 and row[0] == row[-1] == "", row
            assert not any(cell.count("`") % 2 for cell in row), row


def test_names_in_tables_and_the_papers_map_exist():
    cells = [cell for page in PAGES for table in tables(page) for row in table for cell in row]
    cells += [(ROOT / "docs" / "papers.md").read_text(encoding="utf-8")]
    others = r"voxelpose\.toml|silhouette_core\.(?:backends|estimators|pose_proposers)"
    packages = "calib|silhouette_core|voxelpose|papers|benchmarks"
    names = set(re.findall(rf"`(?!(?:{others})`)((?:{packages})\.[\w.]+)`", " ".join(cells)))
    assert len(names) > 60
    for name in names:
        pkgutil.resolve_name(name)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_exist(page):
    shown = re.findall(
        r"^(?:\.venv/bin/)?voxelpose ([\w-]+)|`voxelpose ([\w-]+)",
        page.read_text(encoding="utf-8"),
        re.MULTILINE,
    )
    assert {one or other for one, other in shown} <= set(COMMANDS)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_shown_commands_are_understood(page):
    for block in re.findall(
        r"^```sh\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    ):
        for line in block.replace("\\\n", " ").splitlines():
            given = shlex.split(line, comments=True)
            if given[:1] == ["voxelpose"] and "--help" not in given:
                assert callable(
                    _parse(given[1], [word.replace("…", "x") for word in given[2:]]).run
                ), line


@pytest.mark.parametrize(
    "name", ["README.md", "docs/decisions.md", "docs/guide.md", "docs/results.md"]
)
def test_no_sentence_is_long(name):
    found = sentences((ROOT / name).read_text(encoding="utf-8"))
    assert len(found) > 30
    assert not [sentence for sentence in found if words(sentence) > 30]


@pytest.mark.parametrize(
    ("name", "most"), [("README.md", 450), ("docs/results.md", 2500), ("docs/decisions.md", 4000)]
)
def test_pages_are_short(name, most):
    assert len((ROOT / name).read_text(encoding="utf-8").split()) <= most


def test_results_have_few_lines():
    assert len((ROOT / "docs" / "results.md").read_text(encoding="utf-8").splitlines()) <= 250


def test_paths_in_the_architecture_exist():
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    paths = re.findall(r"`((?:calib|silhouette_core|voxelpose|tests|benchmarks)/[\w/.]*)`", text)
    assert len(paths) > 40
    assert not [path for path in paths if not (ROOT / path).exists()]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_benchmarks_exist(page):
    named = re.findall(r"python -m benchmarks\.(\w+)", page.read_text(encoding="utf-8"))
    assert not [name for name in named if not (ROOT / "benchmarks" / f"{name}.py").exists()]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        (
            "One. Two! Three? lower goes on; so: here",
            ["One.", "Two!", "Three? lower goes on; so: here"],
        ),
        (
            "By R. Okada, Fig. 6. It took 1.5 s. 3 in all.",
            ["By R Okada, Fig 6.", "It took 1.5 s.", "3 in all."],
        ),
        (
            "A [link. Or two](a.md#b) and `x. Y` end. `Z` too.",
            ["A link.", "Or two and Code end.", "Code too."],
        ),
        (
            "wrapped\nline\n\nnext\n- item\n  goes on\n2. other",
            ["wrapped line", "next", "item goes on", "other"],
        ),
        (
            "# Head\ntext\n| a | B c. D e |\n|---|---|\n| `x \\| y` | |",
            ["Head", "text", "a", "B c.", "D e", "Code"],
        ),
        ("before\n```sh\nno. Sentence\n```\nbut <!-- not. This --> all", ["before", "but  all"]),
        (
            "![shown. Twice](a.png) then **bold.** Then.",
            ["shown.", "Twice", "then **bold.", "Then."],
        ),
    ],
)
def test_sentences_end_where_they_end(text, found):
    assert sentences(text) == found


def test_words_hold_a_letter_or_a_digit():
    assert words("640 × 480 px – two (2) words") == 6
