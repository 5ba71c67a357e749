"""The documentation names what exists."""

import importlib
import re
import shlex
from pathlib import Path

import pytest

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


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if link.startswith(("http:", "https:", "mailto:")):
            continue
        target, _, anchor = link.partition("#")
        there = (page.parent / target) if target else page
        assert there.exists(), f"{page.name}: {link}"
        assert not anchor or anchor in anchors(there), f"{page.name}: {link}"


def test_names_in_the_papers_map_exist():
    text = (ROOT / "docs" / "papers.md").read_text(encoding="utf-8")
    names = re.findall(r"`((?:calib|silhouette_core|voxelpose|carving|matching)\.[\w.]+)`", text)
    assert len(names) > 20
    for name in names:
        words = (
            name if name.split(".")[0] not in ("carving", "matching") else f"voxelpose.{name}"
        ).split(".")
        for length in range(len(words), 0, -1):
            try:
                result = importlib.import_module(".".join(words[:length]))
            except ModuleNotFoundError:
                continue
            for word in words[length:]:
                result = getattr(result, word)
            break


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_exist(page):
    shown = re.findall(
        r"^(?:\.venv/bin/)?voxelpose (\w+)|`voxelpose (\w+)",
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
            words = shlex.split(line, comments=True)
            if words[:1] == ["voxelpose"] and "--help" not in words:
                assert callable(
                    _parse(words[1], [word.replace("…", "x") for word in words[2:]]).run
                ), line
