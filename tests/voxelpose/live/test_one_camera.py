"""Live with one camera: the person here, poses in a process of their own."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.library_fuzz_targets import unlearned_proposal
from calib.errors import InputError
from silhouette_core.estimator import Settings
from silhouette_core.monocular.monocular_stages import MonocularOptions
from silhouette_core.monocular.tree.store import write_library
from silhouette_core.monocular.tree_estimator import TreeOptions
from silhouette_core.progress import SilentReporter
from tests.silhouette_core.monocular.tree.small_library import small_library
from tests.sources import ring
from tests.voxelpose.live.live_scenes import person, posed, staged_frame
from voxelpose.live.live_estimators import LiveMoment, LiveMonocular, LiveTree
from voxelpose.multiview.tracking.body_track import Moment

RIG = ring(1, (320, 240))
NAME = RIG.names[0]
STANDING = posed({"left_upper_arm.abduction": -40, "right_upper_arm.abduction": -40})


@pytest.fixture(scope="module")
def library():
    return small_library()


@pytest.fixture
def live(library, tmp_path):
    """Makes the estimator with a library of a proposal; ends it after the test."""
    made: list[LiveMonocular] = []

    def of(proposal):
        write_library(replace(library, proposal=proposal), tmp_path / "lib.vplib")
        options = MonocularOptions(str(tmp_path / "lib.vplib"), "any")
        settings = Settings(person().sizes.stature_m, smooth=False)
        camera = RIG.cameras[0]
        made.append(LiveMonocular(camera, settings, options, True, SilentReporter()))
        return made[-1]

    yield of
    for one in made:
        one.close()


def moment(number, silhouettes, pictures):
    time_s = number / 25
    return LiveMoment(number, time_s, Moment.of(time_s, silhouettes), pictures)


def test_a_person_is_found_frame_by_frame(live):
    estimator = live(unlearned_proposal())
    frame = staged_frame(RIG, STANDING)
    whole = {NAME: frame.silhouettes[NAME].repeat(2, axis=0).repeat(2, axis=1)}
    for number in range(3):
        seen = estimator.prepare(moment(number, whole, frame.pictures))
        assert seen is not None and seen[:2] == (number, number / 25)
        (found,) = estimator.step(seen)
        assert found.confidence > 0.6 and found.joint_confidence.shape == (15,)
        assert found.model.sizes.stature_m == pytest.approx(person().sizes.stature_m)
        away = np.linalg.norm(found.pose.root_m - RIG.cameras[0].center_m)
        true_m = np.linalg.norm(STANDING.pose.root_m - RIG.cameras[0].center_m)
        assert away == pytest.approx(true_m, rel=0.15)
        odds = [probability for probability, _ in found.hypotheses]
        assert 1 <= len(odds) <= 5 and odds == sorted(odds, reverse=True)
    empty = {NAME: np.zeros_like(whole[NAME])}
    assert estimator.prepare(moment(3, empty, frame.pictures)) is None
    assert estimator.step(None) == (None,)


def test_a_library_without_a_proposal_is_refused(live):
    with pytest.raises(InputError, match=r"lib\.vplib: the library has no proposal"):
        live(None)


def test_paper_a_s_filter_follows_too(library, tmp_path):
    write_library(library, tmp_path / "lib.vplib")
    options = TreeOptions(str(tmp_path / "lib.vplib"), "any")
    settings, camera = Settings(smooth=False), RIG.cameras[0]
    estimator = LiveTree(camera, settings, options, 25.0, SilentReporter())
    try:
        frame = staged_frame(RIG, STANDING)
        whole = {NAME: frame.silhouettes[NAME].repeat(2, axis=0).repeat(2, axis=1)}
        for number in range(2):
            (found,) = estimator.step(estimator.prepare(moment(number, whole, frame.pictures)))
            assert found.confidence > 0.5
            odds = [probability for probability, _ in found.hypotheses]
            assert sum(odds) == pytest.approx(1) and odds == sorted(odds, reverse=True)
            likeliest = found.hypotheses[0][1]
            np.testing.assert_allclose(found.joints_m, likeliest, atol=1e-9)
        empty = {NAME: np.zeros_like(whole[NAME])}
        assert estimator.prepare(moment(3, empty, frame.pictures)) is None
    finally:
        estimator.close()
