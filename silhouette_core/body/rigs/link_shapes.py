"""Closed surfaces of a URDF link: boxes, cylinders, spheres and mesh files."""

from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.documents import load_text, parse_xml
from calib.errors import InputError
from silhouette_core.body.rigid_parts import ClosedMesh
from silhouette_core.body.rigs.closed_surface import close_surface
from silhouette_core.body.rigs.rig_checks import LARGEST_M, MOST_VERTICES, short

MESH_SUFFIXES = ".stl", ".dae", ".obj", ".ply"
_LARGEST_MESH = 100_000_000
_FOLDERS_ABOVE = 3
_SECTIONS, _EDGES = 24, 8


def link_shapes(path: Path, link: Any, world: NDArray[np.float64]) -> list[ClosedMesh]:
    """Shapes of a link, in the body frame.

    Args:
        path: the robot's file, beside which meshes lie.
        world: (4, 4) frame of the link in the body frame.

    Raises:
        InputError: a shape has no size, or a mesh cannot be read.
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


def _geometry(
    path: Path, link: str, geometry: Any
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
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


def _sizes(path: Path, link: str, sizes: Any, count: int) -> NDArray[np.float64]:
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
    import trimesh

    file = _beside(path, str(mesh.filename or ""))
    scale = np.ones(3) if mesh.scale is None else np.ravel(np.asarray(mesh.scale, float))
    if len(scale) not in (1, 3) or not ((np.abs(scale) > 1e-6) & (np.abs(scale) < 1e6)).all():
        raise InputError(f"{path}: the mesh {short(mesh.filename)} has no usable scale")
    if file.stat().st_size > _LARGEST_MESH:
        raise InputError(f"{file} is larger than {_LARGEST_MESH / 1e6:.0f} MB: simplify it")
    if file.suffix.lower() == ".dae":  # its parser would follow what a document type defines
        parse_xml(load_text(file, _LARGEST_MESH, errors="replace"), file)
    try:
        with file.open("rb") as stream, np.errstate(all="ignore"):
            loaded = trimesh.load_mesh(stream, file_type=file.suffix[1:].lower(), process=False)
        count = len(loaded.faces) if len(loaded.vertices) else 0
        usable = count and np.isfinite(loaded.vertices).all()
    # Its parsers raise whatever a damaged file leads to.
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:150]
        raise InputError(f"{file} cannot be read as a mesh ({reason}): export it again") from None
    if not usable or loaded.faces.min() < 0 or loaded.faces.max() >= len(loaded.vertices):
        raise InputError(f"{file} has no surface: export it again")
    if count > MOST_VERTICES:
        raise InputError(f"{file} has {count} triangles, above {MOST_VERTICES}: simplify it")
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
