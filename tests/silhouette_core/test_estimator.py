"""Estimators are found through entry points, also when they come from outside this project."""

import sys
from pathlib import Path

import pytest

from calib.errors import InputError
from silhouette_core.entry_points import registered
from silhouette_core.estimator import GROUP, load_estimator
from tests.sources import open_desk


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An estimator of somebody else, which commands' tests run, and something that is none."""
    folder = open_desk(tmp_path, monkeypatch) / "site"
    with next(folder.glob("*.dist-info/entry_points.txt")).open("a") as listed:
        listed.write("nothing = types:SimpleNamespace\n")


def test_own_estimator_is_registered_like_any_other():
    own = registered(GROUP)["multiview"].value
    assert own == "voxelpose.multiview.multiview_estimator:MultiViewEstimator"


def test_listing_imports_nothing(outside):
    assert "standing" in registered(GROUP)
    assert "standing_estimator" not in sys.modules


@pytest.mark.usefixtures("outside")
def test_what_is_no_estimator_is_a_bug_of_its_author():
    with pytest.raises(TypeError, match="types:SimpleNamespace"):
        load_estimator("nothing")


def test_unknown_name_is_answered_with_the_known_ones():
    with pytest.raises(InputError, match=r"no estimator is called 'telepathy'.*multiview"):
        load_estimator("telepathy")
