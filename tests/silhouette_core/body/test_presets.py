"""The paper's 24 bodies: their numbers follow the designations, and their meshes have them."""

import re

import pytest

from calib.errors import InputError
from silhouette_core.body.mesh_measurements import measure_body
from silhouette_core.body.presets import SOURCES, body_preset, body_presets, nearest_preset

DROPS_CM = {"Y": 16, "YA": 14, "A": 12, "AB": 10, "B": 8, "BB": 6, "BE": 4, "E": 0}
HEIGHTS_CM = {"PP": 142, "P": 150, "R": 158, "T": 166}
HIPS_CM = {"Y": -4, "A": 0, "AB": 4, "B": 8}


def test_ten_men_and_fourteen_women():
    sexes = [preset.sex for preset in body_presets()]
    assert sexes == ["male"] * 10 + ["female"] * 14
    assert len({preset.name for preset in body_presets()}) == 24
    assert {source for preset in body_presets() for source in preset.sources.values()} == set(
        SOURCES.values()
    )


@pytest.mark.parametrize("preset", body_presets()[:10], ids=lambda preset: preset.name)
def test_men_are_what_their_designation_says(preset):
    chest, build, number = re.fullmatch(r"(\d+)([A-Z]+)(\d)", preset.name).groups()
    sizes = preset.measurements
    assert sizes.chest_girth_m == pytest.approx(int(chest) / 100)
    assert sizes.chest_girth_m - sizes.waist_girth_m == pytest.approx(DROPS_CM[build] / 100)
    assert sizes.stature_m == pytest.approx(1.45 + 0.05 * int(number))
    assert sizes.hip_girth_m == pytest.approx(0.53 + sizes.waist_girth_m / 2)


@pytest.mark.parametrize("preset", body_presets()[10:], ids=lambda preset: preset.name)
def test_women_are_what_their_designation_says(preset):
    number, build, height = re.fullmatch(r"(\d+)(AB|A|Y|B)([A-Z]+)", preset.name).groups()
    sizes, other = preset.measurements, int(number) - 9
    assert sizes.chest_girth_m == pytest.approx((83 + 3 * other / 2) / 100)
    assert sizes.stature_m == pytest.approx(HEIGHTS_CM[height] / 100)
    usual = 91 + other + {"PP": -4, "P": -2, "R": 0, "T": 2}[height]
    assert sizes.hip_girth_m == pytest.approx((usual + HIPS_CM[build]) / 100)


@pytest.mark.parametrize("preset", body_presets(), ids=lambda preset: preset.name)
def test_the_bodies_have_these_measurements(preset):
    taken = measure_body(preset.body()).known()
    for name, value in preset.measurements.known().items():
        assert taken[name] == pytest.approx(value, rel=0.005)


def test_the_closest_is_chosen():
    assert nearest_preset(1.70, 0.92, "male").name == "92A5"
    assert nearest_preset(1.71, 0.925, "male").name == "92A5"
    assert nearest_preset(1.59, 0.83, "female").measurements.stature_m == 1.58
    assert nearest_preset(1.42, None).name == "9APP"
    assert {
        nearest_preset(p.measurements.stature_m, p.measurements.chest_girth_m, p.sex).name
        for p in body_presets()[:10]
    } == {p.name for p in body_presets()[:10]}
    with pytest.raises(InputError, match="stature 17 m"):
        nearest_preset(17, 0.9)


def test_names_are_found_in_any_case():
    assert body_preset("92a5") is body_preset("92A5") is not None
    assert body_preset("92A99") is None
