"""Estimators are found through entry points, also when they come from outside this project."""

import sys
from pathlib import Path

import pytest

from calib.errors import InputError
from silhouette_core.entry_points import registered
from silhouette_core.estimator import GROUP, Settings, load_estimator
from silhouette_core.progress import SilentReporter

OUTSIDE = """
from silhouette_core.estimator import Estimate

class Standing:
    name = "standing"

    def estimate(self, source, settings, reporter):
        reporter.stage("standing", 1)
        reporter.advance()
        return Estimate(motion=None, facts={"stature_m": settings.stature_m})

class Nothing:
    pass
"""


@pytest.fixture
def outside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Installed third-party package: a module and the metadata that pip writes."""
    (tmp_path / "somebodys_estimator.py").write_text(OUTSIDE)
    metadata = tmp_path / "somebodys_estimator-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: somebodys-estimator\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(
        f"[{GROUP}]\nstanding = somebodys_estimator:Standing\nnothing ="
        " somebodys_estimator:Nothing\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, "somebodys_estimator", raising=False)


def test_own_estimator_is_registered_like_any_other():
    own = registered(GROUP)["multiview"].value
    assert own == "voxelpose.multiview.multiview_estimator:MultiViewEstimator"


@pytest.mark.usefixtures("outside")
def test_estimator_from_outside_is_found_and_runs():
    estimator = load_estimator("standing")
    estimate = estimator.estimate(None, Settings(stature_m=1.7), SilentReporter())  # type: ignore[arg-type]
    assert estimator.name == "standing"
    assert estimate.facts == {"stature_m": 1.7}


def test_listing_imports_nothing(outside):
    assert "standing" in registered(GROUP)
    assert "somebodys_estimator" not in sys.modules


@pytest.mark.usefixtures("outside")
def test_what_is_no_estimator_is_a_bug_of_its_author():
    with pytest.raises(TypeError, match="somebodys_estimator:Nothing"):
        load_estimator("nothing")


def test_unknown_name_is_answered_with_the_known_ones():
    with pytest.raises(InputError, match=r"no estimator is called 'telepathy'.*multiview"):
        load_estimator("telepathy")
