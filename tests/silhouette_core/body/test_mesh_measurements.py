"""Measurements on a mesh: against shapes of known size, and against another library's slices."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from silhouette_core.body.joints import PART_NAMES
from silhouette_core.body.mesh_measurements import (
    DENSITY_KG_M3,
    TapeMeasure,
    enclosed_volume,
    measure_body,
)
from silhouette_core.body.model import BodyModel, read_template
from silhouette_core.body.sizes import SHAPE_AXES, BodySizes

TEMPLATES = pytest.mark.parametrize("sex", ["male", "female"])


def test_girth_of_a_cylinder_and_volume_of_a_ball():
    tube = trimesh.creation.cylinder(radius=0.2, height=1.0, sections=400)
    faces = np.asarray(tube.faces, np.int32)
    tape = TapeMeasure(faces, faces, np.zeros(0, int), np.zeros((2, 3), np.int32), np.zeros((2, 3)))
    for height in (-0.4, 0.1234, 0.4):
        assert tape.girth(np.asarray(tube.vertices), height) == pytest.approx(
            2 * np.pi * 0.2, rel=1e-4
        )
    ball = trimesh.creation.icosphere(5, radius=0.3)
    moved = np.asarray(ball.vertices) + np.array([1.0, -2.0, 3.0])
    assert enclosed_volume(moved, np.asarray(ball.faces, np.int32)) == pytest.approx(
        4 / 3 * np.pi * 0.027, rel=2e-3
    )


@TEMPLATES
def test_the_template_has_the_girth_that_it_was_made_with(sex):
    template = read_template(sex)
    taken = measure_body(template)
    assert taken.stature_m == pytest.approx(template.sizes.stature_m, abs=1e-4)
    assert taken.chest_girth_m == pytest.approx(template.sizes.chest_girth_m, rel=0.01)


@TEMPLATES
def test_girths_are_those_of_slices_by_trimesh(sex):
    body = BodyModel.from_sizes(BodySizes(1.7, 0.95, sex))
    taken = measure_body(body)
    mesh = trimesh.Trimesh(body.vertices_m, body.faces, process=False)
    low, high = (body.joints_m[PART_NAMES.index(name), 2] for name in ("abdomen", "thorax"))
    section = mesh.section([0, 0, 1], [0, 0, low + 0.3 * (high - low)])
    loops = [loop[:, :2] for loop in section.discrete]
    middle = [loop for loop in loops if loop[:, 0].min() < 0 < loop[:, 0].max()]
    assert taken.waist_girth_m == pytest.approx(ConvexHull(middle[0]).area, rel=1e-6)
    assert taken.mass_kg == pytest.approx(mesh.volume * DENSITY_KG_M3, rel=1e-6)


@TEMPLATES
def test_measurements_grow_with_the_body(sex):
    small, large = (BodyModel.from_sizes(BodySizes(s, None, sex)) for s in (1.2, 1.8))
    for name, value in measure_body(small).known().items():
        power = 3 if name == "mass_kg" else 1
        assert getattr(measure_body(large), name) == pytest.approx(value * 1.5**power, rel=1e-6)


@TEMPLATES
def test_lengths_follow_the_axis_that_changes_them(sex):
    body = BodyModel.from_sizes(BodySizes(1.7, None, sex))
    before = measure_body(body)
    names = [axis.name for axis in SHAPE_AXES]
    longer = np.zeros(len(names))
    longer[names.index("forearm_length")] = 0.1
    after = measure_body(body.reshaped(longer))
    elbow, wrist = (body.joints_m[PART_NAMES.index(f"left_{n}")] for n in ("forearm", "hand"))
    assert after.arm_length_m - before.arm_length_m == pytest.approx(
        0.1 * np.linalg.norm(wrist - elbow), rel=1e-6
    )
    same = replace(after, arm_length_m=before.arm_length_m, mass_kg=before.mass_kg)
    assert list(same.known().values()) == pytest.approx(list(before.known().values()), rel=1e-9)


def test_the_mans_acromia_are_as_far_apart_as_a_mans():
    """Biacromial breadth over stature, ANSUR II."""
    taken = measure_body(read_template("male"))
    assert taken.shoulder_breadth_m / taken.stature_m == pytest.approx(0.237, rel=0.01)
