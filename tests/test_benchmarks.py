import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def benchmarks(monkeypatch):
    """The benchmarks are not installed: they stand beside the packages."""
    if not (ROOT / "benchmarks" / "__main__.py").exists():
        pytest.skip("no benchmarks beside the tests")
    monkeypatch.syspath_prepend(str(ROOT))
    from benchmarks import __main__ as module

    yield module
    for name in [name for name in sys.modules if name.split(".")[0] == "benchmarks"]:
        del sys.modules[name]


def test_a_case_is_one_line_with_both_times_and_their_ratio(benchmarks, capsys):
    assert benchmarks.main(["a window"]) == 0
    _, line = capsys.readouterr().out.splitlines()
    found = re.match(
        r"carve a window, 100\^3 x 4 views +([\d.]+) ms +([\d.]+) ms   ratio +([\d.]+) x", line
    )
    assert found
    ours, reference, ratio = map(float, found.groups())
    assert ratio == pytest.approx(reference / ours, rel=0.1)


def test_an_unknown_case_is_said(benchmarks, capsys):
    assert benchmarks.main(["no such"]) == 2
    assert "there are: carve 128^3 x 8 views" in capsys.readouterr().err
