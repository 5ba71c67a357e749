"""Rigged glTF and GLB: a skinned mesh and its skeleton, in the names of its nodes."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from calib.checks import FloatArray, IntArray
from calib.errors import InputError
from silhouette_core.body.body_arrays import MOST_ROWS
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigs.closed_surface import close_surface
from silhouette_core.body.rigs.gltf_document import GltfDocument
from silhouette_core.body.rigs.rig_checks import (
    check_bones,
    check_different,
    check_rest,
    normalised_weights,
    parents_first,
    short,
    skinned_body,
    z_up,
)
from silhouette_core.body.rigs.rig_dofs import read_rig_table

_MOST_NODES = 10_000
_MOST_SETS = 4  # of four weights each
_TRIANGLES = 4


@dataclass(frozen=True, eq=False)
class _Surface:
    """Triangles of one primitive in the rest pose, glTF's frame, and the joints that move them."""

    vertices: FloatArray
    faces: IntArray
    parts: IntArray
    weights: FloatArray


def read_gltf(path: Path) -> BodyModel:
    """Body of a skinned mesh.

    The rest pose is that of the nodes without animation; y up and facing +z become z up and facing
    -y. Every joint but the root turns about three axes, 150 degrees to either side, or as
    NAME.rig.toml beside the file says. Seams and holes of the surface are closed. Meshes without a
    skin, materials, morph targets and animations are left out. Landmarks are the joints. Raises
    InputError where the file is damaged, has no skin, or has a rig that no body can have.
    """
    document = GltfDocument.read(path)
    worlds, above = _node_transforms(document)
    skinned = [
        (node["mesh"], node["skin"])
        for node in document.items("nodes")
        if "mesh" in node and "skin" in node
    ]
    if not skinned:
        raise InputError(
            f"{path} has no mesh with a skin: bind the mesh to its skeleton (in Blender: parent it"
            " to the armature with automatic weights) and export again"
        )
    skins = {number: _skin_joints(document, number) for _, number in skinned}
    nodes = sorted({node for joints in skins.values() for node in joints})
    names = _node_names(document, nodes)
    parents = {names[node]: names.get(_joint_above(node, above, names), "") for node in nodes}
    order = parents_first(path, parents)
    number_of = {name: number for number, name in enumerate(order)}
    node_of = {name: node for node, name in names.items()}
    joints = np.array([worlds[node_of[name]][:3, 3] for name in order])
    part_of = {node: number_of[name] for node, name in names.items()}
    surfaces: list[_Surface] = []
    for mesh, skin in skinned:
        parts = np.array([part_of[node] for node in skins[skin]], np.int64)
        moves = _bind_to_rest(document, skin, np.array([worlds[node] for node in skins[skin]]))
        for primitive in _primitives(document, mesh):
            surfaces.append(_surface_of(document, primitive, parts, moves))
            count = max(sum(len(s.vertices) for s in surfaces), sum(len(s.faces) for s in surfaces))
            if count > MOST_ROWS:
                raise InputError(f"{path} has more than {MOST_ROWS} triangles: simplify it")
    if not surfaces:
        raise InputError(f"{path} has a skinned mesh without triangles: export it again")
    table = read_rig_table(path)
    table.check_joints(path, order)
    tree = KinematicTree.from_parts(
        [(name, parents[name], table.dofs(name) if parents[name] else ()) for name in order],
        root_fixed=table.root_fixed,
    )
    check_bones(path, order, tree.parents, joints)
    return _body(path, tree, z_up(joints), surfaces)


def _body(
    path: Path, tree: KinematicTree, joints: FloatArray, surfaces: list[_Surface]
) -> BodyModel:
    first = np.cumsum([0, *(len(surface.vertices) for surface in surfaces)])
    vertices = z_up(np.concatenate([surface.vertices for surface in surfaces]))
    faces = np.concatenate([s.faces + n for s, n in zip(surfaces, first, strict=False)])
    check_rest(path, joints, vertices)
    used, faces, vertices, _ = close_surface(vertices, faces)
    if not 0 < len(faces) <= MOST_ROWS:
        raise InputError(f"{path} has a skinned mesh without an area, or too many holes: mend it")
    widest = max(surface.parts.shape[1] for surface in surfaces)
    room = [((0, 0), (0, widest - surface.parts.shape[1])) for surface in surfaces]
    every = np.concatenate([np.pad(s.parts, more) for s, more in zip(surfaces, room, strict=True)])
    shares = np.concatenate(
        [np.pad(s.weights, more) for s, more in zip(surfaces, room, strict=True)]
    )
    return skinned_body(tree, joints, vertices, faces, every[used], shares[used], joints)


def _node_transforms(document: GltfDocument) -> tuple[dict[int, FloatArray], list[int]]:
    """World from node (4, 4) of every node, and the number of its parent, -1 without one."""
    nodes = document.items("nodes")
    if len(nodes) > _MOST_NODES:
        raise InputError(f"{document.path} has more than {_MOST_NODES} nodes: export less into it")
    above = [-1] * len(nodes)
    for number, node in enumerate(nodes):
        children = node.get("children", [])
        if not isinstance(children, list):
            raise document.damaged(f"node {number} has no list of children")
        for child in children:
            document.item("nodes", child)
            assert isinstance(child, int)
            if above[child] >= 0:
                raise document.damaged(f"node {child} has two parents")
            above[child] = number
    worlds: dict[int, FloatArray] = {}
    order = [number for number, parent in enumerate(above) if parent < 0]
    for number in order:
        local, parent = _local(document, nodes[number]), above[number]
        world = local if parent < 0 else worlds[parent] @ local
        if not np.isfinite(world).all():
            raise document.damaged(f"node {number} has a transform that is not finite")
        worlds[number] = world
        order += nodes[number].get("children", [])
    if len(order) < len(nodes):
        circle = next(number for number in range(len(nodes)) if number not in worlds)
        raise InputError(
            f"{document.path}: the rig is cyclic: node {circle} hangs on itself through its"
            " parents; break the circle"
        )
    return worlds, above


def _local(document: GltfDocument, node: dict[str, Any]) -> FloatArray:
    """Parent from node, (4, 4)."""
    if "matrix" in node:
        return _numbers(document, node["matrix"], 16).reshape(4, 4).T
    local = np.eye(4)
    quaternion = _numbers(document, node.get("rotation", [0, 0, 0, 1]), 4)
    scale = _numbers(document, node.get("scale", [1, 1, 1]), 3)
    if not 0.5 < np.linalg.norm(quaternion) < 2:
        raise document.damaged("a node's rotation is no unit quaternion")
    local[:3, :3] = Rotation.from_quat(quaternion).as_matrix() * scale
    local[:3, 3] = _numbers(document, node.get("translation", [0, 0, 0]), 3)
    return local


def _numbers(document: GltfDocument, value: object, count: int) -> FloatArray:
    if not (isinstance(value, list) and len(value) == count) or not all(
        isinstance(x, int | float) and abs(x) < 1e9 for x in value
    ):
        raise document.damaged(f"{short(value)} is no list of {count} numbers")
    return np.array(value, float)


def _skin_joints(document: GltfDocument, skin: object) -> list[int]:
    joints = document.item("skins", skin).get("joints")
    if not isinstance(joints, list) or not joints:
        raise document.damaged(f"skin {short(skin)} has no joints")
    for joint in joints:
        document.item("nodes", joint)
    return joints


def _node_names(document: GltfDocument, nodes: list[int]) -> dict[int, str]:
    names = {node: str(document.item("nodes", node).get("name", f"joint_{node}")) for node in nodes}
    check_different(document.path, list(names.values()))
    return names


def _joint_above(node: int, above: list[int], names: dict[int, str]) -> int:
    """The nearest joint among the nodes above one, -1 without."""
    higher = above[node]
    while higher >= 0 and higher not in names:
        higher = above[higher]
    return higher


def _bind_to_rest(document: GltfDocument, skin: int, worlds: FloatArray) -> FloatArray:
    """World from mesh (J, 4, 4) of every joint of a skin in the rest pose."""
    number = document.item("skins", skin).get("inverseBindMatrices")
    if number is None:
        return worlds
    inverse = document.array(number, ("MAT4",)).astype(float).swapaxes(1, 2)  # columns come first
    if len(inverse) < len(worlds) or not np.isfinite(inverse).all():
        raise document.damaged("its inverse bind matrices are too few or not finite")
    return worlds @ inverse[: len(worlds)]


def _primitives(document: GltfDocument, mesh: object) -> list[dict[str, Any]]:
    primitives = document.item("meshes", mesh).get("primitives")
    if not isinstance(primitives, list) or not all(isinstance(p, dict) for p in primitives):
        raise document.damaged(f"mesh {short(mesh)} has no primitives")
    if any(primitive.get("mode", _TRIANGLES) != _TRIANGLES for primitive in primitives):
        raise InputError(f"{document.path} has a mesh that is not of triangles: triangulate it")
    return primitives


def _surface_of(
    document: GltfDocument, primitive: dict[str, Any], parts: IntArray, moves: FloatArray
) -> _Surface:
    """A primitive moved to the rest pose by its skin."""
    attributes = primitive.get("attributes")
    if not isinstance(attributes, dict):
        raise document.damaged("a primitive has no attributes")
    points = document.array(attributes.get("POSITION"), ("VEC3",)).astype(float)
    if len(points) > MOST_ROWS:
        raise InputError(f"{document.path} has more than {MOST_ROWS} vertices: simplify it")
    joint_sets, shares = [], []
    for k in range(_MOST_SETS):
        if f"JOINTS_{k}" not in attributes:
            break
        joint_sets.append(document.array(attributes[f"JOINTS_{k}"], ("VEC4",)).astype(np.int64))
        shares.append(document.array(attributes.get(f"WEIGHTS_{k}"), ("VEC4",)).astype(float))
    if not joint_sets:
        raise InputError(f"{document.path} has a mesh without skin weights: bind it to the rig")
    if any(len(array) != len(points) for array in (*joint_sets, *shares)):
        raise document.damaged("its skin weights are not as many as its vertices")
    joints = np.concatenate(joint_sets, axis=1)
    weights = normalised_weights(document.path, joints, np.concatenate(shares, axis=1), len(parts))
    if "indices" in primitive:
        corners = document.array(primitive["indices"], ("SCALAR",)).astype(np.int64)
    else:
        corners = np.arange(len(points))
    if (
        len(corners) % 3
        or not 0 <= corners.min() <= corners.max() < len(points)
        or len(corners) > 3 * MOST_ROWS
    ):
        raise document.damaged("its triangles are too many, or have vertices that do not exist")
    rest = np.zeros((len(points), 3))
    for k in range(joints.shape[1]):
        move = moves[joints[:, k], :3]
        moved = np.einsum("vij,vj->vi", move[:, :, :3], points) + move[:, :, 3]
        rest += weights[:, k, None] * moved
    return _Surface(rest, corners.reshape(-1, 3), parts[joints], weights)
