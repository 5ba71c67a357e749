"""A person's body from several recordings: clothes told from the body, errors that are honest."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.body_file import read_body, write_body
from silhouette_core.body.mesh_measurements import measure_body
from silhouette_core.body.sizes import SHAPE_AXES
from silhouette_core.estimator import Settings
from silhouette_core.progress import SilentReporter
from silhouette_core.refinement.adaptation import Stature
from silhouette_core.scoring.backend import load_backend
from tests.voxelpose.multiview.matching_scenes import (
    STATURE_M,
    fitting_model,
    observe,
    stance,
    views,
)
from voxelpose.multiview.matching.pose_search import BodyGeometry
from voxelpose.multiview.person import body_estimate
from voxelpose.multiview.person.body_choice import Start
from voxelpose.multiview.person.body_estimate import BodyEstimate, PosedFrames, estimate_body
from voxelpose.multiview.person.body_refit import AdaptedBody

TRUE = {"thigh_length": 0.05, "trunk_width": 0.06, "shirt": 0.008, "trousers": 0.012}
TURNS = (
    {},
    {"left_thigh.flexion": 40.0, "left_shin.flexion": 50.0},
    {"right_upper_arm.abduction": 45.0},
)


def posed(body, cameras, seed):
    rng, model = np.random.default_rng(seed), fitting_model()
    poses = [stance(body, turns) for turns in TURNS]
    start = Start(
        BodyGeometry.from_model(model, 0.04, load_backend("cpu")),
        {},
        {},
        Stature(STATURE_M, 0.05),
        model.shape,
        None,
    )
    moved = [
        pose.moved(
            np.r_[0.015 * rng.normal(size=6), 0.03 * rng.normal(size=len(pose.angles_rad))]
        ).clipped()
        for pose in poses
    ]
    return PosedFrames(start, [observe(views(cameras), body, pose) for pose in poses], moved)


@pytest.mark.slow
def test_clothes_are_told_from_the_body_and_errors_hold_the_truth(tmp_path):
    body = fitting_model().reshaped(np.array([TRUE.get(axis.name, 0.0) for axis in SHAPE_AXES]))
    seen = [posed(body, 4, 0), posed(body, 6, 1)]
    found = estimate_body(seen, Settings(), SilentReporter())
    assert found.frames == 6
    clothes = found.clothes_m()
    assert clothes["shirt"] == pytest.approx(0.008 * STATURE_M, abs=0.006)
    assert clothes["trousers"] == pytest.approx(0.012 * STATURE_M, abs=0.006)
    write_body(
        found.model,
        tmp_path / "me.toml",
        standard_errors=dict(zip(found.names, found.standard_errors(), strict=True)),
    )
    again = read_body(tmp_path / "me.toml")
    np.testing.assert_allclose(again.vertices_m, found.model.vertices_m, atol=1e-6)
    bare = body.reshaped(
        np.array([TRUE.get(axis.name, 0.0) * (not axis.is_clothing) for axis in SHAPE_AXES])
    )
    true = measure_body(bare).known()
    told = dict(zip(found.names, found.standard_errors(), strict=True))
    own = found.model.reshaped(
        np.array(
            [
                0.0 if axis.is_clothing else value
                for axis, value in zip(SHAPE_AXES, found.model.shape, strict=True)
            ]
        )
    )
    for name, value in measure_body(own).known().items():
        assert 0 < told[name] < 0.15 * value
        assert abs(value - true[name]) < 2.5 * told[name], name


def test_no_recording_is_no_body():
    with pytest.raises(InputError, match="no recording"):
        estimate_body([], Settings(), SilentReporter())


def test_standard_errors_are_those_of_the_bare_body_and_tripled():
    model, bare = dressed(), fitting_model()
    length = [axis.name for axis in SHAPE_AXES].index("thigh_length")
    covariance = np.zeros((len(SHAPE_AXES),) * 2)
    exact = BodyEstimate(model, covariance, 6, 0.1).standard_errors()
    value = np.array([*measure_body(bare).known().values()])
    names = BodyEstimate(model, covariance, 6, 0.1).names
    usual = [{"stature_m": 0.005, "mass_kg": 0.1}.get(name, 0.04) for name in names]
    np.testing.assert_allclose(exact, usual * value, rtol=1e-3)
    covariance[length, length] = 0.01**2
    longer = bare.reshaped(np.eye(len(SHAPE_AXES))[length] * 0.01)
    change = np.array([*measure_body(longer).known().values()]) - value
    found = BodyEstimate(model, covariance, 6, 0.1).standard_errors()
    np.testing.assert_allclose(np.sqrt(found**2 - exact**2), 3 * np.abs(change), atol=2e-4)


def test_clothes_are_told_in_metres():
    assert BodyEstimate(dressed(), np.eye(len(SHAPE_AXES)), 6, 0.1).clothes_m() == pytest.approx(
        {"shirt": 0.02 * STATURE_M, "trousers": 0.0}
    )


def test_statures_count_by_their_errors_and_the_best_start_is_taken(monkeypatch):
    def start(metres, sigma_m, shape):
        body = BodyGeometry.from_model(fitting_model().reshaped(shape), 0.06, load_backend("cpu"))
        return PosedFrames(Start(body, {}, {}, Stature(metres, sigma_m), shape, None), [], [])

    nothing = np.zeros(len(SHAPE_AXES))
    wide = np.where([axis.name == "trunk_width" for axis in SHAPE_AXES], 0.1, 0.0)
    told = []

    costs = iter([-1.0, -3.0])

    def adapted(surface, prior, observations, poses, stature, backend):
        told.append(stature)
        return AdaptedBody(surface, poses, 0.1, next(costs))

    monkeypatch.setattr(body_estimate, "adapted_to", adapted)
    monkeypatch.setattr(body_estimate, "shape_covariance", lambda *_: np.eye(len(nothing)))
    starts = [start(1.70, 0.02, nothing), start(1.80, 0.01, wide)]
    found = estimate_body(starts, Settings(sex="male"), SilentReporter())
    assert [one.metres for one in told] == pytest.approx([1.78, 1.78])
    assert told[0].sigma_m == pytest.approx(0.01) and found.error == 0.1
    np.testing.assert_allclose(found.model.shape, wide)


def dressed():
    """A body with a shirt of 2 per cent of its stature."""
    return fitting_model().reshaped(
        np.where([axis.name == "shirt" for axis in SHAPE_AXES], 0.02, 0.0)
    )
