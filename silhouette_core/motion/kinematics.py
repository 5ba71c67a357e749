"""Forward kinematics and linear blend skinning."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from silhouette_core.body.model import BodyModel
from silhouette_core.motion.kernels.kinematics import place_bodies, skin_vertices
from silhouette_core.motion.pose import Pose, PoseArrays


def rotation_matrices(quaternion_wxyz: np.ndarray) -> np.ndarray:
    """Rotation matrices (…, 3, 3) of quaternions (…, 4) w, x, y, z."""
    q = np.asarray(quaternion_wxyz, float)
    return (
        Rotation.from_quat(q.reshape(-1, 4), scalar_first=True)
        .as_matrix()
        .reshape(*q.shape[:-1], 3, 3)
    )


def quaternions(matrices: np.ndarray) -> np.ndarray:
    """Quaternions (…, 4) w, x, y, z, w >= 0, of rotation matrices (…, 3, 3)."""
    flat = Rotation.from_matrix(np.asarray(matrices, float).reshape(-1, 3, 3)).as_quat(
        canonical=True, scalar_first=True
    )
    return flat.reshape(*np.shape(matrices)[:-2], 4)


def forward(
    model: BodyModel, root_m: np.ndarray, root_quaternion: np.ndarray, angles_rad: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    r"""Rotations and origins of all parts of a body in each frame.

    .. math::

        R_p = R_{\mathrm{parent}(p)} \exp\Bigl(\sum_{k \in p} q_k [a_k]_\times\Bigr), \qquad
        o_p = o_{\mathrm{parent}(p)} + R_{\mathrm{parent}(p)} (J_p - J_{\mathrm{parent}(p)})

    with joint angles :math:`q_k` (rad) about axes :math:`a_k`, and joints :math:`J` at rest (m).

    Args:
        root_m: (T, 3) float64, world position of the pelvis joint.
        root_quaternion: (T, 4) float64, w, x, y, z, world from body.
        angles_rad: (T, D) float64, joint angles in the order of `model.tree.dof_names`.

    Returns:
        Part rotations (T, 27, 3, 3), world from body, and part origins (T, 27, 3), the world
        positions of the joints, m.

    Source: textbook.
    """
    return place(
        model,
        np.ascontiguousarray(np.atleast_2d(root_m), float),
        rotation_matrices(np.atleast_2d(root_quaternion)),
        np.ascontiguousarray(np.atleast_2d(angles_rad), float),
    )


def place(
    model: BodyModel, root_m: np.ndarray, root_rotation: np.ndarray, angles_rad: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """As `forward`, of poses in the form of `Pose`.

    Args:
        root_m: (T, 3) float64, world position of the pelvis joint.
        root_rotation: (T, 3, 3) float64, world from body.
        angles_rad: (T, D) float64.
    """
    return place_with_axes(model, root_m, root_rotation, angles_rad)[:2]


def place_with_axes(
    model: BodyModel, root_m: np.ndarray, root_rotation: np.ndarray, angles_rad: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """As `place`, with the world axes (T, D, 3) about which the angles turn."""
    count, parts = len(root_m), len(model.names)
    rotations, origins = np.empty((count, parts, 3, 3)), np.empty((count, parts, 3))
    axes = np.empty((count, model.dof_count, 3))
    place_bodies(
        model.tree.parents,
        model.joints_m,
        model.tree.dof_part,
        model.tree.dof_axis,
        root_rotation,
        root_m,
        angles_rad,
        rotations,
        origins,
        axes,
    )
    return rotations, origins, axes


def relative_rotations(part_rotation: np.ndarray, parents: np.ndarray) -> np.ndarray:
    """Rotations (…, P, 3, 3) of parts relative to their parents, the identity at rest; of the root
    relative to the world.

    Args:
        part_rotation: (…, P, 3, 3) float64, world from part.
        parents: (P,) int; -1 for the root.
    """
    local, children = part_rotation.copy(), parents >= 0
    above = np.swapaxes(part_rotation[..., parents[children], :, :], -1, -2)
    local[..., children, :, :] = above @ part_rotation[..., children, :, :]
    return local


def landmarks(model: BodyModel, part_rotation: np.ndarray, part_origin: np.ndarray) -> np.ndarray:
    """World positions (T, L, 3) of the landmarks, m, in the order of the body's tree: of a person
    `joints.LANDMARK_NAMES`.
    """
    return _carried(model, model.landmarks_m, part_rotation, part_origin)


def joint_centres(
    model: BodyModel, part_rotation: np.ndarray, part_origin: np.ndarray
) -> np.ndarray:
    """As `landmarks`, of the joint centres that are reported."""
    return _carried(model, model.joint_centres_m, part_rotation, part_origin)


def _carried(
    model: BodyModel, points: np.ndarray, part_rotation: np.ndarray, part_origin: np.ndarray
) -> np.ndarray:
    part = model.tree.landmark_part
    local = points - model.joints_m[part]
    return part_origin[:, part] + np.einsum("tlij,lj->tli", part_rotation[:, part], local)


def skin(model: BodyModel, part_rotation: np.ndarray, part_origin: np.ndarray) -> np.ndarray:
    r"""Posed surface (V, 3), m, of one frame, by linear blend skinning.

    .. math:: x_v = \sum_k w_{vk} \bigl(R_{p_{vk}} (v - J_{p_{vk}}) + o_{p_{vk}}\bigr)

    Args:
        part_rotation: (27, 3, 3) float64, world from body.
        part_origin: (27, 3) float64, world, m.

    Source: textbook.
    """
    vertices, joints, posed = model.vertices_m, model.joints_m, np.empty_like(model.vertices_m)
    parts, weights = model.skin_parts, model.skin_weights
    skin_vertices(vertices, joints, parts, weights, part_rotation, part_origin, posed)
    return posed


def centres_of(model: BodyModel, poses: Sequence[Pose]) -> np.ndarray:
    """Joint centres (K, L, 3) float64 of K poses in the world, m."""
    return joint_centres(model, *place(model, *PoseArrays.from_poses(poses).arrays))


def joints_of(model: BodyModel, poses: Sequence[Pose]) -> np.ndarray:
    """Joints (K, L, 3) float64 of K poses in the world, m."""
    if not poses:
        return np.empty((0, len(model.landmarks_m), 3))
    return landmarks(model, *place(model, *PoseArrays.from_poses(poses).arrays))
