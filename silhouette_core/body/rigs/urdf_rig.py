"""URDF robots: links that fixed joints connect become one part, in the names of the file.

yourdfpy (MIT, last release 2026) parses them, from text that was found to be XML of bounded depth.
"""

import io
import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from calib.checks import FloatArray, IntArray
from calib.errors import InputError
from calib.storage.documents import load_text, parse_xml
from silhouette_core.body.body_arrays import MOST_PARTS, MOST_ROWS
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigid_parts import ClosedMesh, RigidShape, body_of_parts
from silhouette_core.body.rigs.closed_surface import MESH_SUFFIXES, close_surface, read_triangles
from silhouette_core.body.rigs.rig_checks import LARGEST_M, check_rest, parents_first, short
from silhouette_core.body.rigs.rig_dofs import read_rig_table

_LARGEST = 20_000_000
_MOST_LINKS = 2000
_TURNS = "revolute", "continuous"
_STILL = "fixed", "prismatic", "floating", "planar"
_WHOLE_TURN_DEG = 180
_FACING = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]])  # x forward to -y
_FOLDERS_ABOVE = 3
_SECTIONS, _EDGES = 24, 8


@dataclass(frozen=True, eq=False)
class _Robot:
    """Links of a robot with all joints at zero."""

    order: list[str]  #: names of the links, parents first.
    joint_to: dict[str, Any]  #: link -> the joint that carries it, yourdfpy's; none of the root.
    world: dict[str, FloatArray]  #: link -> its frame (4, 4) in the body frame.
    part: dict[str, str]  #: link -> the link after which its part is named.


def read_urdf(path: Path, say: Callable[[str], None] = lambda line: None) -> BodyModel:
    """Body of a robot.

    The rest pose has all joints at zero; z up, x forward become z up, facing -y. Revolute and
    continuous joints turn (continuous ones 180 degrees to either side); one that mimics another
    stays at zero. Prismatic, planar and floating joints stay at zero, and connect like fixed ones.
    The shapes are the visual ones, or those of collision where a link has no visual; meshes lie in
    the file's folder or one above it. Landmarks are the joints, under the names of their links, and
    the last links of every chain of fixed ones. Raises InputError where the file is damaged, or no
    body can be made of it.

    Args:
        say: receives a line about every joint that moves in the file, but not here.
    """
    robot, links = _read_robot(path, say)
    table = read_rig_table(path)
    parts = [link for link in robot.order if robot.part[link] == link]
    if len(parts) > MOST_PARTS:
        raise InputError(
            f"{path} has {len(parts)} links that turn, and a body can have {MOST_PARTS}: make"
            " joints fixed that hardly move"
        )
    above = {
        link: robot.part[robot.joint_to[link].parent] for link in parts if link in robot.joint_to
    }
    ends = _chain_ends(robot)
    tree = KinematicTree.from_parts(
        [
            (link, above.get(link, ""), _dofs(path, robot, link) if link in above else ())
            for link in parts
        ],
        {link: robot.part[link] for link in ends},
        root_fixed=table.root_fixed or parts[0] == "world",
    )
    shapes: dict[str, list[RigidShape]] = {link: [] for link in parts}
    count = np.zeros(2, int)
    for link in robot.order:
        for shape in link_shapes(path, links[link], robot.world[link]):
            shapes[robot.part[link]].append(shape)
            count += len(shape.vertices_m), len(shape.faces)
            if count.max() > MOST_ROWS:
                raise InputError(
                    f"{path}: its meshes have more than {MOST_ROWS} triangles: simplify them"
                )
    surface = [
        s.vertices_m for solids in shapes.values() for s in solids if isinstance(s, ClosedMesh)
    ]
    if not surface:
        raise InputError(f"{path} has no visual or collision shape: a silhouette needs some")
    joints = np.array([robot.world[link][:3, 3] for link in parts])
    check_rest(path, joints, np.concatenate(surface))
    marks = np.array([robot.world[link][:3, 3] for link in (*parts, *ends)])
    return body_of_parts(tree, joints, [shapes[link] for link in parts], marks)


def _read_robot(path: Path, say: Callable[[str], None]) -> tuple[_Robot, dict[str, Any]]:
    """The checked robot, and yourdfpy's links by name."""
    parsed = _parsed(path)
    links = {str(link.name): link for link in parsed.links}
    if max(len(parsed.links), len(parsed.joints)) > _MOST_LINKS:
        raise InputError(f"{path} has more than {_MOST_LINKS} links: give a smaller robot")
    if len(links) < len(parsed.links):
        raise InputError(f"{path} has two links of one name: rename one")
    joint_to: dict[str, Any] = {}
    for joint in parsed.joints:
        if joint.child in joint_to:
            raise InputError(f"{path}: the link {short(joint.child)} hangs on two joints: cut one")
        if joint.child not in links or joint.parent not in links:
            raise InputError(f"{path}: joint {short(joint.name)} connects links that it lacks")
        if joint.type not in (*_TURNS, *_STILL):
            raise InputError(f"{path}: joint {short(joint.name)} has the type {short(joint.type)}")
        joint_to[joint.child] = joint
    part: dict[str, str] = {}
    world: dict[str, FloatArray] = {}
    above = {name: joint_to[name].parent if name in joint_to else "" for name in links}
    order = parents_first(path, above, most=_MOST_LINKS)
    for link in order:
        joint = joint_to.get(link)
        if joint is None:
            world[link], part[link] = np.eye(4), link
            world[link][:3, :3] = _FACING
            continue
        origin = np.eye(4) if joint.origin is None else np.asarray(joint.origin, float)
        if not np.abs(origin).max() < 1e6 or not np.abs(joint.axis).max() < 1e6:
            raise InputError(
                f"{path}: joint {short(joint.name)} has an origin or axis far too large"
            )
        world[link] = world[joint.parent] @ origin
        part[link] = link if joint.type in _TURNS else part[joint.parent]
        if joint.type in _STILL[1:]:
            say(f"{path.name}: the {joint.type} joint {short(joint.name)} stays at zero")
        elif joint.mimic is not None:
            say(f"{path.name}: joint {short(joint.name)} mimics another, and stays at zero")
    return _Robot(order, joint_to, world, part), links


def _parsed(path: Path) -> Any:
    """yourdfpy's robot."""
    import yourdfpy  # imports trimesh and lxml

    text = load_text(path, _LARGEST)
    root = parse_xml(text, path)
    if root.tag != "robot":
        raise InputError(f"{path} is no URDF: it holds <{short(root.tag)[1:-1]}>, not <robot>")
    logging.getLogger("yourdfpy").setLevel(logging.CRITICAL)
    declared = text.partition("?>")[2] if text.lstrip().startswith("<?xml") else text
    try:
        with np.errstate(all="ignore"):
            return yourdfpy.URDF.load(
                io.BytesIO(declared.strip().encode()),
                load_meshes=False,
                build_scene_graph=False,
                build_collision_scene_graph=False,
            ).robot
    # It raises whatever a missing element or a word in the place of a number leads to.
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:150]
        raise InputError(f"{path} is no complete URDF ({reason}): mend it") from None


def _dofs(path: Path, robot: _Robot, link: str) -> tuple[Dof, ...]:
    """The turn of the joint that carries a link, about an axis of the body frame."""
    joint = robot.joint_to[link]
    axis = robot.world[link][:3, :3] @ np.asarray(joint.axis, float).reshape(-1)[:3]
    length = np.linalg.norm(axis)
    if not 1e-6 < length < 1e6:
        raise InputError(f"{path}: the axis of joint {short(joint.name)} has no direction: mend it")
    low, high = -_WHOLE_TURN_DEG, _WHOLE_TURN_DEG
    limit = joint.limit
    if joint.type == "revolute" and limit is not None:
        given = [side for side in (limit.lower, limit.upper) if side is not None]
        if len(given) == 2:
            low, high = np.degrees(given).tolist()
    if not -2 * _WHOLE_TURN_DEG <= low < high <= 2 * _WHOLE_TURN_DEG:
        raise InputError(
            f"{path}: joint {short(joint.name)} has the limits {low:.4g} to {high:.4g} degrees:"
            " give them in radians, the lower below the upper"
        )
    x, y, z = (axis / length).tolist()
    return (Dof(str(joint.name), (x, y, z), (low, high), fixed=joint.mimic is not None),)


def _chain_ends(robot: _Robot) -> list[str]:
    """Links at the end of a chain of fixed joints, away from the joint of their part."""
    carrying = {joint.parent for joint in robot.joint_to.values()}
    return [
        link
        for link in robot.order
        if robot.part[link] != link
        and link not in carrying
        and np.linalg.norm(robot.world[link][:3, 3] - robot.world[robot.part[link]][:3, 3]) > 1e-3
    ]


def link_shapes(path: Path, link: Any, world: FloatArray) -> list[ClosedMesh]:
    """Shapes of a link, in the body frame. Raises InputError where a shape has no size, or a mesh
    cannot be read.

    Args:
        path: the robot's file, beside which meshes lie.
        world: (4, 4) frame of the link in the body frame.
    """
    shapes = []
    for shape in link.visuals or link.collisions or ():
        origin = np.eye(4) if shape.origin is None else np.asarray(shape.origin, float)
        if shape.geometry is None:
            raise InputError(f"{path}: the link {short(link.name)} has a shape without geometry")
        vertices, faces = _geometry(path, link.name, shape.geometry)
        placed = world @ origin
        points = vertices @ placed[:3, :3].T + placed[:3, 3]
        _, faces, points, _ = close_surface(points, faces)
        if len(faces):
            shapes.append(ClosedMesh(points, faces))
    return shapes


def _geometry(path: Path, link: str, geometry: Any) -> tuple[FloatArray, IntArray]:
    from trimesh import creation

    if geometry.mesh is not None:
        mesh = _mesh(path, geometry.mesh)
    elif geometry.box is not None:
        size = _sizes(path, link, geometry.box.size, 3)
        mesh = _subdivided(creation.box(size))
    elif geometry.cylinder is not None:
        sizes = _sizes(path, link, [geometry.cylinder.radius, geometry.cylinder.length], 2)
        mesh = _subdivided(creation.cylinder(sizes[0], sizes[1], sections=_SECTIONS))
    elif geometry.sphere is not None:
        radius = _sizes(path, link, [geometry.sphere.radius], 1)[0]
        mesh = creation.icosphere(3, radius)
    else:
        raise InputError(f"{path}: the link {short(link)} has a shape without geometry")
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)


def _sizes(path: Path, link: str, sizes: Any, count: int) -> FloatArray:
    values = np.array([np.nan if size is None else size for size in np.ravel(sizes)], float)
    if len(values) != count or not ((values > 1e-5) & (values < LARGEST_M)).all():
        raise InputError(
            f"{path}: the link {short(link)} has a shape of the size {short(values.tolist())}: give"
            " metres above zero"
        )
    return values


def _subdivided(mesh: Any) -> Any:
    """With vertices along long edges, so that the surface has some wherever it is touched."""
    longest = mesh.extents.max() / _EDGES
    for _ in range(3):
        if mesh.edges_unique_length.max() <= longest or len(mesh.faces) > 2000:
            break
        mesh = mesh.subdivide()
    return mesh


def _mesh(path: Path, mesh: Any) -> Any:
    file = _beside(path, str(mesh.filename or ""))
    scale = np.ones(3) if mesh.scale is None else np.ravel(np.asarray(mesh.scale, float))
    if len(scale) not in (1, 3) or not ((np.abs(scale) > 1e-6) & (np.abs(scale) < 1e6)).all():
        raise InputError(f"{path}: the mesh {short(mesh.filename)} has no usable scale")
    loaded = read_triangles(file, MOST_ROWS)
    loaded.apply_scale(scale if len(scale) == 3 else float(scale[0]))
    return loaded


def _beside(path: Path, name: str) -> Path:
    """File of a mesh: its path below the robot's folder, or below one of those above it."""
    parts = PurePosixPath(name.partition("://")[2] if "://" in name else name).parts
    if not parts or ".." in parts or not name.isprintable():
        raise InputError(
            f"{path} has a mesh at {short(name)}: put it beside the robot's file, and name it from"
            " there"
        )
    if Path(name).suffix.lower() not in MESH_SUFFIXES:
        raise InputError(
            f"{path}: the mesh {short(name)} is none of {', '.join(MESH_SUFFIXES)}: convert it"
        )
    folder = path.resolve().parent
    for above in (folder, *folder.parents[:_FOLDERS_ABOVE]):
        # Also without the name of the package, which is often the folder's under another name.
        for tail in (parts, parts[1:]):
            if tail and tail[0] != "/" and (file := above.joinpath(*tail)).is_file():
                return file
    raise InputError(f"{path}: the mesh {short(name)} is not beside it: copy it there")
