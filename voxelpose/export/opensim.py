"""OpenSim: joint coordinates (MOT), marker set, and setup files for scaling and inverse kinematics.

The model is Rajagopal et al.'s full-body model (2016), which its users get from SimTK or OpenSim's
own models under SimTK's MIT use agreement; nothing of it is part of this package but the names of
its bodies and coordinates. Axes and names are those of `voxelpose.export.trc`: x = y, y = z, z = x
of the world (y up), metres, as in Pose2Sim: files of both programs made with one calibration
coincide. A person who faces the world's +y faces OpenSim's +x, as OpenSim's models do.
"""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.anatomical import LAB_FROM_WORLD, continuous_degrees, joint_rotations
from silhouette_core.motion.conditioning import conditioning_words
from silhouette_core.motion.kinematics import landmarks
from silhouette_core.motion.motion import Motion
from voxelpose.export.trc import write_trc

_HIPS = [LANDMARK_NAMES.index("left_hip"), LANDMARK_NAMES.index("right_hip")]

# Coordinates of every joint in Rajagopal et al.'s model: rotations about z, x and y, {} being r or
# l; None where the model has no such coordinate.
_COORDINATES = {
    "hip": ("hip_flexion_{}", "hip_adduction_{}", "hip_rotation_{}"),
    "knee": ("knee_angle_{}", None, None),
    "ankle": ("ankle_angle_{}", "subtalar_angle_{}", None),
    "trunk": ("lumbar_extension", "lumbar_bending", "lumbar_rotation"),
    "shoulder": ("arm_flex_{}", "arm_add_{}", "arm_rot_{}"),
    "elbow": ("elbow_flex_{}", None, "pro_sup_{}"),
    "wrist": ("wrist_flex_{}", "wrist_dev_{}", None),
}
MODEL_FILE = "Rajagopal2016.osim"
"""File name under which the setup files expect the model, beside them."""
MARKERS_FILE, SCALE_FILE, IK_FILE = "opensim_markers.xml", "opensim_scale.xml", "opensim_ik.xml"
STATIC_FILE, SCALED_MODEL_FILE = "opensim_static.trc", "opensim_scaled.osim"
_MOTION_FILE, _COORDINATES_FILE = "opensim_motion.trc", "motion.mot"
_IK_RESULT, _PLACED_MARKERS = "opensim_ik.mot", "opensim_placed.xml"
_STATIC_FRAMES = 3


def write_mot(motion: Motion, path: Path) -> None:
    """Writes joint coordinates, of at least one pose, with the names and signs of Rajagopal et
    al.'s full-body model.

    Angles are in degrees and continuous in time; `pelvis_tx`, `_ty`, `_tz` are in metres with the
    axis map above, for the model's pelvis scaled by stature. The order of rotations is the model's:
    pelvis tilt, list, rotation; flexion, adduction, rotation of hip and arm. Degrees of freedom
    that the model lacks are left out: adduction and rotation of the knee, the neck, the shoulder
    girdle. Models of the gait2392 family count knee flexion negative and have no arms.

    Frames without a pose have no row; OpenSim interpolates between rows by their times. A line of
    the head states filter and filling of gaps.
    """
    columns = mot_coordinates(motion)
    # Adding 0.0 turns -0.0 into 0.0.
    table = np.column_stack([motion.frames / motion.fps, *columns.values()]).round(6) + 0.0
    head = [
        "Coordinates",
        "version=1",
        f"nRows={len(table)}",
        f"nColumns={table.shape[1]}",
        "inDegrees=yes",
        "",
        conditioning_words(motion),
        "",
        "endheader",
    ]
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(head) + "\n" + "\t".join(["time", *columns]) + "\n")
        file.writelines("\t".join(f"{value:.6f}" for value in row) + "\n" for row in table)


def mot_coordinates(motion: Motion) -> dict[str, NDArray[np.float64]]:
    """Returns the coordinates of a MOT file by name, (T,) float64 each, degrees and metres."""
    stature_m = motion.model.sizes.stature_m  # refuses a body that is no person's
    motion = motion.upright()
    rotations = joint_rotations(motion)
    names = ("pelvis_tilt", "pelvis_list", "pelvis_rotation")
    columns = dict(zip(names, continuous_degrees(rotations["pelvis"]).T, strict=True))
    hips = landmarks(motion.model, *motion.parts())[:, _HIPS].mean(axis=1) @ LAB_FROM_WORLD.T
    # Midpoint of the hips in the pelvis frame of Rajagopal's model, of a person 1.70 m tall.
    hips_in_pelvis_m = np.array([-0.056276, -0.07849, 0.0])
    offset = hips_in_pelvis_m * stature_m / 1.70
    pelvis = hips - rotations["pelvis"] @ offset
    columns |= {f"pelvis_t{axis}": values for axis, values in zip("xyz", pelvis.T, strict=True)}
    for side in ("right", "left"):
        for joint, names in _COORDINATES.items():
            if joint == "trunk" and side == "left":
                continue
            matrices = rotations[joint if joint == "trunk" else f"{side}_{joint}"]
            sign = -1.0 if joint == "knee" else 1.0
            columns |= {
                name.format(side[0]): sign * values
                for name, values in zip(names, continuous_degrees(matrices).T, strict=True)
                if name
            }
    return columns


@dataclass(frozen=True)
class OpenSimMarker:
    """A point of the TRC on the model."""

    name: str  # as in the TRC
    body: str  # body of the model on which it lies
    # In that body's frame (x forward, y up, z right), of a person 1.70 m tall.
    place_m: tuple[float, float, float]
    weight: float
    # Whether it is the joint's centre, the frame's origin. Others are moved to where the static
    # pose has them.
    fixed: bool


_SIDES = {"right": "r", "left": "l"}


@cache
def _model() -> dict[str, Any]:
    """Markers, measurements and held coordinates of the model."""
    text = files("voxelpose.export").joinpath("opensim.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def opensim_markers() -> tuple[OpenSimMarker, ...]:
    """The markers of both sides, with the names that `write_trc` gives them."""
    markers = []
    for name, (body, place_m, weight) in _model()["markers"].items():
        for side, letter in _SIDES.items() if "{side}" in name else [("right", "")]:
            x, y, z = place_m or (0.0, 0.0, 0.0)
            # The left side is the right one's mirror image.
            place = x, y, z * (1 if side == "right" else -1) + 0.0
            name_of_side, body_of_side = name.format(side=side), body.format(letter)
            markers.append(OpenSimMarker(name_of_side, body_of_side, place, weight, not place_m))
    return tuple(markers)


def write_marker_set(motion: Motion, path: Path) -> None:
    """Writes the marker set, of a person 1.70 m tall, in the frames of the model's bodies."""
    markers = []
    for marker in opensim_markers():
        texts = {
            "socket_parent_frame": f"/bodyset/{marker.body}",
            "location": " ".join(f"{number:g}" for number in marker.place_m),
            "fixed": str(marker.fixed).lower(),
        }
        markers.append(_node("Marker", texts, name=marker.name))
    _write_document(_node("MarkerSet", _node("objects", *markers), name="voxelpose"), path)


def write_static(motion: Motion, path: Path) -> None:
    """Writes the fitted body, a person's, in its rest pose as TRC: upright, facing OpenSim's +x,
    arms 45 degrees down. It takes the place of a static trial.
    """
    model = motion.model
    turned = np.array([0.0, 0.0, 0.0, 1.0])  # half round, since bodies rest facing -y
    root = model.joints_m[0] * (-1, -1, 1)
    standing = Motion(
        motion.fps,
        model,
        np.tile(root, (_STATIC_FRAMES, 1)),
        np.tile(turned, (_STATIC_FRAMES, 1)),
        np.zeros((_STATIC_FRAMES, model.dof_count)),
    )
    write_trc(standing, path)


def write_seen(motion: Motion, path: Path) -> None:
    """Writes the TRC without the frames that have no pose: inverse kinematics would stop there."""
    write_trc(motion, path, lost_rows=False)


def write_scale_setup(motion: Motion, path: Path) -> None:
    """Writes the setup of OpenSim's scale tool: lengths from the static pose, whose times the
    motion's frame rate decides, then the markers that are no joint centres where that pose has
    them.
    """
    times = f"0 {(_STATIC_FRAMES - 1) / motion.fps:.6f}"
    statics = {"marker_file": STATIC_FILE, "time_range": times}
    scaled = {"output_model_file": SCALED_MODEL_FILE}
    measurements = _node("objects", *(_measurement(*given) for given in _measurements()))
    tool = _node(
        "ScaleTool",
        {"mass": "-1", "height": f"{1000 * motion.model.sizes.stature_m:.0f}", "age": "-1"},
        _node("GenericModelMaker", {"model_file": MODEL_FILE, "marker_set_file": MARKERS_FILE}),
        _node(
            "ModelScaler",
            {"apply": "true", "scaling_order": "measurements"},
            _node("MeasurementSet", measurements, name="voxelpose"),
            statics | {"preserve_mass_distribution": "false"} | scaled,
        ),
        _node(
            "MarkerPlacer",
            {"apply": "true"},
            _tasks(True, *map(_coordinate_task, _model()["held"])),
            statics | scaled,
            {"output_marker_file": _PLACED_MARKERS, "max_marker_movement": "-1"},
        ),
        name="voxelpose",
    )
    _write_document(tool, path)


def write_ik_setup(motion: Motion, path: Path) -> None:
    """Writes the setup of OpenSim's inverse kinematics, from the first pose to the last."""
    first, last = motion.frames[[0, -1]] / motion.fps
    texts = {
        "model_file": SCALED_MODEL_FILE,
        "constraint_weight": "Inf",
        "accuracy": "1e-05",
        "time_range": f"{first:.6f} {last:.6f}",
        "output_motion_file": _IK_RESULT,
        "report_errors": "true",
        "marker_file": _MOTION_FILE,
        "coordinate_file": _COORDINATES_FILE,
    }
    # Silhouettes do not show pronation. The model begins facing +x, from where it would not find a
    # person who faces the other way; so little weight turns it, and leaves the markers to decide.
    pronation = [_coordinate_task(f"pro_sup_{side}") for side in _SIDES.values()]
    turn = _coordinate_task("pelvis_rotation", "from_file", 1e-4)
    tasks = _tasks(False, *pronation, turn)
    _write_document(_node("InverseKinematicsTool", texts, tasks, name="voxelpose"), path)


def _measurements() -> Iterator[tuple[str, list[tuple[str, str]], list[str], str]]:
    """Name, pairs of markers, bodies and axes of every measurement."""
    for name, (pairs, bodies, axes) in _model()["scales"].items():
        if any("{}" in body for body in bodies):
            for side, letter in _SIDES.items():
                sided = [(f"{side}_{a}", f"{side}_{b}") for a, b in pairs]
                yield f"{side}_{name}", sided, [body.format(letter) for body in bodies], axes
        elif pairs[0][0].startswith("right"):
            yield name, [(a, b) for a, b in pairs], bodies, axes
        else:
            both = [(f"{side}_{a}", f"{side}_{b}") for a, b in pairs for side in _SIDES]
            yield name, both, bodies, axes


def _measurement(
    name: str, pairs: Iterable[tuple[str, str]], bodies: Iterable[str], axes: str
) -> ElementTree.Element:
    marked = [_node("MarkerPair", {"markers": " ".join(pair)}) for pair in pairs]
    scales = [_node("BodyScale", {"axes": axes}, name=body) for body in bodies]
    return _node(
        "Measurement",
        {"apply": "true"},
        _node("MarkerPairSet", _node("objects", *marked)),
        _node("BodyScaleSet", _node("objects", *scales)),
        name=name,
    )


def _tasks(placing: bool, *coordinates: ElementTree.Element) -> ElementTree.Element:
    """A task for every marker, and others; to place the others, joint centres decide."""
    tasks = []
    for marker in opensim_markers():
        weight = marker.weight if not placing else 5.0 if marker.fixed else 0.1
        tasks.append(
            _node("IKMarkerTask", {"apply": "true", "weight": f"{weight:g}"}, name=marker.name)
        )
    return _node("IKTaskSet", _node("objects", *tasks, *coordinates))


def _coordinate_task(
    name: str, source: str = "manual_value", weight: float = 1.0
) -> ElementTree.Element:
    """A task that keeps a coordinate near zero, or near its value in a file."""
    texts = {"apply": "true", "weight": f"{weight:g}", "value_type": source, "value": "0"}
    return _node("IKCoordinateTask", texts, name=name)


def _node(
    tag: str, *contents: ElementTree.Element | Mapping[str, str], name: str = ""
) -> ElementTree.Element:
    """An element with others inside, or texts by their tags."""
    element = ElementTree.Element(tag, {"name": name} if name else {})
    for content in contents:
        if isinstance(content, ElementTree.Element):
            element.append(content)
            continue
        for inner, text in content.items():
            ElementTree.SubElement(element, inner).text = text
    return element


def _write_document(content: ElementTree.Element, path: Path) -> None:
    root = ElementTree.Element("OpenSimDocument", Version="40000")
    root.append(content)
    ElementTree.indent(root, "\t")
    text = ElementTree.tostring(root, "utf-8", xml_declaration=True)
    path.write_bytes(text + b"\n")
