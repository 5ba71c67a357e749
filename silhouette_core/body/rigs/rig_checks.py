"""Checks of rigs that were read from files, whoever made them."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from calib.checks import FloatArray, IndexArray, RealArray
from calib.errors import InputError
from silhouette_core.body.body_arrays import LONGEST_NAME, MOST_PARTS
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.body.model import BodyModel

SMALLEST_M, LARGEST_M = 1 / 100, 100  #: Smallest and largest extent of a body.


def z_up(points: ArrayLike) -> FloatArray:
    """Points (..., 3) of a file with y up, facing +z, with z up, facing -y."""
    x, y, z = np.moveaxis(np.asarray(points, float), -1, 0)
    return np.stack([x, -z, y], axis=-1)


def check_different(path: Path, names: Sequence[str]) -> None:
    """Refuses joints of one name with an `InputError`."""
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"{path} has two joints with the name {short(name)}: rename one")


def parents_first(path: Path, parents: Mapping[str, str], most: int = MOST_PARTS) -> list[str]:
    """Names of the joints of a rig, every one after its parent. Raises InputError where there is no
    root or more than one, a parent is missing, joints hang in a circle, there are too many, or a
    name cannot be one.

    Args:
        path: the file, for messages.
        parents: name of each joint -> name of its parent, empty for the root.
        most: number of joints that there may be.
    """
    for name in parents:
        _check_joint_name(path, name)
    if len(parents) > most:
        raise InputError(
            f"{path} has {len(parents)} joints, and a body can have {most}: remove those that"
            " move no surface"
        )
    for name, parent in parents.items():
        if parent and parent not in parents:
            raise InputError(
                f"{path}: the joint {name!r} hangs on {short(parent)}, which the rig does not have:"
                " connect it"
            )
    roots = [name for name, parent in parents.items() if not parent]
    if len(roots) > 1:
        raise InputError(
            f"{path}: the rig is not connected: {roots[0]!r} and {roots[1]!r} both have no parent;"
            " hang all on one root"
        )
    children: dict[str, list[str]] = {}
    for name, parent in parents.items():
        children.setdefault(parent, []).append(name)
    order = list(roots)
    for name in order:
        order += children.get(name, [])
    if len(order) < len(parents):
        circle = next(name for name in parents if name not in order)
        raise InputError(
            f"{path}: the rig is cyclic: {circle!r} hangs on itself through its parents; break the"
            " circle"
        )
    if not order:
        raise InputError(f"{path} has no joint: give a file with a rig")
    return order


def check_rest(path: Path, joints_m: RealArray, vertices_m: NDArray) -> None:
    """Checks that a body at rest has the size of a body. Raises InputError where a number is not
    finite, or the body is far too small or large.

    Args:
        path: the file, for messages.
        joints_m: (P, 3) joints.
        vertices_m: (V, 3) surface, or what spans it.
    """
    points = np.concatenate([joints_m, vertices_m])
    if not np.isfinite(points).all():
        raise InputError(f"{path} has positions that are not finite: export it again")
    extent = float(np.ptp(points, axis=0).max())
    if not SMALLEST_M <= extent <= LARGEST_M or np.abs(points).max() > 10 * LARGEST_M:
        raise InputError(
            f"{path}: its body would be {extent:.3g} m large: is its unit the metre? Bodies have"
            f" {SMALLEST_M:g} to {LARGEST_M:g} m"
        )


def check_bones(path: Path, names: list[str], parents: IndexArray, joints_m: RealArray) -> None:
    """Checks that no joint lies where its parent does. Raises InputError where a bone has no
    length.

    Args:
        path: the file, for messages.
        parents: (P,) index of the parent, -1 of the root.
        joints_m: (P, 3) positions.
    """
    here = np.flatnonzero(parents >= 0)
    if not len(here):
        return
    length = np.linalg.norm(joints_m[here] - joints_m[parents[here]], axis=1)
    shortest = int(length.argmin())
    if length[shortest] < 1e-6 * max(float(np.ptp(joints_m, axis=0).max()), 1e-9):
        child = here[shortest]
        raise InputError(
            f"{path}: the bone from {names[parents[child]]!r} to {names[child]!r} has no length:"
            " move the joint, or remove it"
        )


def normalised_weights(path: Path, parts: IndexArray, weights: RealArray, count: int) -> FloatArray:
    """Skin weights (V, K) float64 that sum to one, of those that a file holds. Raises InputError
    where weights are negative, not finite or do not sum to one, or a part is missing.

    Args:
        path: the file, for messages.
        parts: (V, K) number of each weight's part.
        weights: (V, K) as in the file.
        count: number of parts.
    """
    if not np.isfinite(weights).all() or weights.min(initial=0) < 0:
        raise InputError(f"{path} has skin weights that are negative or not finite: mend them")
    if len(parts) and not (parts.min() >= 0 and parts.max() < count):
        raise InputError(f"{path} has skin weights of joint {parts.max()}, but {count} joints")
    sums = weights.sum(1, dtype=float)
    off, tolerance = np.abs(sums - 1), 0.02  # weights in 8 bits, four of them
    if len(off) and off.max() > tolerance:
        worst = int(off.argmax())
        raise InputError(
            f"{path}: the skin weights of vertex {worst} sum to {sums[worst]:.3g} and not to 1 (so"
            f" {np.count_nonzero(off > tolerance)} vertices): normalise the weights"
        )
    return weights.astype(float) / sums[:, None]


def skinned_body(
    tree: KinematicTree,
    joints_m: FloatArray,
    vertices_m: FloatArray,
    faces: IndexArray,
    parts: IndexArray,
    weights: FloatArray,
    landmarks_m: FloatArray,
) -> BodyModel:
    """Body of a skin, of whose weights the four largest of each vertex count; a face belongs to the
    part with the largest weight over its corners.

    Args:
        joints_m: (P, 3).
        vertices_m: (V, 3).
        faces: (F, 3).
        parts: (V, K) number of each weight's part.
        weights: (V, K).
        landmarks_m: (L, 3).
    """
    if weights.shape[1] < 4:
        room = ((0, 0), (0, 4 - weights.shape[1]))
        parts, weights = np.pad(parts, room), np.pad(weights, room)
    order = np.argsort(-weights, axis=1, kind="stable")[:, :4]
    weights = np.take_along_axis(weights, order, axis=1)
    weights /= weights.sum(1, keepdims=True)
    parts = np.take_along_axis(parts, order, axis=1)
    parts = np.where(weights > 0, parts, parts[:, :1]).astype(np.int32)
    of_corners = parts[faces].reshape(len(faces), -1)
    share = weights[faces].reshape(len(faces), -1)
    total = np.stack([(share * (of_corners == part[:, None])).sum(1) for part in of_corners.T], 1)
    face_part = np.take_along_axis(of_corners, total.argmax(1)[:, None], axis=1)[:, 0]
    skin = parts, weights
    return BodyModel.as_given(tree, joints_m, vertices_m, faces, face_part, skin, landmarks_m)


def short(name: object) -> str:
    """A name of a file's, quoted and not too long for a message."""
    text = repr(str(name))
    return text if len(text) <= LONGEST_NAME else text[:LONGEST_NAME] + "…'"


def _check_joint_name(path: Path, name: str) -> None:
    if not name or len(name) > LONGEST_NAME or not name.isprintable():
        raise InputError(
            f"{path} has a joint with the name {short(name)}: names have 1 to {LONGEST_NAME}"
            " printable characters"
        )
