"""Many placements of one limb, drawn and weighed against an observed silhouette."""

import numpy as np

from silhouette_core.image.kernels.raster import draw
from silhouette_core.jit import parallel_kernel, prange
from silhouette_core.motion.kernels.kinematics import place_parts, skin_vertices


@parallel_kernel
def weigh_placements(
    parents,
    joints,
    dof_part,
    dof_axis,
    root_rotation,
    root,
    angles,
    vertices,
    skin_parts,
    skin_weights,
    faces,
    face_part,
    camera_rotation,
    camera_translation,
    matrix,
    signed,
    covered,
    totals,
):
    """Fills totals (K,): the signed weights (h, w) under the limb as each row of angles (K, D)
    places it, where not covered (h, w) yet.

    signed is d_P (1 - 2 P) of eq. (7)-(9), so that a total is what the limb adds to the silhouette
    distance.
    """
    height, width = signed.shape
    for k in prange(angles.shape[0]):
        part_rotation, part_origin = (
            np.empty((parents.shape[0], 3, 3)),
            np.empty((parents.shape[0], 3)),
        )
        place_parts(
            parents,
            joints,
            dof_part,
            dof_axis,
            root_rotation,
            root,
            angles[k],
            part_rotation,
            part_origin,
        )
        posed, seen = np.empty(vertices.shape), np.empty(vertices.shape)
        skin_vertices(vertices, joints, skin_parts, skin_weights, part_rotation, part_origin, posed)
        for v in range(posed.shape[0]):
            for i in range(3):
                seen[v, i] = (
                    camera_rotation[i, 0] * posed[v, 0]
                    + camera_rotation[i, 1] * posed[v, 1]
                    + camera_rotation[i, 2] * posed[v, 2]
                ) + camera_translation[i]
        parts, depth = (
            np.zeros((height, width), np.uint8),
            np.full((height, width), np.inf, np.float32),
        )
        draw(seen, faces, face_part, matrix, 0.05, True, parts, depth)
        total = 0.0
        for i in range(height):
            for j in range(width):
                if parts[i, j] != 0 and not covered[i, j]:
                    total += signed[i, j]
        totals[k] = total
