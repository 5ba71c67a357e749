"""Part-number images: the body part that is visible in each pixel.

The posed mesh is projected with hidden surfaces removed and every pixel holds its part's number
(Okada and Stenger, 3.1). The rules are those of `silhouette_core.scoring.backend.Backend`. Of a
closed mesh, oriented outwards and seen from outside, culling gives the same image, faster.
"""

import numpy as np
from numpy.typing import NDArray

from calib.checks import (
    ByteArray,
    Float32Array,
    FloatArray,
    IndexArray,
    RealArray,
    check_array,
    float_array,
    image_size,
)
from silhouette_core.image.kernels import raster as kernels

NEAR_M = 5 / 100


def render_parts(
    vertices_cam: RealArray,
    faces: IndexArray,
    face_part: IndexArray,
    matrix: RealArray,
    size: tuple[int, int],
    cull_back: bool = False,
) -> tuple[ByteArray, Float32Array]:
    """Renders a mesh into an image of part numbers and one of depths. Raises ValueError for a wrong
    shape, an index out of range, a size below 1.

    Args:
        vertices_cam: (V, 3) metres, camera frame (x right, y down, z forward).
        faces: (F, 3) vertex indices; outward orientation matters only for `cull_back`.
        face_part: (F,) part index of each face, 0 to 254.
        matrix: (3, 3) pinhole matrix in pixels.
        size: width and height in pixels.
        cull_back: whether faces seen from behind are omitted.

    Returns:
        The part image (h, w) uint8, 0 for background and part index + 1 elsewhere, and the depth
        (h, w) float32 in metres along the optical axis, infinite for background.

    Source: Okada and Stenger, 3.1.
    """
    check_array("vertices_cam", vertices_cam, ("V", 3), np.floating)
    faces, face_part, matrix, (width, height) = _checked(
        faces, face_part, matrix, size, len(vertices_cam)
    )
    parts = np.zeros((height, width), np.uint8)
    depth = np.full((height, width), np.inf, np.float32)
    kernels.draw(
        np.ascontiguousarray(vertices_cam),
        faces,
        face_part,
        matrix,
        NEAR_M,
        cull_back,
        parts,
        depth,
    )
    return parts, depth


def render_many(
    vertices_cam: RealArray,
    faces: IndexArray,
    face_part: IndexArray,
    matrix: RealArray,
    size: tuple[int, int],
    cull_back: bool = True,
) -> ByteArray:
    """Renders the part images (N, h, w) uint8 of many poses of one mesh, in parallel over them.

    Arguments as of `render_parts`, but for vertices_cam (N, V, 3) and face_part, which may be
    (N, F), another for every pose.
    """
    check_array("vertices_cam", vertices_cam, ("N", "V", 3), np.floating)
    if face_part.ndim == 1:
        face_part = face_part[None]
    elif len(face_part) != len(vertices_cam):
        raise ValueError(f"face_part is for {len(face_part)} poses, not {len(vertices_cam)}")
    faces, face_part, matrix, (width, height) = _checked(
        faces, face_part, matrix, size, vertices_cam.shape[1]
    )
    parts = np.zeros((len(vertices_cam), height, width), np.uint8)
    kernels.draw_many(
        np.ascontiguousarray(vertices_cam), faces, face_part, matrix, NEAR_M, cull_back, parts
    )
    return parts


def _checked(
    faces: IndexArray,
    face_part: IndexArray,
    matrix: RealArray,
    size: tuple[int, int],
    vertices: int,
) -> tuple[NDArray[np.int32], NDArray[np.int32], FloatArray, tuple[int, int]]:
    """Checks the arguments of both renderers and converts them to the kernels' types."""
    check_array("faces", faces, ("F", 3), np.integer)
    check_array("face_part", face_part, (*face_part.shape[:-1], len(faces)), np.integer)
    # A copy: numba compiles anew for arrays that may not be written to.
    pinhole = np.array(float_array("matrix", matrix, (3, 3)), order="C")
    if len(faces) and (faces.min() < 0 or faces.max() >= vertices):
        raise ValueError(
            f"faces must index {vertices} vertices, got {faces.min()} to {faces.max()}"
        )
    if len(faces) and (face_part.min() < 0 or face_part.max() > 254):
        raise ValueError(f"face_part must be 0 to 254, got {face_part.min()} to {face_part.max()}")
    return (
        np.ascontiguousarray(faces, np.int32),
        np.ascontiguousarray(face_part, np.int32),
        pinhole,
        image_size("size", size),
    )
