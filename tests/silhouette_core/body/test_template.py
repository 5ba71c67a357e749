"""The shipped template bodies: closed, symmetric, of the stated size, with sensible skin; and that
their maker still makes such.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from safetensors import safe_open
from scipy.spatial import ConvexHull, cKDTree

import silhouette_core.body as body
from silhouette_core.body.joints import LANDMARK_NAMES, PARENTS, PART_NAMES
from tests.silhouette_core.body.test_body_model import MIRROR, solid_angle

FOLDER = Path(body.__file__).parent
LEFT = np.array([n.startswith("left") for n in PART_NAMES])
RIGHT = np.array([n.startswith("right") for n in PART_NAMES])


@pytest.fixture(params=["man", "woman"])
def body(request):
    with safe_open(str(FOLDER / f"{request.param}.safetensors"), framework="numpy") as file:
        return {key: file.get_tensor(key) for key in file.keys()}, file.metadata()  # noqa: SIM118


def assert_body(arrays, about, tolerance=0.005):
    """Everything that has to hold for any resolution."""
    vertices, faces = arrays["vertices_m"].astype(float), arrays["faces"]
    stature = float(about["stature"])
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.body_count == 1
    assert mesh.euler_number == 2
    assert 0.0120 < mesh.volume / stature**3 < 0.0145  # body mass indices of about 19.5 to 24
    np.testing.assert_allclose(
        [vertices[:, 2].min(), vertices[:, 2].max()], [0, stature], atol=1e-4
    )
    assert (np.bincount(arrays["face_part"], minlength=27) > 0).all() and arrays[
        "face_part"
    ].max() == 26
    check_skin(arrays)
    check_mirrored(arrays)
    np.testing.assert_allclose(
        chest_girth(mesh, stature), float(about["chest_girth"]), rtol=tolerance
    )


def check_skin(arrays):
    parts, weights = arrays["skin_parts"], arrays["skin_weights"]
    assert parts.shape == weights.shape == (len(arrays["vertices_m"]), 4)
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-5)
    assert weights.min() >= 0 and parts.min() >= 0 and parts.max() < 27
    dense = np.zeros((len(parts), 27))
    np.add.at(dense, (np.arange(len(parts))[:, None], parts), weights)
    x = arrays["vertices_m"][:, 0]
    assert dense[x > 0.025][:, RIGHT].max() == 0 and dense[x < -0.025][:, LEFT].max() == 0
    arm = [
        PART_NAMES.index(f"left_{name}")
        for name in ("upper_arm", "forearm", "hand", "thumb", "fingers")
    ]
    leg = [PART_NAMES.index(f"left_{name}") for name in ("thigh", "shin", "foot", "toes")]
    assert (np.minimum(dense[:, arm].sum(1), dense[:, leg].sum(1)) == 0).all()
    height = float(arrays["vertices_m"][:, 2].max())
    flank = (np.abs(x) < 0.085 * height) & (arrays["vertices_m"][:, 2] < 0.72 * height)
    assert dense[flank][:, arm].max() == 0
    # The two strongest parts of a vertex are neighbours in the tree, or siblings.
    first, second = np.argsort(-dense, 1)[:, :2].T
    blended = dense[np.arange(len(dense)), second] > 0.2
    a, b = first[blended], second[blended]
    assert (
        (PARENTS[a] == b)
        | (PARENTS[b] == a)
        | (PARENTS[a] == PARENTS[b])
        | (PARENTS[PARENTS[a]] == b)
        | (PARENTS[PARENTS[b]] == a)
    ).all()


def check_mirrored(arrays):
    vertices, mirror = arrays["vertices_m"], np.array([-1, 1, 1], np.float32)
    assert cKDTree(vertices).query(vertices * mirror)[0].max() == 0
    np.testing.assert_allclose(arrays["joints_m"][MIRROR] * mirror, arrays["joints_m"], atol=1e-6)
    counts = np.bincount(arrays["face_part"], minlength=27)
    np.testing.assert_array_equal(counts, counts[MIRROR])


def chest_girth(mesh, stature):
    """Hull of the slice at the nipples, without the arms."""
    loops = mesh.section([0, 0, 1], [0, 0, 0.728 * stature]).discrete
    loop = max((loop for loop in loops if loop[:, 0].min() < 0 < loop[:, 0].max()), key=len)
    return ConvexHull(loop[:, :2]).area


def test_shipped_files(body):
    arrays, about = body
    assert_body(arrays, about)
    assert 4000 < len(arrays["faces"]) < 5000
    assert json.loads(about["parts"]) == list(PART_NAMES) and json.loads(
        about["landmarks"]
    ) == list(LANDMARK_NAMES)


def test_joints_lie_inside_their_limbs(body):
    arrays, _ = body
    mesh = trimesh.Trimesh(arrays["vertices_m"].astype(float), arrays["faces"], process=False)
    for joint, name in zip(arrays["joints_m"].astype(float), PART_NAMES, strict=True):
        # That of a closed surface seen from inside is the whole sphere.
        assert abs(solid_angle(mesh, joint) / (4 * np.pi) - 1) < 1e-3, name


def test_triangles_are_even_enough_to_bend(body):
    arrays, about = body
    corners = arrays["vertices_m"][arrays["faces"]] / float(about["stature"])
    longest = max(np.linalg.norm(corners[:, k] - corners[:, k - 1], axis=1).max() for k in range(3))
    assert longest < 0.035


@pytest.mark.slow
def test_the_maker_makes_such_bodies_again():
    pytest.importorskip(
        "skimage", reason="the maker of the templates needs scikit-image (the dev extra)"
    )
    from tools.templates.figures import MAN
    from tools.templates.make_templates import make_template

    arrays, about = make_template(MAN, triangles=1800, spacing=0.007)
    assert_body(arrays, about, tolerance=0.015)
