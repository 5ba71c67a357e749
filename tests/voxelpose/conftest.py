"""Fixtures of the application's tests."""

import sys
from pathlib import Path

import pytest

from tests.sources import install_standing


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder, beside which the estimator "standing" is installed (in site/)."""
    (tmp_path / "site").mkdir()
    install_standing(tmp_path / "site")
    monkeypatch.syspath_prepend(str(tmp_path / "site"))
    monkeypatch.delitem(sys.modules, "standing_estimator", raising=False)
    monkeypatch.chdir(tmp_path)
    return tmp_path
