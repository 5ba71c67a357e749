"""MakeHuman bodies: shapes, the CMU rig and the human tree, and refusals."""

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import HUMAN, LANDMARK_NAMES
from silhouette_core.body.rigs.makehuman import MakeHumanPerson, read_makehuman
from silhouette_core.body.rigs.rig_formats import read_rig_body
from silhouette_core.motion.motion import Motion


@pytest.fixture(scope="module")
def data(shared):
    folder = shared / "data" / "makehuman"
    if not folder.is_dir():
        pytest.skip("no MakeHuman data among the shared ones")
    return folder


def test_a_small_folder_is_read_with_its_targets(rig_files, tmp_path):
    rig_files.write_makehuman(tmp_path)
    body = read_rig_body(tmp_path / "body.toml")
    assert body.names == ("low", "high")
    vertices, _ = rig_files.box_mesh()
    # One target of the origin, two by weight (0.7 and 0.3) and half of one by height: 2.5 x 1 cm.
    change = np.zeros((8, 3))
    change[0, 0], change[4] = 0.025, (-0.025, 0, 0.005)
    shift = [0, 0, -(vertices + change)[:, 2].min()]
    assert np.allclose(body.vertices_m, vertices + change + shift, atol=1e-9)
    assert body.face_part.tolist().count(0) > 0 and body.face_part.max() == 1


def test_a_thin_body_is_made_of_the_target_of_thin_ones(rig_files, tmp_path):
    rig_files.write_makehuman(tmp_path)
    targets = tmp_path / "data" / "targets" / "macrodetails"
    thin = "universal-male-young-averagemuscle-minweight.target"
    (targets / thin).write_text("1 0 0 1\n")  # a decimetre toward the front
    table = tmp_path / "body.toml"
    table.write_text(table.read_text().replace("weight = 0.3", "weight = -0.3"))
    vertices, _ = rig_files.box_mesh()
    moved = read_rig_body(table).vertices_m[1] - vertices[1]
    np.testing.assert_allclose(moved[:2], [0, -0.03], atol=1e-9)


def test_weights_that_are_listed_in_pieces_are_added(rig_files, tmp_path):
    rig_files.write_makehuman(tmp_path)
    path = tmp_path / "data" / "rigs" / "standard" / "weights.two.json"
    whole = read_rig_body(tmp_path / "body.toml")
    assert "[0, 1.0]" in path.read_text()
    path.write_text(path.read_text().replace("[0, 1.0]", "[0, 0.25], [0, 0.75]"))
    np.testing.assert_allclose(
        read_rig_body(tmp_path / "body.toml").skin_weights, whole.skin_weights
    )


@pytest.mark.parametrize(
    ("name", "old", "new", "words"),
    [
        ("body.toml", '"male"', '"man"', "male or female"),
        ("body.toml", "height = 0.5", "height = 7", "not from -1 to 1"),
        ("body.toml", "weight = 0.3", "weigth = 0.3", "it can have"),
        ("body.toml", '"two"', '"three"', "there are two"),
        ("body.toml", '"data"', '"nowhere"', "cannot be read"),
        ("data/3dobjs/base.obj", "v ", "v x", "damaged"),
        ("data/3dobjs/base.obj", "/1 ", "999/1 ", "does not exist"),
        ("data/rigs/standard/rig.two.json", '"low": ', '"low" ', "broken JSON"),
        ("data/rigs/standard/rig.two.json", '"parent": ""', '"parent": "high"', "cyclic"),
        ("data/rigs/standard/rig.two.json", '"parent": "low"', '"parent": ""', "not connected"),
        ("data/rigs/standard/rig.two.json", "joint-low", "joint-no", "does not have"),
        ("data/rigs/standard/weights.two.json", "[1, 1.0]", "[1, 0.5]", "sum to 0.5"),
    ],
)
def test_what_cannot_be_a_body_is_refused_in_one_line(rig_files, tmp_path, name, old, new, words):
    rig_files.write_makehuman(tmp_path)
    path = tmp_path / name
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=words) as refused:
        read_rig_body(tmp_path / "body.toml")
    assert "\n" not in str(refused.value)
    assert str(tmp_path) in str(refused.value)


@pytest.mark.parametrize("human", [False, True])
def test_the_body_is_closed_and_has_the_persons_volume(data, human):
    body = read_makehuman(data, human=human)
    assert 0.05 < body.part_volumes_m3(0.01).sum() < 0.08
    stature = body.landmarks_m[LANDMARK_NAMES.index("head_top"), 2]
    assert stature == pytest.approx(1.7481, abs=1e-3) and body.vertices_m[:, 2].min() == 0
    assert body.tree.landmark_names == LANDMARK_NAMES
    assert (body.tree is HUMAN) == human
    edges = np.sort(np.concatenate([body.faces[:, [0, 1]], body.faces[:, 1:], body.faces[:, ::2]]))
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()


def test_weight_makes_the_body_larger_and_leaves_its_bones(data):
    slim, stout = (
        read_makehuman(data, MakeHumanPerson("female", weight=weight)) for weight in (-0.5, 0.5)
    )
    assert stout.part_volumes_m3(0.02).sum() > 1.15 * slim.part_volumes_m3(0.02).sum()
    thigh = [np.linalg.norm(np.diff(b.landmarks_m[1:3], axis=0)) for b in (slim, stout)]
    assert thigh[0] == pytest.approx(thigh[1], rel=0.02)


def test_both_trees_take_the_same_poses(data):
    """The straight arms of the human tree are within the ranges of the CMU rig, whose rest bends
    them: the angles that undo its rest give the human rest pose.
    """
    cmu, human = read_makehuman(data), read_makehuman(data, human=True)
    turned = np.zeros(cmu.dof_count)
    for side in ("Left", "Right"):
        column = cmu.tree.dof_names.index(f"{side}ForeArm.flexion")
        low, high = np.degrees(cmu.tree.dof_limits_rad[column])
        turned[column] = np.radians(low + 5)  # straight lies 5 degrees above the lower limit
        assert high - low == pytest.approx(155)
    motion = Motion(
        30.0,
        cmu,
        np.zeros((1, 3)),
        np.array([[1.0, 0, 0, 0]]),
        turned[None],
        np.zeros(1, np.int64),
        np.zeros(1),
    )
    joints = motion.landmarks()[0]
    for side in ("left", "right"):
        shoulder, elbow, wrist = (
            joints[LANDMARK_NAMES.index(f"{side}_{j}")] for j in ("shoulder", "elbow", "wrist")
        )
        bend = np.cross(elbow - shoulder, wrist - elbow)
        assert np.linalg.norm(bend) < 0.02 * np.linalg.norm(elbow - shoulder) ** 2
        own = human.landmarks_m[[LANDMARK_NAMES.index(f"{side}_{j}") for j in ("elbow", "wrist")]]
        assert np.linalg.norm(wrist - elbow) == pytest.approx(np.linalg.norm(np.diff(own, axis=0)))
