"""Runs datasets/convert.py in this process and returns what it printed."""

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.datasets.miniatures import CONVERT


@pytest.fixture
def convert(capsys) -> Callable[..., str]:
    """Converts and returns what was printed."""

    def run(*arguments: object) -> str:
        code, out, err = _run(arguments, capsys)
        assert code == 0, err
        return out

    return run


@pytest.fixture
def refuse(capsys, tmp_path: Path) -> Callable[..., str]:
    """Fails to convert: one line, code 2, nothing written; returns the line."""

    def run(*arguments: object) -> str:
        before = sorted(tmp_path.iterdir())
        code, out, err = _run(arguments, capsys)
        assert code == 2, err
        assert out == "" and err.count("\n") == 1 and err.startswith("convert: "), err
        assert sorted(tmp_path.iterdir()) == before
        return err

    return run


def _run(arguments, capsys) -> tuple[int, str, str]:
    if str(CONVERT.parent) not in sys.path:
        sys.path.insert(0, str(CONVERT.parent))
    import convert

    capsys.readouterr()
    try:
        code = convert.run([str(word) for word in arguments])
    except SystemExit as end:
        code = end.code
    return code, *capsys.readouterr()
