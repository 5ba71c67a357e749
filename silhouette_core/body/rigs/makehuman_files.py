"""Files of a MakeHuman data folder: base mesh, shape targets, rigs and their skin weights.

The folder is MakeHuman's `data` (CC0), as in its own installation or in MPFB: 3dobjs/base.obj,
rigs/standard/rig.NAME.json and weights.NAME.json, and the files
.target (or .target.gz) in targets/macrodetails.
Lengths are in decimetres there, y up; here they become metres, z up, facing -y.
"""

import gzip
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from calib.checks import FloatArray, IntArray
from calib.errors import InputError
from calib.storage.documents import load_text, parse_json
from silhouette_core.body.body_arrays import MOST_ROWS
from silhouette_core.body.rigs.rig_checks import short, z_up

_LARGEST = 60_000_000  # bytes of a file; the largest, skin weights, have 3 MB
_FARTHEST_DM = 10_000
_BODY = "body"  # group of the faces that are the body; the others are helpers


@dataclass(frozen=True, eq=False)
class BaseMesh:
    """MakeHuman's base mesh with all helpers, whose targets and rigs count its vertices."""

    vertices_m: FloatArray  #: (N, 3) float64.
    faces: IntArray  #: (F, 3) int64, triangles of the body.
    cubes: Mapping[str, IntArray]  #: name of each helper group -> its vertices' numbers.


def read_base_mesh(folder: Path) -> BaseMesh:
    """Base mesh of a MakeHuman data folder. Raises InputError where it is missing or damaged."""
    path = folder / "3dobjs" / "base.obj"
    positions: list[list[float]] = []
    triangles: list[tuple[int, int, int]] = []
    members: dict[str, set[int]] = {}
    group = ""
    try:
        for line in load_text(path, _LARGEST).splitlines():
            word, _, rest = line.partition(" ")
            if word == "v":
                positions.append([float(number) for number in rest.split()[:3]])
            elif word == "g":
                group = rest.strip()
            elif word == "f":
                corners = [int(corner.split("/")[0]) - 1 for corner in rest.split()]
                members.setdefault(group, set()).update(corners)
                if group == _BODY:
                    triangles += [
                        (corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)
                    ]
            if max(len(positions), len(triangles)) > MOST_ROWS:
                raise ValueError(f"it has more than {MOST_ROWS} vertices or faces")
        vertices = np.array(positions, float).reshape(len(positions), 3)
        faces = np.array(triangles, np.int64).reshape(-1, 3)
        used = np.array([corner for indices in members.values() for corner in indices], np.int64)
    except (ValueError, IndexError, OverflowError) as error:
        raise InputError(f"{path} is damaged ({str(error)[:150]}): copy it again") from None
    if not len(faces):
        raise InputError(f"{path} has no faces in a group 'body': give MakeHuman's base mesh")
    if not (used.min() >= 0 and used.max() < len(vertices)):
        raise InputError(f"{path} has a face with a vertex that does not exist: copy it again")
    _check_positions(path, vertices)
    cubes = {name: np.array(sorted(indices)) for name, indices in members.items()}
    return BaseMesh(0.1 * z_up(vertices), faces, cubes)


def read_target(folder: Path, name: str, count: int) -> FloatArray:
    """Displacements (N, 3) float64 of the vertices by a shape target, metres. Raises InputError
    where the target is missing or damaged.

    Args:
        name: path below targets/macrodetails, without suffix.
        count: number of vertices, N.
    """
    stem = folder / "targets" / "macrodetails" / name
    path = stem.with_name(stem.name + ".target.gz")
    if path.is_file():
        text = _unpacked(path)
    else:
        path = stem.with_name(stem.name + ".target")
        if not path.is_file():
            raise InputError(
                f"{path.parent} has no {path.name} or {path.name}.gz: give another body, or"
                " MakeHuman's own data folder"
            )
        text = load_text(path, _LARGEST)
    change = np.zeros((count, 3))
    try:
        for line in text.splitlines():
            fields = line.split()
            if len(fields) == 4 and fields[0].isdigit():
                change[int(fields[0][:12])] = [float(number) for number in fields[1:]]
    except (ValueError, IndexError) as error:
        raise InputError(f"{path} is damaged ({str(error)[:150]}): copy it again") from None
    _check_positions(path, change)
    return 0.1 * z_up(change)


def read_bones(folder: Path, rig: str) -> dict[str, tuple[str, Mapping[str, Any]]]:
    """Bones of a rig by name, as in the file: the parent's name, empty for the root, and where the
    head is said to be. Raises InputError where the rig is missing or damaged.
    """
    path = _rig_file(folder, "rig", rig)
    content = parse_json(load_text(path, _LARGEST), path)
    bones = content.get("bones", content) if isinstance(content, dict) else None
    if not isinstance(bones, dict) or not bones:
        raise InputError(f"{path} has no bones: give MakeHuman's own rig")
    result = {}
    for name, bone in bones.items():
        fields = bone if isinstance(bone, dict) else {}
        parent, head = fields.get("parent") or "", fields.get("head")
        if not isinstance(parent, str) or not isinstance(head, dict):
            raise InputError(f"{path}: the bone {short(name)} lacks its parent or head: mend it")
        result[name] = parent, head
    return result


def read_bone_weights(folder: Path, rig: str, names: list[str], count: int) -> FloatArray:
    """Skin weights (N, P) float64 of a rig. Raises InputError where the weights are missing or
    damaged.

    Args:
        names: its P bones; weights of others are refused.
        count: number of vertices, N.
    """
    path = _rig_file(folder, "weights", rig)
    content = parse_json(load_text(path, _LARGEST), path)
    table = content.get("weights") if isinstance(content, dict) else None
    if not isinstance(table, dict):
        raise InputError(f"{path} has no 'weights': give MakeHuman's own file")
    weights = np.zeros((count, len(names)))
    for name, pairs in table.items():
        if name not in names:
            raise InputError(f"{path} has weights of {short(name)}, which the rig does not have")
        try:
            entries = np.array(pairs, float).reshape(len(pairs), 2)
            numbers = entries[:, 0].astype(np.int64)
            if not ((entries[:, 0] >= 0) & (entries[:, 0] < count)).all():
                raise ValueError("a vertex does not exist")
        except (ValueError, TypeError, OverflowError) as error:
            raise InputError(
                f"{path} has damaged weights of {short(name)} ({str(error)[:100]}): copy it again"
            ) from None
        np.add.at(weights[:, names.index(name)], numbers, entries[:, 1])
    return weights


def place_of(
    path: Path, bone: str, place: Mapping[str, Any], mesh: BaseMesh, vertices_m: FloatArray
) -> FloatArray:
    """Position (3,) float64 of the head of a bone in a shaped mesh. Raises InputError where it is
    none that the mesh has.

    Args:
        path: the rig's file, for messages.
        place: what the rig says of it: the middle of a cube or of vertices, or a vertex.
        vertices_m: (N, 3) its vertices after shaping.
    """
    strategy = place.get("strategy")
    if strategy == "CUBE":
        numbers = mesh.cubes.get(str(place.get("cube_name")))
    elif strategy in ("VERTEX", "MEAN"):
        listed = place.get("vertex_indices", [place.get("vertex_index")])
        whole = isinstance(listed, list) and all(type(n) is int for n in listed) and listed
        numbers = np.array(listed) if whole and max(map(abs, listed)) < len(vertices_m) else None
    else:
        numbers = None
    if numbers is None or numbers.min() < 0:
        raise InputError(
            f"{path}: the bone {short(bone)} begins at {short(dict(place))}, which the base"
            " mesh does not have: give the rig of this mesh"
        )
    return vertices_m[numbers].mean(0)


def _rig_file(folder: Path, kind: str, rig: str) -> Path:
    standard = folder / "rigs" / "standard"
    path = standard / f"{kind}.{rig}.json"
    if not rig.replace("_", "").isalnum() or not path.is_file():
        rigs = [file.name[len(kind) + 1 : -5] for file in sorted(standard.glob(f"{kind}.*.json"))]
        raise InputError(
            f"{standard} has no {kind} of a rig {short(rig)}: there are {', '.join(rigs) or 'none'}"
        )
    return path


def _unpacked(path: Path) -> str:
    """Text of a packed file, whose size is bounded while it is unpacked."""
    try:
        with gzip.open(path) as file:
            data = file.read(_LARGEST + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path} cannot be unpacked ({str(error)[:100]}): copy it again") from None
    if len(data) > _LARGEST:
        raise InputError(f"{path} unpacks to more than {_LARGEST / 1e6:.0f} MB: copy it again")
    return data.decode(errors="replace")


def _check_positions(path: Path, numbers: FloatArray) -> None:
    if not (np.isfinite(numbers).all() and np.abs(numbers).max(initial=0) < _FARTHEST_DM):
        raise InputError(f"{path} has positions that no body has: copy it again")
