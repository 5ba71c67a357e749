"""OpenSim's setup files: names, bodies, times and files agree with one another and with the TRC."""

from xml.etree import ElementTree

import numpy as np
import pytest

from calib.errors import InputError
from examples.bodies.example_motions import example_motion
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.motion.joint_files import read_trc
from tests.clips import waving
from voxelpose.export.formats import export_motion
from voxelpose.export.opensim import OpenSimMarker, opensim_markers

# Of Rajagopal et al.'s model (2016).
BODIES = {"pelvis", "torso"} | {
    f"{name}_{side}"
    for name in "femur tibia patella talus calcn toes humerus ulna radius hand".split()
    for side in "rl"
}
COORDINATES = {
    *("pelvis_tilt", "pelvis_list", "pelvis_rotation"),
    *("lumbar_extension", "lumbar_bending", "lumbar_rotation"),
} | {
    f"{name}_{side}"
    for name in (
        "hip_flexion hip_adduction hip_rotation knee_angle ankle_angle subtalar_angle mtp_angle"
        " arm_flex arm_add arm_rot elbow_flex pro_sup wrist_flex wrist_dev"
    ).split()
    for side in "rl"
}
FILES = {
    *("opensim_motion.trc", "motion.mot", "opensim_static.trc", "opensim_markers.xml"),
    *("opensim_scale.xml", "opensim_ik.xml", "export.json"),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("opensim")
    files = export_motion(waving(12).select(np.r_[3:6, 8:10]), out, ["opensim"])
    assert {path.name for path in files} == FILES
    return out


def tool(folder, name) -> ElementTree.Element:
    root = ElementTree.parse(folder / name).getroot()
    assert (root.tag, root.get("Version")) == ("OpenSimDocument", "40000")
    assert len(root) == 1
    return root[0]


def columns(folder, name) -> list[str]:
    head = (folder / name).read_text().splitlines()[3]
    return [word for word in head.split("\t")[2:] if word]


def test_every_marker_is_a_point_of_both_trc_files_and_lies_on_a_body(folder):
    markers = tool(folder, "opensim_markers.xml").findall("objects/Marker")
    names = [marker.get("name") for marker in markers]
    assert len(names) == len(set(names)) == 30
    for file in ("opensim_motion.trc", "opensim_static.trc"):
        assert set(names) <= set(columns(folder, file))
    for marker in markers:
        assert marker.findtext("socket_parent_frame", "").removeprefix("/bodyset/") in BODIES
        assert len([float(word) for word in marker.findtext("location", "").split()]) == 3
        assert marker.findtext("fixed") in ("true", "false")


def test_scaling_measures_markers_and_scales_every_body_in_every_axis_once(folder):
    scale = tool(folder, "opensim_scale.xml")
    names = set(columns(folder, "opensim_static.trc"))
    scaled = []
    for measurement in scale.findall("ModelScaler/MeasurementSet/objects/Measurement"):
        pairs = measurement.findall("MarkerPairSet/objects/MarkerPair/markers")
        assert pairs and {word for pair in pairs for word in (pair.text or "").split()} <= names
        for body in measurement.findall("BodyScaleSet/objects/BodyScale"):
            scaled += [(body.get("name"), axis) for axis in body.findtext("axes", "").split()]
            side = (measurement.get("name") or "").partition("_")[0]
            if (body.get("name") or "")[-2:] in ("_r", "_l"):
                assert (body.get("name") or "").endswith({"right": "_r", "left": "_l"}[side])
                assert all((pair.text or "").count(f"{side}_") == 2 for pair in pairs)
    assert sorted(scaled) == sorted((body, axis) for body in BODIES for axis in "XYZ")


def test_tasks_name_markers_and_coordinates_that_are_there(folder):
    for name, place in (
        ("opensim_scale.xml", "MarkerPlacer/IKTaskSet/objects"),
        ("opensim_ik.xml", "IKTaskSet/objects"),
    ):
        tasks = tool(folder, name).find(place)
        assert tasks is not None
        markers = {task.get("name") for task in tasks.findall("IKMarkerTask")}
        assert markers == {marker.name for marker in opensim_markers()}
        coordinates = {task.get("name") for task in tasks.findall("IKCoordinateTask")}
        assert coordinates <= COORDINATES
        assert all(float(task.findtext("weight", "0")) > 0 for task in tasks)


def test_the_files_and_times_are_those_beside_them(folder):
    scale, inverse = tool(folder, "opensim_scale.xml"), tool(folder, "opensim_ik.xml")
    assert scale.findtext("GenericModelMaker/model_file") == "Rajagopal2016.osim"
    assert scale.findtext("GenericModelMaker/marker_set_file") == "opensim_markers.xml"
    assert scale.findtext("height") == "1700"
    for part in ("ModelScaler", "MarkerPlacer"):
        assert scale.findtext(f"{part}/marker_file") == "opensim_static.trc"
        assert scale.findtext(f"{part}/output_model_file") == inverse.findtext("model_file")
        first, last = map(float, scale.findtext(f"{part}/time_range", "").split())
        rows = (folder / "opensim_static.trc").read_text().splitlines()[6:]
        times = [float(row.split("\t")[1]) for row in rows]
        assert (first, last) == (times[0], times[-1])
    assert inverse.findtext("marker_file") == "opensim_motion.trc"
    assert inverse.findtext("coordinate_file") == "motion.mot"
    heading = inverse.find("IKTaskSet/objects/IKCoordinateTask[@name='pelvis_rotation']")
    assert heading is not None and heading.findtext("value_type") == "from_file"
    assert float(heading.findtext("weight", "0")) < 0.01  # markers decide
    text = (folder / "opensim_motion.trc").read_text()
    assert "NaN" not in text  # inverse kinematics would stop
    rows = text.splitlines()[6:]
    assert [int(row.split("\t")[0]) - 1 for row in rows] == [3, 4, 5, 8, 9]
    assert text.splitlines()[2].split("\t")[2] == "5"
    times = [float(row.split("\t")[1]) for row in rows]
    assert [*map(float, inverse.findtext("time_range", "").split())] == [times[0], times[-1]]


def test_the_static_pose_stands_upright_and_faces_ahead(folder):
    joints = read_trc(folder / "opensim_static.trc")  # in the world: OpenSim's x is y
    rest = BodyModel.from_sizes(BodySizes(1.7)).joint_centres_m * (-1, -1, 1)
    np.testing.assert_allclose(joints, np.broadcast_to(rest, joints.shape), atol=1e-6)


def test_markers_of_the_left_mirror_those_of_the_right():
    markers = {marker.name: marker for marker in opensim_markers()}
    for name, right in markers.items():
        if name.startswith("right_"):
            left = markers[name.replace("right_", "left_")]
            assert left.place_m == (*right.place_m[:2], -right.place_m[2])
            assert left.body == right.body.removesuffix("_r") + "_l" * right.body.endswith("_r")
    assert markers["right_hip"] == OpenSimMarker("right_hip", "femur_r", (0, 0, 0), 5.0, True)


@pytest.mark.parametrize(
    ("first", "second"),
    [("heel", "toes"), ("upper_thorax", "neck"), ("pelvis", "lumbar"), ("clavicle", "neck")],
)
def test_markers_of_one_body_are_as_far_apart_as_on_ours(folder, first, second):
    """So that scaling begins from the right sizes."""
    trc = (folder / "opensim_static.trc").read_text().splitlines()
    names = columns(folder, "opensim_static.trc")
    points = np.array([float(cell) for cell in trc[6].split("\t")[2:]]).reshape(-1, 3)
    markers = {marker.name: np.array(marker.place_m) for marker in opensim_markers()}

    def apart(places) -> float:
        one, other = (name if name in places else f"right_{name}" for name in (first, second))
        return float(np.linalg.norm(places[one] - places[other]))

    assert apart(markers) == pytest.approx(apart(dict(zip(names, points, strict=True))), abs=2e-3)


def test_a_body_that_is_no_person_is_refused(tmp_path):
    with pytest.raises(InputError, match="OpenSim's model is a person"):
        export_motion(example_motion("quadruped", 3), tmp_path, ["opensim"])
