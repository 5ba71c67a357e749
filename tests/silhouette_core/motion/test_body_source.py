"""A body by a name, from a file, and from a result."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.body_file import write_body
from silhouette_core.body.presets import body_preset
from silhouette_core.motion.body_source import load_body, names_result, resolved_body
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import MOTION, write_motion


@pytest.fixture(scope="module")
def body():
    return body_preset("13ABP").body()


def test_by_name_from_a_file_and_from_a_result(body, tmp_path):
    write_body(body, tmp_path / "body.toml")
    still = np.zeros((1, body.dof_count))
    motion = Motion(
        25.0, body, np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), still, np.array([0]), np.zeros(1)
    )
    write_motion(motion, tmp_path / MOTION)
    for spec in (
        "13ABP",
        "13abp",
        str(tmp_path / "body.toml"),
        str(tmp_path),
        str(tmp_path / MOTION),
    ):
        found = load_body(spec)
        np.testing.assert_allclose(found.vertices_m, body.vertices_m, atol=1e-9)
        np.testing.assert_allclose(found.joints_m, body.joints_m, atol=1e-9)
        assert found.sizes.changes == body.sizes.changes
        assert names_result(spec) == (spec in (str(tmp_path), str(tmp_path / MOTION)))


def test_what_is_no_body_is_named(tmp_path):
    with pytest.raises(InputError, match="there is no body nobody: give one of 84A3, "):
        load_body("nobody")
    with pytest.raises(InputError, match="holds no body"):
        load_body(str(tmp_path))


def test_paths_are_made_absolute_and_names_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert resolved_body("92a5") == "92a5"
    assert resolved_body("me.toml") == str(tmp_path / "me.toml")
