"""Every compiled kernel gives what its NumPy reference gives.

Kernels are the compiled functions without an underscore in the `kernels` folders. The reference is
the function of the same name in `tests/oracles`: it takes the same arguments and fills the same
arrays. Example arguments come from `tests/kernel_examples`, one file per folder.
"""

import ast
import copy
import importlib
from pathlib import Path

import numpy as np
import pytest

from tests.kernel_examples import Example

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(
    path
    for package in ("silhouette_core", "voxelpose")
    for path in (ROOT / package).rglob("kernels/*.py")
    if path.stem != "__init__"
)


def dotted(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def kernels() -> list[tuple[str, str]]:
    """Returns module and name of every kernel."""
    pairs = []
    for module in map(dotted, FILES):
        for name, value in vars(importlib.import_module(module)).items():
            compiled = getattr(value, "py_func", None)
            if compiled is not None and compiled.__module__ == module and name[0] != "_":
                pairs.append((module, name))
    return pairs


def room(module: str) -> str:
    """Returns the folder that a kernel module belongs to."""
    return module.split(".")[-3]


def example(module: str, name: str, seed: int) -> Example:
    examples = importlib.import_module(f"tests.kernel_examples.{room(module)}")
    return getattr(examples, name)(np.random.default_rng(seed))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("module", "name"), kernels())
def test_a_kernel_gives_what_its_reference_gives(module, name, seed):
    kernel = getattr(importlib.import_module(module), name)
    reference = getattr(importlib.import_module(f"tests.oracles.{room(module)}"), name)
    given = example(module, name, seed)
    ours, expected = copy.deepcopy(given.arguments), copy.deepcopy(given.arguments)
    results = (kernel(*ours), *ours), (reference(*expected), *expected)
    for result, value in zip(*map(arrays, results), strict=True):
        np.testing.assert_allclose(result, value, rtol=given.rtol, atol=given.atol, strict=True)


def arrays(values: tuple) -> list[np.ndarray]:
    """Returns all numbers and arrays of nested tuples; what a kernel casts itself as float64."""
    flat = []
    for value in values:
        if isinstance(value, tuple):
            flat += arrays(value)
        elif value is not None:
            array = np.asarray(value)
            flat.append(array if isinstance(value, np.ndarray) else array.astype(np.float64))
    return flat


@pytest.mark.parametrize("path", FILES, ids=dotted)
def test_a_kernel_file_names_source_and_reference(path):
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    assert "Source:" in text and "Reference:" in text


@pytest.mark.parametrize("path", FILES, ids=dotted)
def test_no_kernel_file_imports_another(path):
    """A cached kernel does not notice an edit of what it calls elsewhere."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert "kernels" not in (node.module or "").split(".")
