"""body.toml: what is written is read again; what is wrong is named in one line."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.body_file import BODY_FORMAT, read_body, write_body
from silhouette_core.body.measured_body import body_from_measurements
from silhouette_core.body.mesh_measurements import BodyMeasurements, measure_body

HEAD = f'format = "{BODY_FORMAT}"\n'


def test_a_body_is_read_as_it_was_written(tmp_path):
    body = body_from_measurements(BodyMeasurements(1.66, 0.9, 0.8, 1.0, mass_kg=64.0), "female")
    write_body(body, tmp_path / "body.toml", "of somebody\nelse")
    again = read_body(tmp_path / "body.toml")
    assert again.sizes.sex == "female" and again.sizes.changes == body.sizes.changes
    np.testing.assert_allclose(again.vertices_m, body.vertices_m, atol=1e-9)
    assert (tmp_path / "body.toml").read_text().startswith("# of somebody else\n")


def test_measurements_alone_are_enough(tmp_path):
    path = tmp_path / "me.toml"
    path.write_text(HEAD + 'sex = "male"\n[measurements]\nstature_m = 1.8\nwaist_girth_m = 0.95\n')
    taken = measure_body(read_body(path))
    assert taken.stature_m == pytest.approx(1.8) and taken.waist_girth_m == pytest.approx(0.95)


@pytest.mark.parametrize(
    "text, words",
    [
        ("", "is no body file of this version"),
        ('format = "voxelpose body 9"', "is no body file of this version"),
        (HEAD, "missing required field `measurements`"),
        (HEAD + "[measurements]\nchest_girth_m = 1.0", "lacks stature_m"),
        (HEAD + "[measurements]\nstature_m = 1.7\nheight = 2", "has no 'height'"),
        (HEAD + "[measurements]\nstature_m = nan", "stature_m is nan"),
        (HEAD + '[measurements]\nstature_m = "tall"', "Expected `float`"),
        (HEAD + "[measurements]\nstature_m = 175", "stature 175.0 m is not a person's"),
        (HEAD + "[measurements]\nstature_m = 1.7\n[shape]\nnose = 1", "has no 'nose'"),
        (HEAD + "[measurements]\nstature_m = 1.7\n[shape]\nfoot_girth = 1e9", "foot_girth is 1e"),
        (HEAD + "[measurements]\nstature_m = 1.7\n[template]\nhip_change = 8", "hip_change is 8"),
        (HEAD + "[measurements]\nstature_m = 1.7\n[extra]\na = 1", "unknown field `extra`"),
        (
            HEAD + "[measurements]\nstature_m = 1.7\n[template]\nhip_change = nan",
            "hip_change is nan",
        ),
        ("format = ", "no valid TOML"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, words):
    path = tmp_path / "body.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_body(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_a_missing_and_a_huge_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_body(tmp_path / "none.toml")
    (tmp_path / "huge.toml").write_text(HEAD + "#" * 200_000)
    with pytest.raises(InputError, match="is larger than"):
        read_body(tmp_path / "huge.toml")
