"""Recipes of rendered recordings: people of the stated size, and truth that is exact."""

import hashlib
from pathlib import Path

import numpy as np
import pytest
import trimesh

from benchmarks.recipes import Recipe, read_recipes
from benchmarks.tailoring import Measurements, tailor
from calib.errors import InputError
from silhouette_core.image.raster import render_parts
from voxelpose.demo.choreography import performances
from voxelpose.demo.mannequin import BONE_NAMES, Mannequin
from voxelpose.evaluation import score_motion
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth

RECIPES = Path(__file__).resolve().parents[1] / "datasets" / "made" / "recipes.toml"
SHORT_HEAVY = Recipe(Measurements(1.50, 1.14, 1.10, 1.18), 1, "arm_swing", [2, 3, 5], 3)


def test_the_standard_actor_stays_as_it_is():
    vertices, _ = Mannequin.build().pose(*performances()["golf"].pose_at(1.3))
    digest = hashlib.sha256(np.round(1e6 * vertices).astype("<i4").tobytes()).hexdigest()
    assert digest.startswith("a5178a651fecf118")


def test_a_recipe_renders_a_recording_that_opens_and_whose_truth_is_exact(tmp_path):
    folder = SHORT_HEAVY.render(tmp_path / "made")
    recording = Recording.open(folder)
    assert recording.rig.names == ("cam_2", "cam_3", "cam_5") and recording.frame_count == 3
    assert recording.subject.stature_m == 1.50
    truth = read_truth(folder / "truth.json")
    assert score_motion(truth, truth).mpjpe_mm == 0
    first = (folder / "cam_2.mp4").stat().st_mtime_ns
    assert SHORT_HEAVY.render(folder) == folder
    assert (folder / "cam_2.mp4").stat().st_mtime_ns == first


@pytest.mark.parametrize("name", read_recipes(RECIPES))
def test_silhouettes_are_as_tall_as_the_stature(name):
    person = read_recipes(RECIPES)[name].person
    actor = tailor(person)
    vertices, joints = actor.pose(np.zeros(2), {})
    assert joints["head_top"][2] == pytest.approx(person.stature_m + person.sole_m, abs=1e-9)
    # From 100 m at half the height no part is enlarged by being nearer.
    matrix = np.array([[50000.0, 0, 300], [0, 50000.0, 700], [0, 0, 1]])
    seen = np.stack([vertices[:, 0], 1.0 - vertices[:, 2], vertices[:, 1] + 100], axis=1)
    labels = np.zeros(len(actor.faces), np.int32)
    silhouette = render_parts(seen, actor.faces, labels, matrix, (600, 1200))[0] > 0
    height_m = np.count_nonzero(silhouette.any(axis=1)) * 100 / 50000
    assert height_m == pytest.approx(person.stature_m, rel=0.01)


def test_girths_are_those_over_skin_and_cloth():
    person = Measurements(1.50, 1.14, 1.10, 1.18, cloth_m=0.012)
    actor = tailor(person)
    mesh = trimesh.Trimesh(actor.vertices_m, actor.faces, process=False)
    assert mesh.is_watertight and min(piece.volume for piece in mesh.split()) > 0
    for bone, girth in (("pelvis", 1.18), ("belly", 1.10), ("chest", 1.14)):
        own = actor.vertex_bone == BONE_NAMES.index(bone)
        rings = actor.vertices_m[own][:-2].reshape(-1, 24, 3)
        around = np.linalg.norm(rings - np.roll(rings, 1, axis=1), axis=2).sum(axis=1)
        skin = around - 2 * np.pi * person.cloth_m
        assert np.abs(skin - girth).min() < 0.02 * girth, (bone, skin)


def test_legs_of_another_length_walk_as_far_as_they_reach():
    short, tall = (tailor(Measurements(stature, 0.9, 0.8, 0.95)).stride for stature in (1.5, 1.9))
    assert short < 0.9 and tall > 1.1


def test_all_recipes_are_known_and_unlike_each_other():
    recipes = read_recipes(RECIPES)
    assert 6 <= len(recipes) <= 8
    assert {recipe.performance for recipe in recipes.values()} <= set(performances())
    assert {len(recipe.cameras) for recipe in recipes.values()} == {1, 3, 4, 8}
    statures = [recipe.person.stature_m for recipe in recipes.values()]
    assert min(statures) <= 1.5 and max(statures) >= 1.9


def test_a_damaged_recipe_is_named(tmp_path):
    file = tmp_path / "recipes.toml"
    file.write_text("[one]\nseed = 1\ncameras = [1]\n")
    with pytest.raises(InputError, match=r"recipes\.toml cannot be read as recipes"):
        read_recipes(file)
