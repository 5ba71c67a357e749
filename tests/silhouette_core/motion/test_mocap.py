"""Recorded motion in: files, names, mistakes."""

import json
import re
from pathlib import Path

import bvhio
import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.motion.mocap import load_motions, read_clip
from silhouette_core.motion.mocap.names import NEEDED, ROLES, NameMap
from tests.clips import waving
from voxelpose.export.bvh import write_bvh


@pytest.fixture
def bvh(tmp_path) -> Path:
    write_bvh(waving(), tmp_path / "take.bvh")
    return tmp_path / "take.bvh"


def renamed(path: Path, spelling) -> Path:
    """Renames every joint."""
    text = re.sub(r"(ROOT|JOINT) (\w+)", lambda m: f"{m[1]} {spelling(m[2])}", path.read_text())
    other = path.with_name("renamed.bvh")
    other.write_text(text)
    return other


def test_joints_are_where_another_reader_puts_them(bvh):
    recorded = read_clip(bvh)
    assert len(recorded) == 6 and recorded.fps == pytest.approx(25)
    for frame in (0, 5):
        tree = {
            joint.Name: joint.PositionWorld
            for joint, _, _ in bvhio.readAsHierarchy(str(bvh)).loadPose(frame).layout()
        }
        for index, name in enumerate(recorded.joints):
            np.testing.assert_allclose(
                recorded.positions[frame, index], tree[name], atol=1e-3, err_msg=name
            )


MIXED = """HIERARCHY
ROOT pelvis {
  OFFSET 0 10 0
  CHANNELS 6 Yrotation Xrotation Zrotation Xposition Yposition Zposition
%s}
MOTION
Frames: 2
Frame Time: 0.05
%s
%s
"""


def test_any_order_of_channels_and_joints_with_places_of_their_own(tmp_path):
    # A chest that turns X before Z and has its own place, as Blender writes it; the rest of the
    # body is there to be named.
    chest = (
        "JOINT thorax {\nOFFSET 0 5 0\nCHANNELS 6 Xposition Yposition Zposition Xrotation Zrotation"
        " Yrotation\nJOINT neck {\nOFFSET 0 1 0\nCHANNELS 1 Zrotation\nEnd Site {\nOFFSET 0 1"
        " 0\n}\n}\n}\n"
    )
    limbs = "".join(
        f"JOINT {role} {{\nOFFSET 1 0 0\nCHANNELS 0\n}}\n"
        for role in NEEDED
        if role not in ("pelvis", "thorax")
    )
    still, turned = "0 0 0 1 2 3  0 7 0 0 0 0  0", "90 0 0 1 2 3  0 7 0 90 90 0  0"
    (tmp_path / "mixed.bvh").write_text(MIXED % (chest + limbs, still, turned))
    recorded = read_clip(tmp_path / "mixed.bvh")
    assert recorded.fps == pytest.approx(20)
    place = lambda frame, name: recorded.positions[frame, recorded.joints.index(name)]  # noqa: E731
    np.testing.assert_allclose(place(0, "neck") - place(0, "pelvis"), [0, 8, 0], atol=1e-12)
    # By hand: the chest's turn Rx(90) Rz(90) brings y to -x; the pelvis's Ry(90) brings that to +z.
    np.testing.assert_allclose(place(1, "neck") - place(1, "pelvis"), [0, 7, 1], atol=1e-12)


SPELLINGS = {
    "mixamo": lambda side, role: {
        "pelvis": "Hips",
        "lumbar": "Spine",
        "thorax": "Spine2",
        "upper_arm": "Arm",
        "forearm": "ForeArm",
        "hand": "Hand",
        "thigh": "UpLeg",
        "shin": "Leg",
        "foot": "Foot",
        "toes": "ToeBase",
        "clavicle": "Shoulder",
    }.get(role, role.title()),
    "cc_base": lambda side, role: {
        "pelvis": "Hip",
        "lumbar": "Waist",
        "thorax": "Spine02",
        "upper_arm": "Upperarm",
        "shin": "Calf",
        "toes": "ToeBase",
        "neck": "NeckTwist01",
    }.get(role, role.title()),
    "asf": lambda side, role: {
        "pelvis": "root",
        "lumbar": "lowerback",
        "neck": "lowerneck",
        "upper_arm": "humerus",
        "forearm": "radius",
        "hand": "wrist",
        "thigh": "femur",
        "shin": "tibia",
    }.get(role, role),
}


@pytest.mark.parametrize("family", SPELLINGS)
def test_skeletons_by_the_names_of_their_makers(bvh, family):
    def spelling(part: str) -> str:
        side, _, limb = (
            part.partition("_") if part.startswith(("left_", "right_")) else ("", "", part)
        )
        name = SPELLINGS[family](side, limb)
        return {
            "mixamo": f"mixamorig:{side.title()}{name}",
            "cc_base": f"CC_Base_{side[:1].upper() + '_' if side else ''}{name}",
            "asf": f"{side[:1]}{name}",
        }[family]

    plain, other = read_clip(bvh), read_clip(renamed(bvh, spelling))
    assert set(other.roles) == set(ROLES)
    for role, joint in other.roles.items():
        assert other.joints[joint] == spelling(plain.joints[plain.roles[role]]), role


def test_own_names_by_a_map(bvh, tmp_path):
    strange = renamed(bvh, lambda part: part[::-1])
    words = "unknown joints: nothing found for pelvis, .*the skeleton has sivlep.*TOML"
    with pytest.raises(InputError, match=rf"renamed\.bvh: {words}"):
        read_clip(strange)
    own = tmp_path / "own.toml"
    own.write_text("".join(f'{role} = "{role[::-1]}"\n' for role in ROLES))
    assert set(read_clip(strange, own).roles) == set(ROLES)
    own.write_text('pelvis = "sivlep"\n')
    with pytest.raises(InputError, match=r"own\.toml finds no joint for thorax"):
        read_clip(strange, own)
    own.write_text('tail = "liat"\n')
    with pytest.raises(InputError, match="'tail' is no joint of ours"):
        read_clip(strange, own)
    own.write_text("pelvis = [\n")
    with pytest.raises(InputError, match="no valid TOML"):
        read_clip(strange, own)


def test_one_line_for_both_sides(tmp_path):
    (tmp_path / "map.toml").write_text('thigh = ["{Left}UpLeg", "thigh.{l}"]\nleft_foot = "Fuss"\n')
    names = NameMap.read(tmp_path / "map.toml").names
    assert names["right_thigh"] == ("RightUpLeg", "thigh.r")
    assert names["left_foot"] == ("Fuss",) and "right_foot" not in names


def rows_changed(change):
    def damage(text: str) -> str:
        lines = text.rstrip("\n").split("\n")
        return "\n".join(change(lines)) + "\n"

    return damage


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (rows_changed(lambda lines: lines[:-2]), r"take\.bvh says it has 6 frames, but holds 4"),
        (rows_changed(lambda lines: lines + lines[-1:]), "says it has 6 frames, but holds 7"),
        (
            rows_changed(lambda lines: [*lines[:-1], lines[-1][:60]]),
            "ends in the middle of frame 5",
        ),
        (
            rows_changed(lambda lines: [*lines[:-1], "nan " + lines[-1].partition(" ")[2]]),
            "NaN or infinity",
        ),
        (
            rows_changed(lambda lines: [*lines[:-1], "left " + lines[-1].partition(" ")[2]]),
            "no number",
        ),
        (rows_changed(lambda lines: lines[:40]), "cut off: it lacks MOTION"),
        (lambda text: text.replace("}", "", 1), "damaged hierarchy"),
        (lambda text: text.replace("OFFSET 0", "OFFSET x", 1), "damaged hierarchy"),
        (lambda text: text.replace("CHANNELS 3 Z", "CHANNELS 4 Z", 1), "damaged hierarchy"),
        (lambda text: re.sub("Frame Time:.*", "Frame Time: 0", text), "no time between frames"),
        (lambda text: re.sub("Frames:.*", "", text), "does not say 'Frames:'"),
        (lambda text: "solid stl", "no BVH"),
        (lambda text: re.sub("Frames:.*", "Frames: 999999999", text), "999999999 frames, but"),
        (lambda text: re.sub("Frames:.*", "Frames: " + "9" * 5000, text), "does not say"),
        (lambda text: re.sub("Frame Time:.*", "Frame Time: 1e-300", text), "no time between"),
        (lambda text: re.sub("OFFSET .*", "OFFSET 1e300 0 0", text, count=1), "is no bone's"),
        (lambda text: "HIERARCHY\n" + "ROOT a\n{\n" * 2000 + "MOTION", "more than 1000 joints"),
        (
            rows_changed(lambda lines: [*lines[:-1], "1e300 " + lines[-1].partition(" ")[2]]),
            "1e\\+300, which is no angle or position",
        ),
    ],
)
def test_damaged_files_are_refused_in_words(bvh, damage, message):
    bvh.write_text(damage(bvh.read_text()))
    with pytest.raises(InputError, match=message) as raised:
        read_clip(bvh)
    assert "\n" not in str(raised.value)


@pytest.fixture
def expmap(tmp_path) -> Path:
    """Stick figure in the layout of the motion-prediction literature, with our parts' names."""
    limbs = "upper_arm", "forearm", "hand", "thigh", "shin", "foot"
    names = ["pelvis", "thorax", *(f"{s}_{n}" for s in ("left", "right") for n in limbs)]
    parents = [-1, 0, 1, 2, 3, 0, 5, 6, 1, 8, 9, 0, 11, 12]
    offsets = [[0, 0, 0], [0, 40, 0]]
    for side in (1, -1):
        offsets += [[side * 18, 5, 0], [side * 28, 0, 0], [side * 25, 0, 0]]
        offsets += [[side * 9, -5, 0], [0, -42, 0], [0, -42, 0]]
    skeleton = {"parent": parents, "offset": offsets, "fps": 30, "names": names, "root_scale": 1.0}
    (tmp_path / "skeleton.json").write_text(json.dumps(skeleton))
    rows = np.zeros((4, 3 + 3 * len(names)))
    rows[:, 1] = 90
    # joint_from_parent: the arm itself turns by +90 degrees about z.
    rows[2, 3 + 3 * names.index("right_upper_arm") + 2] = -np.pi / 2
    np.savetxt(tmp_path / "take.csv", rows, delimiter=",")
    return tmp_path / "take.csv"


def test_exponential_maps(expmap):
    recorded = read_clip(expmap)
    place = lambda name: recorded.positions[2, recorded.joints.index(name)]  # noqa: E731
    np.testing.assert_allclose(place("pelvis"), [0, 90, 0])
    arm = place("right_hand") - place("right_upper_arm")
    np.testing.assert_allclose(arm, [0, -53, 0], atol=1e-6)
    np.testing.assert_allclose(place("left_hand") - place("left_upper_arm"), [53, 0, 0], atol=1e-6)


def test_mistakes_with_exponential_maps(expmap):
    rows = expmap.read_text()
    expmap.write_text("nan" + rows[rows.index(",") :])
    with pytest.raises(InputError, match="NaN or infinity"):
        read_clip(expmap)
    expmap.write_text("1,2,3\n")
    with pytest.raises(InputError, match=r"has 3 numbers a row, its skeleton\.json wants 45"):
        read_clip(expmap)
    expmap.write_text("")
    with pytest.raises(InputError, match="has 0 numbers a row"):
        read_clip(expmap)
    (expmap.parent / "skeleton.json").write_text("{}")
    with pytest.raises(InputError, match=r"skeleton\.json is no skeleton"):
        read_clip(expmap)
    (expmap.parent / "skeleton.json").unlink()
    with pytest.raises(InputError, match=r"needs skeleton\.json beside it"):
        read_clip(expmap)


def test_files_and_folders(bvh, tmp_path):
    model = waving().model
    (tmp_path / "deeper").mkdir()
    write_bvh(waving(9, fps=60), tmp_path / "deeper" / "other.BVH")
    # No motion, since no skeleton.json is beside it.
    (tmp_path / "joints.csv").write_text("frame,joint\n")
    motions = load_motions([tmp_path, bvh], model)
    assert [(len(motion), motion.fps) for motion in motions] == [(5, 30), (6, pytest.approx(25))]
    with pytest.raises(InputError, match="nowhere does not exist"):
        load_motions([tmp_path / "nowhere"], model)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="empty holds no motion"):
        load_motions([tmp_path / "empty"], model)
    (tmp_path / "walk.fbx").write_text("")
    with pytest.raises(InputError, match=r"walk\.fbx is no motion.*into BVH in Blender"):
        load_motions([tmp_path / "walk.fbx"], model)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("fps", 1e308),
        ("fps", 10**400),
        ("parent", [-5] * 14),
        ("parent", "x"),
        ("names", [1] * 14),
        ("offset", [[1e300] * 3] * 14),
        ("root_scale", float("nan")),
    ],
)
def test_a_damaged_skeleton_is_named(expmap, key, value):
    beside = expmap.with_name("skeleton.json")
    beside.write_text(json.dumps(json.loads(beside.read_text()) | {key: value}))
    with pytest.raises(InputError, match=r"skeleton\.json") as raised:
        read_clip(expmap)
    assert len(str(raised.value)) < 500
