"""From one camera's silhouettes to motion."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.library_fuzz_targets import unlearned_proposal
from benchmarks.silhouette_source import SilhouetteSource
from calib.camera import Rig
from calib.errors import InputError
from calib.upright import UprightFrame
from silhouette_core.body.body_file import write_body
from silhouette_core.body.sizes import SHAPE_SIGMA
from silhouette_core.estimator import Settings
from silhouette_core.monocular.monocular_estimator import MonocularEstimator
from silhouette_core.monocular.monocular_stages import MonocularOptions, person_for
from silhouette_core.monocular.proposal.shipped import shipped_proposal
from silhouette_core.monocular.tracking import trajectory
from silhouette_core.monocular.tree.store import write_library
from silhouette_core.progress import SilentReporter
from tests.silhouette_core.monocular.filming import STATURE_M, body, camera_at, films, performed

CAMERA = camera_at((1.0, -3.9, 1.4))
ROWS = range(0, 30, 3)
FPS = 10.0
EMPTY = np.zeros(CAMERA.size[::-1], bool)


@pytest.fixture(scope="module")
def filmed():
    """Somebody of another build waves; the joints at the frames taken, and the silhouettes."""
    other = body(0.7 * SHAPE_SIGMA * np.random.default_rng(5).standard_normal(len(SHAPE_SIGMA)))
    motion = performed("wave", other)
    return motion.landmarks()[ROWS], films(motion, CAMERA, ROWS)


def tracking(library=""):
    """Tracks silhouettes, with options."""

    def run(masks, threads=1, smooth=True, camera=CAMERA, **options):
        settings = Settings(
            STATURE_M, smooth=smooth, threads=threads, options={"library": str(library), **options}
        )
        return MonocularEstimator().estimate(
            SilhouetteSource(camera, masks, FPS), settings, SilentReporter()
        )

    return run


@pytest.fixture(scope="module")
def track():
    return tracking()


@pytest.fixture(scope="module")
def quick(quick_library_file):
    """With a proposal that says the same of every frame."""
    return tracking(quick_library_file)


@pytest.fixture(scope="module")
def tracked(track, filmed):
    return track(filmed[1])


@pytest.fixture(scope="module")
def causal(track, filmed):
    """From previous frames alone."""
    return track(filmed[1], smooth=False)


@pytest.fixture(scope="module")
def quickly(quick, filmed):
    return quick(filmed[1])


def root_mm(found, truth):
    return 1000 * np.linalg.norm((found - found[:, :1]) - (truth - truth[:, :1]), axis=-1).mean()


@pytest.mark.slow
def test_the_motion_is_found(tracked, filmed):
    truth, _ = filmed
    joints = tracked.motion.landmarks()
    assert len(tracked.motion) == len(truth)
    assert root_mm(joints, truth) < 90
    assert np.linalg.norm(joints[:, 0] - truth[:, 0], axis=-1).mean() < 0.25
    assert tracked.motion.quality["outline_agreement"].min() > 0.8
    assert tracked.facts["frames_absent"] == []


@pytest.mark.slow
def test_blocks_of_frames_are_joined(track, tracked, filmed, monkeypatch):
    """What follows a block starts from the hypotheses that were chosen at its end."""
    monkeypatch.setattr(trajectory, "_BLOCK", 3)
    monkeypatch.setattr(trajectory, "_AHEAD", 2)
    truth, masks = filmed
    joints = track(masks).motion.landmarks()
    assert len(joints) == len(truth)
    assert root_mm(joints, truth) < 1.3 * root_mm(tracked.motion.landmarks(), truth)


def test_hypotheses_belong_to_frames(quickly):
    result = list(quickly.hypotheses)
    assert [frame for frame, _, _ in result] == list(range(len(ROWS)))
    for _, probability, _ in result:
        assert (np.diff(probability) <= 0).all() and 0 < probability.sum() <= 1 + 1e-6


@pytest.mark.slow
def test_every_frame_from_the_past_alone(track, causal, filmed):
    """Without looking ahead, what comes later changes nothing of what was said; nor do threads."""
    truth, masks = filmed
    part = track(masks[:6], threads=2, smooth=False)
    np.testing.assert_array_equal(causal.motion.angles_rad[:6], part.motion.angles_rad)
    np.testing.assert_array_equal(causal.motion.root_m[:6], part.motion.root_m)
    assert root_mm(causal.motion.landmarks(), truth) < 110


def test_who_is_not_there_is_not_invented(quick, filmed):
    masks = list(filmed[1])
    masks[3:6] = [EMPTY] * 3
    estimate = quick(masks, smooth=False)
    assert estimate.motion.frames.tolist() == [0, 1, 2, 6, 7, 8, 9]
    assert estimate.facts["frames_absent"] == [3, 4, 5]
    assert estimate.absent_frames == {3, 4, 5}


def test_who_is_seen_and_not_found_is_not_away(quick, filmed):
    masks = list(filmed[1])
    part = np.zeros_like(masks[4])
    rows, columns = np.nonzero(masks[4])
    part[rows[: len(rows) // 10], columns[: len(rows) // 10]] = True  # too little to be the person
    masks[4], masks[5] = part, EMPTY
    estimate = quick(masks, smooth=False)
    assert estimate.facts["frames_absent"] == [4, 5]
    assert estimate.absent_frames == {5}


def test_nobody_at_all_is_one_clear_line(quick):
    with pytest.raises(InputError, match="cam_1 shows nobody in any frame"):
        quick([EMPTY] * 4)


def test_a_person_is_not_tracked_without_a_proposal(library, filmed, tmp_path):
    write_library(library, tmp_path / "plain.vplib")
    words = r"plain\.vplib: the library has no proposal, .* voxelpose library build"
    with pytest.raises(InputError, match=words):
        tracking(tmp_path / "plain.vplib")(filmed[1][:2])


def test_a_person_cut_by_the_border_is_said(quick):
    camera = camera_at((1.0, -3.9, 1.4), (0.0, 0, 1.75))  # the feet are below the picture
    masks = films(performed("wave"), camera, ROWS[:3])
    estimate = quick(masks, camera=camera, smooth=False)
    assert estimate.facts["frames_cut_by_the_border"] == [0, 1, 2]
    assert estimate.motion.quality["cut"].all()
    whole = quick(films(performed("wave"), CAMERA, ROWS[:2]), smooth=False)
    assert not whole.motion.quality["cut"].any()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"libary": "x"}, "no option 'libary'"),
        ({"start": "sideways"}, "start = 'sideways' must be one of facing, any"),
        ({"outline_only": "yes"}, "outline_only = 'yes' must be true or false"),
        ({"library": 3}, "library = '3' must be text"),
    ],
)
def test_options_misspelt_are_refused(quick, options, words):
    with pytest.raises(InputError, match=words):
        quick([EMPTY], **options)


def test_two_cameras_are_too_many(quick_library_file):
    source = SilhouetteSource(CAMERA, [EMPTY])
    source.rig = Rig((CAMERA, replace(CAMERA, name="cam_2")))
    with pytest.raises(InputError, match=r"2 cameras are too many .* --camera"):
        MonocularEstimator().estimate(
            source, Settings(options={"library": str(quick_library_file)}), SilentReporter()
        )


@pytest.mark.slow
def test_the_calibrations_axes_change_nothing(track, causal, filmed):
    """A world with z downward, told from the camera alone: the same motion, in that world."""
    turned = UprightFrame.from_up([0.0, 0.0, -1.0])
    camera = replace(CAMERA, rotation=CAMERA.rotation @ turned.rotation)
    other = track(filmed[1][:4], camera=camera, smooth=False)
    np.testing.assert_allclose(other.motion.up, [0, 0, -1])
    np.testing.assert_allclose(
        other.motion.upright().landmarks(), causal.motion.landmarks()[:4], atol=1e-6
    )
    for (_, _, there), (_, _, here) in zip(other.hypotheses, causal.hypotheses, strict=False):
        np.testing.assert_allclose(turned.points(there), here, atol=1e-4)


def test_a_given_body_is_kept(quick, filmed, tmp_path):
    person = body(0.5 * SHAPE_SIGMA)
    write_body(person, tmp_path / "body.toml")
    motion = quick(filmed[1][:3], body=str(tmp_path / "body.toml")).motion
    np.testing.assert_allclose(motion.model.vertices_m, person.vertices_m, atol=1e-9)
    with pytest.raises(InputError, match="there is no body nobody"):
        quick(filmed[1], body="nobody")


def test_who_is_tracked(quick_library_file, library):
    """The body is the one that is described; the proposal serves everybody."""

    def person(library_file="", body="", **described):
        options = MonocularOptions(library=str(library_file), body=body)
        return person_for(options, Settings(**described), SilentReporter())

    woman = person(stature_m=1.6, chest_m=0.9, sex="female").model.sizes
    assert (woman.stature_m, woman.chest_girth_m, woman.sex) == (1.6, 0.9, "female")
    assert person().proposal is shipped_proposal()
    given = person(quick_library_file)
    assert given.proposal.network.modes == unlearned_proposal().network.modes
    assert given.model.sizes == library.model.sizes
    assert person(quick_library_file, stature_m=1.9).model.sizes.stature_m == 1.9
    assert person(quick_library_file, sex="female").model.sizes.sex == "female"
    with pytest.raises(InputError, match=r"nobody\.json"):
        person(body="nobody.json")
