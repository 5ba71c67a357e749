"""Every numbered equation and step of the two papers stands in exactly one docstring."""

import ast
import importlib
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
EQUATIONS = [f"okada-{number}" for number in range(1, 15)] + [
    f"iiyama-{step}" for step in range(1, 6)
]
DOCUMENTED = (ast.FunctionDef, ast.ClassDef)


@cache
def functions_by_equation() -> dict[str, list[str]]:
    """Return the dotted names of the functions or classes whose docstring states an equation."""
    homes = defaultdict(list)
    for package in ("calib", "silhouette_core", "voxelpose", "papers"):
        for path in (ROOT / package).rglob("*.py"):
            module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
            visit(ast.parse(path.read_text(encoding="utf-8")), module, homes)
    return homes


def visit(node: ast.AST, name: str, homes: dict[str, list[str]]) -> None:
    for child in ast.iter_child_nodes(node):
        if isinstance(child, DOCUMENTED):
            for label in re.findall(r":label: (\S+)", ast.get_docstring(child) or ""):
                homes[label].append(f"{name}.{child.name}")
            visit(child, f"{name}.{child.name}", homes)


ROWS = {
    label: line
    for line in (ROOT / "docs" / "papers.md").read_text(encoding="utf-8").splitlines()
    for label in re.findall(r"<!-- (\S+) -->", line)
}


@pytest.mark.parametrize("label", EQUATIONS)
def test_an_equation_is_rendered_once_and_the_map_leads_to_it(label):
    row, homes = ROWS[label], functions_by_equation()
    if "not implemented" in row:
        assert label not in homes
    else:
        assert len(homes[label]) == 1, homes[label]
        assert f"`{homes[label][0]}`" in row


@pytest.mark.parametrize("label", EQUATIONS)
def test_the_code_line_of_an_equation_is_marked(label):
    homes = functions_by_equation()
    if label not in homes:
        pytest.skip("not implemented, see docs/papers.md")
    paper, number = label.split("-")
    module, source = homes[label][0], None
    while source is None:
        module = module.rpartition(".")[0]
        try:
            source = Path(importlib.import_module(module).__file__).read_text(encoding="utf-8")
        except ModuleNotFoundError:
            continue
    word = "eq." if paper == "okada" else "step"
    assert re.search(rf"#.*\b{word} (?:\(\d+\), )*\({number}\)", source)
