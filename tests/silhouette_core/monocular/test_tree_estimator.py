"""Paper A's own estimator, from silhouettes to a motion."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.silhouette_source import SilhouetteSource
from calib.errors import InputError
from silhouette_core.estimator import Settings, load_estimator
from silhouette_core.monocular import tree_estimator
from silhouette_core.monocular.tree.store import write_library
from silhouette_core.monocular.tree_estimator import TreeEstimator, TreeFollower, dictionary
from silhouette_core.motion.conditioning import Conditioning
from silhouette_core.progress import SilentReporter
from silhouette_core.scoring.cpu import CpuBackend
from tests.silhouette_core.monocular.filming import STATURE_M, body, camera_at, films, performed

CAMERA = camera_at((1.0, -3.9, 1.4))
ROWS = range(0, 30, 3)
FPS = 10.0
ROBOT = Path(__file__).parents[3] / "examples/bodies/robot_arm.urdf"


@pytest.fixture(scope="module")
def library_file(library, tmp_path_factory):
    path = tmp_path_factory.mktemp("tree") / "own.vplib"
    write_library(library, path)
    return path


@pytest.fixture(scope="module")
def filmed():
    motion = performed("wave", body())
    return motion.landmarks()[ROWS], films(motion, CAMERA, ROWS)


def tracked(masks, fps=FPS, conditioning=None, stature_m=STATURE_M, **options):
    source = SilhouetteSource(CAMERA, masks, fps)
    settings = Settings(stature_m, options=options)
    if conditioning is not None:
        settings = replace(settings, conditioning=conditioning)
    return TreeEstimator().estimate(source, settings, SilentReporter())


def use_small_dictionaries(folder, monkeypatch):
    """Builds dictionaries of 240 samples of one motion, and keeps them in a folder."""
    monkeypatch.setattr(tree_estimator, "user_cache_path", lambda name: folder / name)
    monkeypatch.setattr(tree_estimator, "_SAMPLES", 240)
    monkeypatch.setattr(
        tree_estimator, "keypose_motions", lambda model: {"wave": performed("wave", model)}
    )


def relative(joints):
    return joints - joints[:, :1]


def test_a_wave_is_followed(library_file, filmed):
    truth, masks = filmed
    found = tracked(masks, library=str(library_file), start="any")
    joints = found.motion.landmarks()
    off = np.linalg.norm(relative(joints) - relative(truth), axis=2)
    assert off.mean() < 0.12 and np.linalg.norm(joints[:, 0] - truth[:, 0], axis=1).mean() < 0.4
    assert set(found.motion.quality) == {"outline_agreement"}
    assert found.motion.quality["outline_agreement"].mean() > 0.6
    frames = list(found.hypotheses)
    assert len(frames) == len(masks)
    for _, probability, _ in frames:
        assert probability.sum() == pytest.approx(1, abs=1e-5)
        assert (np.diff(probability) <= 0).all()


def test_the_motion_is_that_of_the_likeliest_samples(library_file, filmed):
    """Unless a filter is chosen, which uses later frames."""
    many = np.repeat(filmed[1], 3, axis=0)  # as many as the filter needs
    found = tracked(many, fps=30.0, library=str(library_file))
    likeliest = np.stack([joints[0] for _, _, joints in found.hypotheses])
    np.testing.assert_allclose(found.motion.landmarks(), likeliest, atol=1e-5)
    chosen = Conditioning("butterworth")
    filtered = tracked(many, fps=30.0, conditioning=chosen, library=str(library_file)).motion
    assert np.abs(filtered.landmarks() - likeliest).max() > 0.01


def test_a_taller_person_is_larger_and_farther_away(library_file, filmed):
    """In front of one camera nothing else tells the size."""
    own, told = (tracked(filmed[1], stature_m=m, library=str(library_file)) for m in (None, 1.893))
    assert told.motion.model.sizes.stature_m == 1.893
    away, farther = (one.motion.landmarks() - CAMERA.center_m for one in (own, told))
    np.testing.assert_allclose(farther, away * 1.893 / own.motion.model.sizes.stature_m, rtol=1e-4)


@pytest.mark.parametrize("named", [True, False])
def test_no_stature_is_no_person_s(library_file, filmed, named):
    library = {"library": str(library_file)} if named else {}
    with pytest.raises(InputError, match="stature 0"):
        tracked(filmed[1][:2], stature_m=0.0, **library)


def test_a_given_body_keeps_its_stature(filmed, tmp_path, monkeypatch):
    use_small_dictionaries(tmp_path, monkeypatch)
    model = tracked(filmed[1][:2], stature_m=1.893, body="92A5").motion.model
    assert model.sizes.stature_m == 1.70


def test_steps_are_weighed_by_the_exponential_alone(library):
    """Eq. (4): a sample keeps its whole probability, however many others are near."""
    follower = TreeFollower(library, CAMERA, "any", 1 / FPS, CpuBackend())
    np.testing.assert_allclose(follower._transitions.diagonal(), 1)


def test_whole_frames_are_timed(library_file, filmed):
    silhouettes, estimation, total = tracked(filmed[1], library=str(library_file)).stage_s.values()
    assert len(silhouettes) == len(estimation) == len(total) == len(filmed[1])
    assert (silhouettes + estimation < total).all()


def test_frames_without_anybody_have_no_pose(library_file, filmed):
    _, masks = filmed
    empty = np.zeros_like(masks[0])
    found = tracked([*masks[:4], empty, *masks[5:]], library=str(library_file))
    assert 4 not in found.motion.frames[~found.motion.filled]


def test_it_is_registered():
    assert isinstance(load_estimator("tree"), TreeEstimator)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"start": "up"}, "start = 'up' must be one of"),
        ({"interference": False}, "no option 'interference'"),
    ],
)
def test_wrong_options_are_refused(filmed, options, words):
    with pytest.raises(InputError, match=words):
        tracked(filmed[1], **options)


def test_other_bodies_are_refused(filmed):
    with pytest.raises(InputError, match="no person's body: leave --method paper out"):
        tracked(filmed[1], body=str(ROBOT))


def test_a_dictionary_is_built_once_and_kept(tmp_path, monkeypatch):
    use_small_dictionaries(tmp_path, monkeypatch)
    built = []
    build = tree_estimator.build_library
    monkeypatch.setattr(
        tree_estimator, "build_library", lambda *given: built.append(given) or build(*given)
    )
    first, again = (dictionary(body(), 10.0, SilentReporter()) for _ in range(2))
    assert len(built) == 1 and len(first) == len(again) <= 240
    np.testing.assert_array_equal(first.leaf_samples, again.leaf_samples)
    assert np.degrees(first.views[:, 1]) == pytest.approx(10.0)
    dictionary(body(), 20.0, SilentReporter())
    assert len(built) == 2
    for file in (tmp_path / "voxelpose" / "libraries").iterdir():
        file.write_bytes(file.read_bytes()[:1000])
    assert len(dictionary(body(), 10.0, SilentReporter())) == len(first) and len(built) == 3


def test_a_dictionary_that_cannot_be_kept_is_used(tmp_path, monkeypatch):
    (tmp_path / "voxelpose").touch()  # where its folder would be
    monkeypatch.setattr(tree_estimator, "user_cache_path", lambda name: tmp_path / name)
    monkeypatch.setattr(tree_estimator, "_SAMPLES", 240)
    notes = []

    class Noting(SilentReporter):
        def note(self, text):
            notes.append(text)

    assert len(dictionary(body(), 10.0, Noting())) <= 240
    assert "is not kept" in notes[0]
