"""A given body as arrays and JSON text, for files that hold the body itself."""

import json
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from calib.checks import check_array
from silhouette_core.body.kinematic_tree import Dof, KinematicTree
from silhouette_core.body.model import BodyModel

BODY_TYPES = {
    "joints_m": "F64",
    "vertices_m": "F64",
    "faces": "I32",
    "face_part": "I32",
    "skin_parts": "I32",
    "skin_weights": "F64",
    "landmarks_m": "F64",
}
"""Arrays of a body, and their types in a safetensors file."""
MOST_ROWS = 400_000  #: Most vertices or faces of a body that is read from a file.
MOST_NAMES = 2500  #: Most landmarks or degrees of freedom of such a body.
MOST_PARTS = 250  #: Parts of a body; the image of part numbers holds 254.
LONGEST_NAME, _LONGEST_TEXT = 80, 1_000_000
_FARTHEST_M, _LARGEST_DEG = 1000, 3600


def body_arrays(model: BodyModel) -> tuple[dict[str, NDArray], str]:
    """Arrays of a body by the names of `BODY_TYPES`, and its kinematic tree as JSON."""
    tree = model.tree
    text = {
        "names": tree.names,
        "parents": tree.parents.tolist(),
        "dofs": [
            [part, dof.name, [float(x) for x in dof.axis], list(dof.limits_deg), dof.fixed]
            for part, dof in tree.dofs
        ],
        "landmark_names": tree.landmark_names,
        "landmark_part": tree.landmark_part.tolist(),
        "landmark_bones": tree.landmark_bones.tolist(),
        "root_fixed": tree.root_fixed,
    }
    return {name: np.asarray(getattr(model, name)) for name in BODY_TYPES}, json.dumps(text)


def with_prefix(arrays: Mapping[str, NDArray], prefix: str) -> dict[str, NDArray]:
    """Arrays whose names begin with a prefix, by the rest of their names."""
    return {
        name.removeprefix(prefix): array
        for name, array in arrays.items()
        if name.startswith(prefix)
    }


def body_from_arrays(arrays: Mapping[str, NDArray], text: str) -> BodyModel:
    """Body of arrays and text as `body_arrays` gives them, from a file that may hold anything.
    Raises KeyError where something is missing; TypeError where something is of another type;
    ValueError where a shape, an index or a number is such as no body has.
    """
    tree = _tree(text)
    parts = len(tree.names)
    vertices, faces = (np.shape(arrays[name])[:1] for name in ("vertices_m", "faces"))
    shapes = {
        "joints_m": (parts, 3),
        "vertices_m": (*vertices, 3),
        "faces": (*faces, 3),
        "face_part": faces,
        "skin_parts": (*vertices, 4),
        "skin_weights": (*vertices, 4),
        "landmarks_m": (len(tree.landmark_names), 3),
    }
    for name, shape in shapes.items():
        array = arrays[name]
        check_array(f"body.{name}", array, shape)
        integer = BODY_TYPES[name] == "I32"
        if (array.dtype.kind == "i") != integer or not 0 < len(array) <= MOST_ROWS:
            raise ValueError(f"body.{name} has the shape {array.shape} and type {array.dtype}")
        most = (*vertices, parts)[name != "faces"] - 1 if integer else _FARTHEST_M
        if not (array.min() >= (0 if integer else -most) and array.max() <= most):
            raise ValueError(f"body.{name} holds numbers beyond {most:g}")
    weights = arrays["skin_weights"]
    if weights.min() < 0 or abs(weights.sum(1) - 1).max() > 1e-6:
        raise ValueError("body.skin_weights do not sum to 1")
    joints, vertices, faces, part = (
        arrays[name] for name in ("joints_m", "vertices_m", "faces", "face_part")
    )
    skin = arrays["skin_parts"], weights
    return BodyModel.as_given(tree, joints, vertices, faces, part, skin, arrays["landmarks_m"])


def _tree(text: str) -> KinematicTree:
    """The checked kinematic tree of JSON text."""
    if len(text) > _LONGEST_TEXT:
        raise ValueError(f"the body's tree has {len(text):,} characters")
    document = json.loads(text)
    names, marks = _names(document["names"]), _names(document["landmark_names"])
    if len(names) > MOST_PARTS:
        raise ValueError(f"the body has {len(names)} parts, more than {MOST_PARTS}")
    parents = _indices("parents", document["parents"], (len(names),), len(names), -1)
    if parents[0] != -1 or (parents[1:] < 0).any() or (parents >= np.arange(len(names))).any():
        raise ValueError("the body's parents do not come before their parts")
    dofs = []
    for part, name, axis, limits, fixed in document["dofs"][: MOST_NAMES + 1]:
        numbers = np.array([*axis, *limits], float)
        length = float(np.linalg.norm(numbers[:3]))
        if numbers.shape != (5,) or abs(length - 1) > 1e-6 or not isinstance(fixed, bool):
            raise ValueError("a degree of freedom has no unit axis and two limits")
        if not -_LARGEST_DEG <= numbers[3] <= numbers[4] <= _LARGEST_DEG:
            raise ValueError(f"a degree of freedom has the limits {numbers[3:]}")
        x, y, z, low, high = numbers.tolist()
        dofs.append((part, Dof(_names([name])[0], (x, y, z), (low, high), fixed)))
    if len(dofs) > MOST_NAMES:
        raise ValueError(f"the body has more than {MOST_NAMES} degrees of freedom")
    of = _indices("dofs", [part for part, _ in dofs], (len(dofs),), len(names))
    if (np.diff(of) < 0).any():
        raise ValueError("the body's degrees of freedom are not in the order of its parts")
    bones = document["landmark_bones"]
    if not isinstance(document["root_fixed"], bool):
        raise ValueError("root_fixed is neither true nor false")
    return KinematicTree(
        names,
        parents,
        tuple((int(part), dof) for part, dof in dofs),
        marks,
        _indices("landmark_part", document["landmark_part"], (len(marks),), len(names)),
        _indices("landmark_bones", bones or np.zeros((0, 2), int), (len(bones), 2), len(marks)),
        document["root_fixed"],
    )


def _names(values: object) -> tuple[str, ...]:
    if not isinstance(values, list) or not 0 < len(values) <= MOST_NAMES:
        raise ValueError("the body has no list of names, or too long a one")
    for name in values:
        if not (isinstance(name, str) and 0 < len(name) <= LONGEST_NAME and name.isprintable()):
            raise ValueError(f"the body has the name {str(name)[:LONGEST_NAME]!r}")
    if len(set(values)) < len(values):
        raise ValueError("the body has a name twice")
    return tuple(values)


def _indices(
    name: str, values: object, shape: tuple[int, ...], count: int, least: int = 0
) -> NDArray[np.int32]:
    array = np.asarray(values if shape[0] else np.zeros(shape, int))
    if array.shape != shape or array.dtype.kind != "i":
        raise ValueError(f"the body's {name} have the shape {array.shape}")
    if array.size and (array.min() < least or array.max() >= count):
        raise ValueError(f"the body's {name} hold numbers outside of {least} to {count - 1}")
    return array.astype(np.int32)
