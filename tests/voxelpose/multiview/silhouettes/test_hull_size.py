"""Calibrations in a wrong unit are told by the hull's size."""

from dataclasses import replace

import pytest

from calib.camera import Rig
from calib.errors import InputError
from silhouette_core.estimator import Settings
from silhouette_core.progress import SilentReporter
from tests.clips import waving
from tests.sources import ring, write_staged
from tests.voxelpose.multiview.matching_scenes import other_body, photograph, stance, views
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.multiview_estimator import MultiViewEstimator
from voxelpose.multiview.silhouettes.hull_size import check_hull_size
from voxelpose.recording.folder import Recording

SCENE, PERSON = views(4), other_body()
MOMENTS = [photograph(SCENE, PERSON, stance(PERSON, None, (x, 0.0))) for x in (0.0, 0.2)]


def scaled(times: float) -> Rig:
    """The cameras with all lengths multiplied."""
    return Rig(tuple(replace(one, translation=times * one.translation) for one in SCENE.rig))


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (10, r"about 1[67]\.\d m tall .* in millimetres, and not in centimetres\?.*--unit mm"),
        (100, r"in centimetres, and not in metres\?.*--unit cm"),
        (1000, r"in millimetres, and not in metres\?.*--unit mm"),
        (0.1, r"in centimetres, and not in millimetres\?"),
        (0.01, r"in metres, and not in centimetres\?"),
        (0.001, r"about 0\.0017\d m tall .* in metres, and not in millimetres\?.*--unit m "),
    ],
)
@pytest.mark.parametrize("stature_m", [None, 1.72])
def test_a_wrong_unit_is_named(times, words, stature_m):
    with pytest.raises(InputError, match=words):
        check_hull_size(scaled(times), MOMENTS, CarveRule(), stature_m)


@pytest.mark.parametrize("stature_m", [None, 0.8, 1.72])
def test_people_are_of_their_size(stature_m):
    nobody = [mask & False for mask in MOMENTS[0]]
    assert check_hull_size(SCENE.rig, MOMENTS, CarveRule(), stature_m) is None
    assert check_hull_size(scaled(100), [nobody], CarveRule(), stature_m) is None


def test_the_estimator_refuses_before_it_searches_poses(tmp_path):
    folder = write_staged(tmp_path / "walk", waving(3), ring(3))
    text = (folder / "calibration.toml").read_text()
    (folder / "calibration.toml").write_text(text.replace('unit = "m"', 'unit = "cm"'))
    with pytest.raises(InputError, match=r"in metres, and not in centimetres\?"):
        MultiViewEstimator().estimate(Recording.open(folder), Settings(), SilentReporter())
