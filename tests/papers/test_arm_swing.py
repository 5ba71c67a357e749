"""The arm-swing experiment: people, swings, trees, motion models and deviations."""

import json
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.tailoring import person_of, tailor
from papers import arm_swing, swing_study
from papers.arm_swing import METHODS, Case, Row, step_matrix, track_arm, window_of
from papers.swing_film import FPS, drawn_person, drawn_swings, film
from papers.swing_library import ProfileSettings, arm_motions, swing_library, wxor_weights
from papers.swing_report import cost_curve
from papers.swing_study import SIGMAS, WEIGHTINGS, Study, posing, run_study, tracked
from papers.swings import arm_angles, split_swings
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.image.distance import distances_to
from silhouette_core.progress import SilentReporter
from voxelpose.demo.choreography import Performance
from voxelpose.demo.room import demo_rig


@pytest.fixture(scope="module")
def body():
    return BodyModel.from_sizes(BodySizes(1.7))


@pytest.fixture(scope="module")
def libraries(body):
    """Of the far arm, by distance."""
    motions = arm_motions(body)
    return {one: swing_library(motions, False, 5.0, one, samples=240) for one in WEIGHTINGS}


@pytest.fixture(scope="module")
def pictures(body):
    return posing(body, SilentReporter())


def test_methods_have_the_papers_names():
    assert [str(method) for method in METHODS] == ["wXOR+DM1", "wXOR+DM2", "nwXOR+DM1", "nwXOR+DM2"]


def test_views_are_about_the_side():
    settings = ProfileSettings(middle_deg=-90, sides=3, yaw_step_deg=8, pitches_deg=(5.0,))
    np.testing.assert_allclose(np.degrees(settings.views()), [(-98, 5), (-90, 5), (-82, 5)])
    assert settings.views_count == 3


@pytest.mark.parametrize("near", [True, False])
def test_no_swing_is_like_another(near):
    rng = np.random.default_rng(1)
    actor, played = tailor(drawn_person(rng)), drawn_swings(rng, near)
    joints = [actor.pose(*played.pose_at(frame / FPS))[1] for frame in range(played.frames)]
    joints_m = np.array([[one[name] for name in LANDMARK_NAMES] for one in joints])
    angles = arm_angles(joints_m)
    swings = split_swings(angles)
    assert len(swings) == 24
    assert len({round(float(np.ptp(angles[swing]))) for swing in swings}) > 15
    assert len({swing.stop - swing.start for swing in swings}) > 5
    assert abs(angles[0]) < 15  # hanging, so that the first frame shows the stature
    centre = demo_rig(3).cameras[2].center_m
    right, left = (
        np.linalg.norm(joints_m[0, LANDMARK_NAMES.index(f"{side}_shoulder")] - centre)
        for side in ("right", "left")
    )
    assert (right < left) == near


def test_every_person_is_built_otherwise():
    rng = np.random.default_rng(0)
    people = [drawn_person(rng) for _ in range(20)]
    wide = [one.waist_girth_m / one.stature_m for one in people]
    assert np.ptp(wide) > 0.1 and np.ptp([one.arms for one in people]) > 0.05
    stout = drawn_person(rng, wide=True)
    assert stout.waist_girth_m > 1.1 * stout.chest_girth_m


@pytest.mark.parametrize("height", [60, 120])
def test_wxor_weighs_by_the_distance_from_the_contour(height):
    """In pixels of an image 240 high; a silhouette without a contour weighs 1."""
    mask = np.zeros((height, 80), bool)
    mask[10:40, 20:50] = True
    np.testing.assert_allclose(
        wxor_weights(mask), (distances_to(mask) + distances_to(~mask)) * 240 / height, rtol=1e-6
    )
    assert (wxor_weights(mask | True) == 1).all() and (wxor_weights(mask & False) == 1).all()


def test_filters_have_the_distance_of_their_library(libraries, pictures):
    one = pictures["library's build, back"]
    for name, library in libraries.items():
        kind = arm_swing._TogetherFilter
        tracker = kind(library, None, one.camera, 4.0, None, None)
        weights = tracker._weights(window_of(one, 0, library))
        assert (weights.max() > 10) == (name == "wxor")


def test_far_arm_is_hidden_at_times(libraries):
    library = libraries["nwxor"]
    right, left = (
        library.occluded[:, library.model.names.index(f"{side}_upper_arm")].mean()
        for side in ("right", "left")
    )
    assert 0.2 < right < 0.8
    assert left == 0


def test_each_tree_is_by_its_own_distance(libraries):
    for name, library in libraries.items():
        assert library.settings.weighting == name
    leaves = [set(library.levels[0].representative.tolist()) for library in libraries.values()]
    assert leaves[0] != leaves[1]


def test_density_falls_where_parts_are_hidden(libraries):
    library = libraries["nwxor"]
    free = ~library.model.tree.dof_fixed
    hidden = library.occluded[:, library.model.tree.dof_part[free]].sum(axis=1)
    hidden = hidden + 3 * library.occluded[:, 0]  # and the orientation
    density, kernel = (step_matrix(library, True, one) for one in ("density", "kernel"))
    share = np.ravel(density.sum(axis=1)) / np.ravel(kernel.sum(axis=1))
    assert hidden.min() < hidden.max()
    np.testing.assert_allclose(np.log(share) / np.log(5), hidden.min() - hidden, atol=1e-3)
    np.testing.assert_allclose(kernel.diagonal(), 1)  # the exponential of no step
    rows = step_matrix(library, True, "normalised").sum(axis=1)
    np.testing.assert_allclose(np.ravel(rows), 1, rtol=1e-5)
    one, other = (step_matrix(library, False, model) for model in ("density", "kernel"))
    assert (one != other).nnz == 0


def test_each_case_has_its_own_distance_and_motion_model(libraries, pictures, monkeypatch):
    made, steps = [], []
    step_matrix_, init = arm_swing.step_matrix, arm_swing.PaperFilter.__init__
    monkeypatch.setattr(
        arm_swing, "step_matrix", lambda *given: steps.append(given[1:]) or step_matrix_(*given)
    )
    monkeypatch.setattr(
        arm_swing.PaperFilter,
        "__init__",
        lambda self, *given, **more: made.append(given) or init(self, *given, **more),
    )
    one = pictures["library's build, back"]
    monkeypatch.setattr(arm_swing, "split_swings", lambda angles: [slice(0, 1)])
    cases = [Case(method, "density", 0.03) for method in METHODS[:2]]
    rows = track_arm(one, libraries["wxor"], cases)
    assert all(given[0] is libraries["wxor"] and given[6] == 0.03 for given in made)
    assert steps == [(False, "density"), (True, "density")]
    assert [row.case for row in rows] == cases


def test_filters_side_by_side_find_what_each_finds_alone(libraries, pictures, monkeypatch):
    monkeypatch.setattr(arm_swing, "split_swings", lambda angles: [slice(0, 2)])
    one, other = list(pictures.values())[:2]
    both = replace(
        one, bits=np.vstack([one.bits, other.bits]), truth_deg=np.r_[one.truth_deg, other.truth_deg]
    )
    cases = [Case(method, "kernel", sigma) for method in METHODS[2:] for sigma in (0.02, 0.2)]
    together = [row.angles_deg for row in track_arm(both, libraries["nwxor"], cases)]
    alone = [track_arm(both, libraries["nwxor"], [case])[0].angles_deg for case in cases]
    np.testing.assert_array_equal(together, alone)
    assert (np.diff(together, axis=1) != 0).all()  # another picture, another arm


def test_sigma_is_the_one_that_errs_least_on_others(libraries, monkeypatch):
    asked = []

    def tracking(film, library, cases):
        asked.append((film, library, cases))
        best = {False: 0.01, True: 0.04}
        return [
            Row(case, {}, np.zeros(1), abs(case.sigma - best[case.method.occlusion_aware]))
            for case in cases
        ]

    monkeypatch.setattr(swing_study, "track_arm", tracking)
    rows = tracked(libraries["nwxor"], SIGMAS, ["other"], ["a", "b"])
    assert [film for film, _, _ in asked] == ["other", "a", "b"]
    assert len(asked[0][2]) == 5 * len(SIGMAS)
    assert {(row.case.method.weighting, len(one)) for one in rows for row in one} == {("nwxor", 2)}
    assert [(one[0].case.method.occlusion_aware, one[0].case.sigma) for one in rows] == [
        *[(False, 0.01)] * 2,
        *[(True, 0.04)] * 3,
    ]


def test_wxor_prefers_a_hidden_arm_to_one_elsewhere(libraries, body):
    """Why the paper normalises: by (8) an arm of the silhouette that the pose hides costs little,
    and an arm of the pose beside the silhouette much.
    """
    keys = np.array([[k / FPS, -50.0, arm, 15.0] for k, arm in enumerate((-40, 0, 60, 60))])
    played = Performance("yaw r_arm r_elbow", keys, FPS, interpolation="linear")
    seen = film(person_of(body), played, np.random.default_rng(0), SilentReporter())
    back, hidden, forth = (window_of(seen, k, libraries["wxor"]) for k in range(3))
    shares = []
    for library in libraries.values():
        weights = library.settings.weights(back, libraries["wxor"].bounds_px)
        shares.append(weights[back ^ hidden].sum() / weights[back ^ forth].sum())
    assert shares[0] < 0.7 * shares[1]


def test_costs_are_relative_to_the_true_angle(libraries, pictures):
    for level in (0, -1):
        angle, ratio = cost_curve(pictures["library's build, back"], libraries["wxor"], level)
        assert ratio[np.abs(angle + 40).argmin()] == 1
        assert ratio[angle > 60].min() > 1.5


@pytest.mark.accuracy
def test_the_whole_study(tmp_path, monkeypatch):
    monkeypatch.setattr(swing_study, "_OTHER_SEEDS", (101,))
    monkeypatch.setattr(swing_study, "_OTHER_SWINGS", 1)
    study = Study((1,), 1, 120, sigmas=(0.04,))
    sides = run_study(study, tmp_path, SilentReporter())
    assert [side.near for side in sides] == [False, True]
    assert all(len(side.rows) == 10 for side in sides)
    about = json.loads((tmp_path / "summary.json").read_text())
    assert len(about["sides"][1]["rows"]) == 10
    assert (tmp_path / "table.md").read_text().count("\n") == 22
    assert (tmp_path / "angles.png").exists() and (tmp_path / "costs.png").exists()
