"""The list of mutations fits the code, and the runner notices tests that do not."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SMALL = """
def both(a, b):
    return a + b


def least(a, b):
    return min(a, b)
"""
TESTS = """
from small.sums import both, least


def test_both():
    assert both(1, 2) == 3


def test_least():
    assert least(1, 1) == 1
"""
LISTED = """
[[mutant]]
file = "small/sums.py"
what = "a difference"
from = 'a + b'
to = 'a - b'
tests = ["tests/test_sums.py"]

[[mutant]]
file = "small/sums.py"
what = "the greatest"
from = 'min(a, b)'
to = 'max(a, b)'
tests = ["tests/test_sums.py::test_least"]

[[mutant]]
file = "small/sums.py"
what = "the greatest, again"
from = 'min(a, b)'
to = 'max(b, a)'
tests = ["tests/test_sums.py::test_least"]
equivalent = "nobody asks"
"""


@pytest.fixture
def mutants(beside):
    return beside("mutants")


@pytest.fixture
def project(tmp_path) -> Path:
    """A project of one module, one of whose two functions is hardly tested."""
    for name in ("small", "tests", "benchmarks"):
        (tmp_path / "project" / name).mkdir(parents=True)
    root = tmp_path / "project"
    (root / "small" / "__init__.py").touch()
    (root / "small" / "sums.py").write_text(SMALL)
    (root / "tests" / "test_sums.py").write_text(TESTS)
    (root / "benchmarks" / "mutants.toml").write_text(LISTED)
    return root


def test_every_listed_mutation_can_be_made(mutants):
    listed = mutants.read_mutants()
    assert len(listed) >= 120
    assert len({str(mutant) for mutant in listed}) == len(listed)
    assert {mutant.file.split("/")[0] for mutant in listed} == {
        "calib",
        "papers",
        "silhouette_core",
        "voxelpose",
    }
    for mutant in listed:
        changed = mutant.applied((ROOT / mutant.file).read_text(encoding="utf-8"))
        ast.parse(changed, mutant.file)


def test_the_tests_that_should_notice_are_there(mutants):
    defined = {}
    for test in {test for mutant in mutants.read_mutants() for test in mutant.tests}:
        file, _, name = test.partition("::")
        if file not in defined:
            tree = ast.parse((ROOT / file).read_text(encoding="utf-8"))
            defined[file] = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        assert not name or name.partition("[")[0] in defined[file], test


def test_mutations_that_no_test_notices_are_named(mutants, project, capsys):
    """Of the two, the one that is explained does not count."""
    before = (project / "small" / "sums.py").read_bytes()
    assert mutants.main([], project) == 1
    said = capsys.readouterr().out
    assert "| all | 3 | 1 | 1 | 1 |" in said
    assert "survived: small/sums.py: the greatest" in said
    assert said.count("survived: ") == 1
    assert (project / "small" / "sums.py").read_bytes() == before


def test_tests_that_fail_without_a_mutation_are_told(mutants, project, capsys):
    (project / "small" / "sums.py").write_text(SMALL.replace("a + b", "a + b + 1"))
    assert mutants.main(["difference"], project) == 2
    assert "test_both" in capsys.readouterr().err
    assert mutants.main(["no such"], project) == 2
