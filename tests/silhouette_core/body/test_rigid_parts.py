"""Bodies of rigid parts: closed pieces, volumes, parts and refusals."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.rigid_parts import Box, Capsule, ClosedMesh, body_of_parts, with_part

_HINGE = (Dof("bend", (0.0, -1.0, 0.0), (-90.0, 90.0)),)
_TREE = KinematicTree.from_parts((("base", "", ()), ("arm", "base", _HINGE)), {"tip": "arm"})
_JOINTS = np.array([[0.0, 0, 0], [0, 0, 0.2]])


def _body():
    shapes = [[Box((-0.1, -0.2, 0.0), (0.1, 0.2, 0.2))], [Capsule((0, 0, 0.2), (0, 0, 0.7), 0.05)]]
    return body_of_parts(_TREE, _JOINTS, shapes, np.array([*_JOINTS, [0, 0, 0.75]]))


def _signed_volume(model, part):
    a, b, c = (model.vertices_m[model.faces[model.face_part == part, k]] for k in range(3))
    return float(np.einsum("fi,fi->", a, np.cross(b, c)) / 6)


def test_pieces_are_closed_and_oriented_outwards():
    model = _body()
    edges = np.concatenate([model.faces[:, [0, 1]], model.faces[:, [1, 2]], model.faces[:, [2, 0]]])
    forward = {tuple(edge) for edge in edges.tolist()}
    assert len(forward) == len(edges) and all((b, a) in forward for a, b in forward)
    assert _signed_volume(model, 0) == pytest.approx(0.2 * 0.4 * 0.2)
    whole = np.pi * 0.05**2 * (0.5 + 4 / 3 * 0.05)
    assert 0.93 * whole < _signed_volume(model, 1) < whole


def test_where_pieces_overlap_a_point_counts_once():
    shapes = [[Box((0, 0, 0), (0.2, 0.2, 0.2))], [Box((0.1, 0, 0), (0.3, 0.2, 0.2))]]
    volumes = body_of_parts(_TREE, _JOINTS, shapes).part_volumes_m3(0.01)
    assert volumes == pytest.approx([0.008, 0.004], rel=0.02)


def test_the_tree_names_joints_and_ends_as_landmarks():
    assert _TREE.landmark_names == ("base", "arm", "tip")
    assert _TREE.landmark_part.tolist() == [0, 1, 1]
    assert _TREE.landmark_bones.tolist() == [[0, 1], [1, 2]]
    model = _body()
    assert model.shape.shape == (0,) and model.extent_m == pytest.approx(0.75)
    assert np.array_equal(model.reshaped(np.zeros(0)).vertices_m, model.vertices_m)


def test_a_given_body_has_no_measurements_of_a_person():
    with pytest.raises(InputError, match="a person's measurements"):
        _body().sizes.stature_m  # noqa: B018 (raises)


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        ([[], []], "no part of the body has a shape"),
        ([[Capsule((0, 0, 0), (0, 0, 1), 0.0)], []], "radius 0 m"),
        ([[Box((0, 0, 0), (0, 1, 1))], []], "is empty"),
        ([[ClosedMesh(np.full((3, 3), np.nan), np.array([[0, 1, 2]]))], []], "size nan"),
        ([[]], "2 parts, but 2 joints and 1"),
    ],
)
def test_unfit_shapes_are_refused(shapes, message):
    with pytest.raises(InputError, match=message):
        body_of_parts(_TREE, _JOINTS, shapes)


def test_unfit_trees_are_refused():
    with pytest.raises(InputError, match="one name"):
        KinematicTree.from_parts((("a", "", ()), ("a", "a", ())))
    with pytest.raises(InputError, match="does not come before"):
        KinematicTree.from_parts((("a", "", ()), ("b", "c", ())))
    with pytest.raises(InputError, match="does not come before"):
        KinematicTree.from_parts((("a", "", ()), ("b", "c", ()), ("c", "a", ())))
    with pytest.raises(InputError, match="no part"):
        KinematicTree.from_parts((("a", "", ()),), {"tip": "b"})


def test_what_is_added_hangs_on_the_part_that_carries_it():
    larger = with_part(
        _body(), "tool", "arm", (0, 0, 0.7), [Box((-0.1, 0, 0.7), (0.1, 0.1, 0.8))],
        {"blade": (0.1, 0.0, 0.75)},
    )  # fmt: skip
    assert larger.names == ("base", "arm", "tool") and larger.tree.parents.tolist() == [-1, 0, 1]
    assert larger.tree.landmark_names == ("base", "arm", "tip", "tool", "blade")
    assert larger.tree.landmark_bones[-2:].tolist() == [[2, 3], [3, 4]]
    assert larger.part_volumes_m3(0.01)[2] == pytest.approx(0.002, rel=0.1)
    with pytest.raises(InputError, match="cannot be joined"):
        with_part(larger, "tool", "arm", (0, 0, 0.7), [])
