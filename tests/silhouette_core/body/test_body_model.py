"""The joint table, the shape space, and bodies made from measurements."""

import numpy as np
import pytest
import trimesh

from calib.errors import InputError
from silhouette_core.body.joints import (
    HUMAN,
    LANDMARK_NAMES,
    LANDMARK_PART,
    PARENTS,
    PART_NAMES,
    landmark_part,
)
from silhouette_core.body.model import BodyModel
from silhouette_core.body.shape import bone_directions, clothing_directions
from silhouette_core.body.sizes import IS_CLOTHING, SHAPE_AXES, SHAPE_SIGMA, BodySizes
from silhouette_core.body.volume import sample_volume

AXIS = {axis.name: k for k, axis in enumerate(SHAPE_AXES)}
MIRROR = [
    PART_NAMES.index(n.replace("left", "*").replace("right", "left").replace("*", "right"))
    for n in PART_NAMES
]


@pytest.fixture(scope="module", params=["male", "female"])
def model(request):
    return BodyModel.from_sizes(BodySizes(1.8, sex=request.param))


def deviation(**values):
    shape = np.zeros(len(SHAPE_AXES))
    for name, value in values.items():
        shape[AXIS[name]] = value
    return shape


def test_tree_is_the_one_of_27_parts():
    assert len(PART_NAMES) == len(set(PART_NAMES)) == 27
    assert PARENTS[0] == -1 and (PARENTS[1:] < np.arange(1, 27)).all() and (PARENTS[1:] >= 0).all()
    assert [part for part, _ in HUMAN.dofs] == sorted(part for part, _ in HUMAN.dofs)
    assert len(set(HUMAN.dof_names)) == len(HUMAN.dofs) == HUMAN.dof_limits_rad.shape[0]


def test_limits_hold_the_rest_pose_and_axes_are_orthonormal():
    low, high = HUMAN.dof_limits_rad.T
    assert (low < 0).all() and (high > 0).all() and (high - low <= np.pi * 1.2).all()
    for own in range(len(PART_NAMES)):
        axes = np.array([f.axis for part, f in HUMAN.dofs if part == own]).reshape(-1, 3)
        np.testing.assert_allclose(axes @ axes.T, np.eye(len(axes)), atol=1e-12)


def test_right_is_the_mirror_of_left():
    table = {(PART_NAMES[part], f.name): f for part, f in HUMAN.dofs}
    for (part, name), dof in table.items():
        if part.startswith("left_"):
            other = table[part.replace("left_", "right_"), name]
            assert other.limits_deg == dof.limits_deg and other.fixed == dof.fixed
            # The mirror image of a turn about a is the turn about (a_x, -a_y, -a_z).
            np.testing.assert_allclose(other.axis, np.multiply(dof.axis, (1, -1, -1)))
    np.testing.assert_array_equal(PARENTS[MIRROR][1:], np.array(MIRROR)[PARENTS[1:]])


def test_landmarks_know_their_parts():
    assert [PART_NAMES[p] for p in LANDMARK_PART[:4]] == [
        "pelvis",
        "left_thigh",
        "left_shin",
        "left_foot",
    ]
    assert PART_NAMES[landmark_part("head_top")] == "head" and len(LANDMARK_NAMES) == 15


def test_body_has_the_stature_asked_for(model):
    assert np.ptp(model.vertices_m[:, 2]) == pytest.approx(1.8, abs=1e-3)
    assert model.vertices_m[:, 2].min() == pytest.approx(0, abs=1e-3)
    small = BodyModel.from_sizes(BodySizes(1.2, sex=model.sizes.sex))
    np.testing.assert_allclose(small.vertices_m * 1.5, model.vertices_m, atol=1e-9)
    np.testing.assert_allclose(
        small.space.joints_change * 1.5, model.space.joints_change, atol=1e-9
    )


def test_a_larger_chest_makes_a_stouter_body_of_the_same_height():
    usual, stout = (BodyModel.from_sizes(BodySizes(1.75, chest, "male")) for chest in (None, 1.15))
    assert np.ptp(stout.vertices_m[:, 2]) == pytest.approx(np.ptp(usual.vertices_m[:, 2]), abs=0.01)
    np.testing.assert_allclose(stout.joints_m, usual.joints_m, atol=1e-9)
    assert stout.shape[AXIS["trunk_width"]] > 0.05
    assert stout.shape[AXIS["thigh_girth"]] == pytest.approx(0.5 * stout.shape[AXIS["trunk_width"]])
    volume = [
        trimesh.Trimesh(body.vertices_m, body.faces, process=False).volume
        for body in (usual, stout)
    ]
    assert volume[1] > 1.1 * volume[0]


@pytest.mark.parametrize(
    "wrong",
    [
        {"stature_m": 175.0},
        {"stature_m": 1.7, "chest_girth_m": 96.0},
        {"stature_m": 1.7, "sex": "m"},
    ],
)
def test_measures_of_nobody_are_refused(wrong):
    with pytest.raises(InputError, match="give"):
        BodySizes(**wrong)


def test_shape_is_linear(model):
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, len(SHAPE_AXES))) * SHAPE_SIGMA
    for name in ("joints_m", "vertices_m", "landmarks_m"):
        rest = getattr(model.reshaped(np.zeros(len(SHAPE_AXES))), name)
        both, one, other = (getattr(model.reshaped(shape), name) for shape in (a + b, a, b))
        np.testing.assert_allclose(both - rest, (one - rest) + (other - rest), atol=1e-9)


def test_reshaping_does_not_add_up(model):
    shape = deviation(thigh_length=0.1)
    np.testing.assert_allclose(
        model.reshaped(deviation(head_girth=0.1)).reshaped(shape).vertices_m,
        model.reshaped(shape).vertices_m,
    )


@pytest.mark.parametrize(
    ("axis", "start", "end"),
    [
        ("upper_arm_length", "left_upper_arm", "left_forearm"),
        ("forearm_length", "right_forearm", "right_hand"),
        ("thigh_length", "left_thigh", "left_shin"),
        ("shin_length", "right_shin", "right_foot"),
    ],
)
def test_a_longer_bone_moves_the_joints_beyond_it_alone(model, axis, start, end):
    bone = [PART_NAMES.index(start), PART_NAMES.index(end)]
    longer = model.reshaped(deviation(**{axis: 0.1})).joints_m
    length = [np.linalg.norm(np.subtract(*joints[bone])) for joints in (longer, model.joints_m)]
    assert length[0] == pytest.approx(1.1 * length[1])
    np.testing.assert_allclose(
        bone_directions(longer)[bone[0]], bone_directions(model.joints_m)[bone[0]], atol=1e-9
    )
    moved = np.linalg.norm(longer - model.joints_m, axis=1) > 1e-9
    sides = {start.partition("_")[2]}
    expected = [any(PART_NAMES[a].partition("_")[2] in sides for a in _above(p)) for p in range(27)]
    np.testing.assert_array_equal(moved, expected)


def _above(part):
    """Parts on whose bone a joint hangs: all but itself."""
    result = []
    while PARENTS[part] >= 0:
        part = PARENTS[part]
        result.append(part)
    return result


@pytest.mark.parametrize("axis", [axis.name for axis in SHAPE_AXES if axis.along == "girth"])
def test_girths_leave_every_joint_where_it_is(model, axis):
    stout = model.reshaped(deviation(**{axis: 0.2}))
    np.testing.assert_allclose(stout.joints_m, model.joints_m, atol=1e-12)
    assert np.abs(stout.vertices_m - model.vertices_m).max() > 0.002


@pytest.mark.parametrize("seed", range(4))
def test_no_seam_opens(model, seed):
    """Bodies of many shapes stay closed, and no edge is torn or folded away."""
    shape = np.clip(np.random.default_rng(seed).normal(size=len(SHAPE_AXES)), -2, 2) * SHAPE_SIGMA
    shape[IS_CLOTHING] = 0.0
    body = model.reshaped(shape)
    mesh = trimesh.Trimesh(body.vertices_m, body.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent
    assert (
        0.6
        < mesh.volume / trimesh.Trimesh(model.vertices_m, model.faces, process=False).volume
        < 1.6
    )
    edges = model.faces[:, [0, 1]]
    before, after = (
        np.linalg.norm(np.subtract(*v[edges].swapaxes(0, 1)), axis=1)
        for v in (model.vertices_m, body.vertices_m)
    )
    assert (after / before).max() < 2.0 and (after / before).min() > 0.4
    normals = [
        trimesh.Trimesh(v, model.faces, process=False).face_normals
        for v in (model.vertices_m, body.vertices_m)
    ]
    assert (normals[0] * normals[1]).sum(1).min() > 0


@pytest.mark.parametrize("thickness", [0.01, 0.02])
def test_clothes_widen_a_body_without_folds_and_move_no_joint(model, thickness):
    """In statures: of 0.02 a shirt of 1.8 m stands off by 36 mm."""
    worn = model.reshaped(thickness * IS_CLOTHING)
    np.testing.assert_array_equal(worn.joints_m, model.joints_m)
    np.testing.assert_array_equal(worn.landmarks_m, model.landmarks_m)
    bare, clothed = (
        trimesh.Trimesh(body.vertices_m, body.faces, process=False) for body in (model, worn)
    )
    assert clothed.is_watertight and clothed.volume > bare.volume
    assert (bare.face_normals * clothed.face_normals).sum(1).min() > 0
    moved = np.linalg.norm(worn.vertices_m - model.vertices_m, axis=1)
    by_part = {name: moved[model.skin_parts[:, 0] == p] for p, name in enumerate(PART_NAMES)}
    for name in ("thorax", "left_thigh", "right_shin", "left_upper_arm"):
        assert np.median(by_part[name]) == pytest.approx(1.8 * thickness, rel=0.15)
    for name in ("head", "left_hand", "right_fingers", "left_toes"):
        assert np.median(by_part[name]) == 0 and by_part[name].max() < 0.001


def test_hollows_move_less_than_what_bulges():
    """A dented cube: the bottom of the dent, where four walls would meet, hardly moves."""
    box = trimesh.creation.box(extents=(1, 1, 1)).subdivide().subdivide()
    vertices = box.vertices.copy()
    top = np.flatnonzero((np.abs(vertices - (0, 0, 0.5)) < 1e-9).all(1))
    vertices[top, 2] -= 0.4
    length = np.linalg.norm(clothing_directions(vertices, np.asarray(box.faces)), axis=1)
    flat = np.flatnonzero((np.abs(vertices - (0, 0, -0.5)) < 1e-9).all(1))
    assert length[top].max() < 0.9 and length[flat].min() > 0.99


def test_stature_follows_the_lengths_of_legs_trunk_and_head(model):
    def height(body):
        return body.landmarks_m[LANDMARK_NAMES.index("head_top"), 2] - body.vertices_m[:, 2].min()

    for name in ("thigh_length", "shin_length", "trunk_length", "head_length"):
        assert height(model.reshaped(deviation(**{name: 0.05}))) > height(model) + 0.003
    for name in ("thigh_girth", "upper_arm_length", "shoulder_width", "trunk_width"):
        assert height(model.reshaped(deviation(**{name: 0.05}))) == pytest.approx(
            height(model), abs=0.002
        )


def test_parts_fill_the_mesh(model):
    volumes = model.part_volumes_m3(0.01)
    mesh = trimesh.Trimesh(model.vertices_m, model.faces, process=False)
    assert volumes.sum() == pytest.approx(mesh.volume, rel=0.01)
    assert (volumes > 0).all()
    np.testing.assert_allclose(volumes, volumes[MIRROR], rtol=0.15, atol=2e-5)
    thigh, hand = (volumes[PART_NAMES.index(name)] for name in ("left_thigh", "left_hand"))
    assert thigh > 10 * hand


def test_points_of_a_part_are_inside_and_relative_to_its_joint(model):
    points = model.part_points(0.03)
    mesh = trimesh.Trimesh(model.vertices_m, model.faces, process=False)
    shin = PART_NAMES.index("left_shin")
    placed = points[shin] + model.joints_m[shin]
    assert len(placed) > 20
    # The solid angle of a closed surface, seen from inside, is the whole sphere.
    assert all(solid_angle(mesh, p) == pytest.approx(4 * np.pi, abs=1e-6) for p in placed)
    assert placed[:, 2].max() < model.joints_m[shin, 2] + 0.08 and placed[:, 0].min() > 0


def solid_angle(mesh, point):
    """Under which a point sees a surface (van Oosterom and Strackee)."""
    a, b, c = (mesh.triangles[:, k] - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    base = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
    return 2 * np.arctan2((a * np.cross(b, c)).sum(1), base).sum()


def test_volume_of_a_ball():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    upper = (ball.triangles_center[:, 2] > 0).astype(np.int32)
    points, part = sample_volume(ball.vertices, ball.faces, upper, 0.02)
    assert len(points) * 0.02**3 == pytest.approx(np.pi / 6, rel=0.01)
    assert np.linalg.norm(points, axis=1).max() < 0.5
    assert np.mean((points[:, 2] > 0) == (part == 1)) > 0.97


def test_where_a_surface_overlaps_itself_is_inside():
    """Two balls in one mesh, as thighs in wide trousers."""
    balls = [trimesh.creation.icosphere(subdivisions=3, radius=0.5) for _ in range(2)]
    balls[1].apply_translation((0.5, 0, 0))
    both = trimesh.util.concatenate(balls)
    points, _ = sample_volume(both.vertices, both.faces, np.zeros(len(both.faces), np.int32), 0.05)
    shared = (np.linalg.norm(points, axis=1) < 0.45) & (
        np.linalg.norm(points - (0.5, 0, 0), axis=1) < 0.45
    )
    assert shared.sum() > 500


def test_normals_point_outward(model):
    outward = trimesh.Trimesh(model.vertices_m, model.faces, process=False)
    assert outward.volume > 0
    normals = model.vertex_normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-9)
    assert ((normals * outward.vertex_normals).sum(1) > 0.5).mean() > 0.99
