"""Rendering of library poses: one virtual camera, centred silhouettes, three resolutions.

The camera looks at the pelvis from `DISTANCE` statures (of other bodies than a person's: root, and
`BodyModel.length_m`), down by the view's pitch; its focal length maps the stature at that distance
to 158 of 240 pixels. The body is turned by the view's yaw; at yaw 0 it faces the camera. The image
is moved by whole pixels until the silhouette's centroid is in the middle of a window of 320 x 240,
and cut off at the window's border.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.checks import BoolArray, ByteArray, Float32Array, FloatArray, IndexArray, RealArray
from silhouette_core.body.model import BodyModel
from silhouette_core.image.cleanup import reduce_silhouette
from silhouette_core.image.raster import render_many
from silhouette_core.image.spans import Spans
from silhouette_core.monocular.tree.kernels import rendering as kernels
from silhouette_core.monocular.window import SIZE, STATURE_PX
from silhouette_core.motion import kinematics

WINDOW_PX = SIZE
SIZES_PX = tuple((WINDOW_PX[0] // reduced, WINDOW_PX[1] // reduced) for reduced in (4, 2, 1))
"""(width, height) of the silhouettes of the tree's levels, coarse to fine, px."""
DISTANCE = 16 / 7  #: Distance of the pelvis from the camera, in statures: 4 m for 1.75 m.
FOCAL_PX = STATURE_PX * DISTANCE
_CANVAS_PX = 448


@dataclass(frozen=True, eq=False)
class RenderedViews:
    """N poses as seen by the virtual camera."""

    windows: ByteArray  #: (N, 240, 320) uint8, part number + 1, 0 for background.
    pelvis_px: Float32Array  #: (N, 2) float32, the pelvis joint's projection (x, y) in the window.
    areas: NDArray[np.uint16]  #: (N, 27) uint16, pixels of each part, also outside the window.
    cut: NDArray[np.int32]  #: (N,) int32, number of pixels outside the window.


def camera_from_body(yaw_rad: float, pitch_rad: float) -> FloatArray:
    """Rotation (3, 3) from a body without heading (facing -y, z up) to the virtual camera.

    Args:
        yaw_rad: turn of the body about the vertical, counter-clockwise from above; 0: frontal.
        pitch_rad: angle of the optical axis below the horizontal.
    """
    cosine, sine = np.cos(pitch_rad), np.sin(pitch_rad)
    camera_from_world = np.array([[1.0, 0.0, 0.0], [0.0, -sine, -cosine], [0.0, cosine, -sine]])
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    return camera_from_world @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def yaw_rotations(heading_rad: FloatArray) -> FloatArray:
    """Rotations (N, 3, 3) about the vertical by (N,) headings."""
    return Rotation.from_rotvec(np.asarray(heading_rad)[:, None] * [0.0, 0.0, 1.0]).as_matrix()


def pose_surfaces(model: BodyModel, quaternions: RealArray, angles_rad: RealArray) -> Float32Array:
    """Surfaces of poses with the pelvis at the origin.

    Args:
        quaternions: (B, 4) w, x, y, z, world from body.
        angles_rad: (B, D), joint angles.

    Returns:
        (B, V, 3) float32, m.
    """
    rotation, origin = kinematics.forward(
        model,
        np.zeros((len(quaternions), 3)),
        np.asarray(quaternions, float),
        np.asarray(angles_rad, float),
    )
    surfaces = np.empty((len(quaternions), *model.vertices_m.shape), np.float32)
    for k in range(len(quaternions)):
        surfaces[k] = kinematics.skin(model, rotation[k], origin[k])
    return surfaces


def view_rotations(quaternions: RealArray, views: RealArray) -> FloatArray:
    """Orientations of the pelvis (n, 3, 3) without heading (n, 4), turned by the views' yaw."""
    half = np.asarray(views, float)[:, 0] / 2
    yaw = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], -1)
    return kinematics.rotation_matrices(yaw) @ kinematics.rotation_matrices(quaternions)


def render_views(
    model: BodyModel, surfaces: Float32Array, which: IndexArray, views: RealArray
) -> RenderedViews:
    """Part-number projections of posed bodies, centred in windows.

    Args:
        surfaces: (B, V, 3) float32, m, pelvis at the origin, heading removed.
        which: (N,), index of the surface of each view.
        views: (N, 2) yaw and pitch of each view, radians.

    Source: Okada and Stenger, section 3.1.
    """
    turns = np.array([camera_from_body(*view).T for view in np.asarray(views, float)], np.float32)
    placed = surfaces[which] @ turns
    placed[..., 2] += DISTANCE * model.length_m
    middle = (_CANVAS_PX - 1) / 2
    matrix = np.array([[FOCAL_PX, 0, middle], [0, FOCAL_PX, middle], [0, 0, 1]])
    parts = render_many(placed, model.faces, model.face_part, matrix, (_CANVAS_PX, _CANVAS_PX))
    windows = np.empty((len(which), WINDOW_PX[1], WINDOW_PX[0]), np.uint8)
    shifts, cut = np.empty((len(which), 2), np.int32), np.empty(len(which), np.int32)
    areas = np.zeros((len(which), len(model.names)), np.uint16)
    kernels.centre_windows(parts, windows, shifts, areas, cut)
    return RenderedViews(windows, (middle + shifts).astype(np.float32), areas, cut)


def silhouette_levels(mask: BoolArray) -> tuple[BoolArray, ...]:
    """Silhouette (…, 240, 320) of a window at all resolutions of the tree, coarse to fine."""
    levels = [mask]
    for _ in SIZES_PX[1:]:
        levels.append(reduce_silhouette(levels[-1]))
    return tuple(reversed(levels))


def select_spans(spans: Spans, which: IndexArray) -> Spans:
    """Selection `which` (K,) of silhouettes, in that order."""
    counts = np.diff(spans.offsets)[which]
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    runs = np.repeat(spans.offsets[:-1][which] - offsets[:-1], counts) + np.arange(offsets[-1])
    return Spans(spans.rows[runs], spans.starts[runs], spans.ends[runs], offsets)


def join_spans(parts: Sequence[Spans]) -> Spans:
    """Concatenation of sequences of silhouettes."""
    before = np.cumsum([0, *(len(part.rows) for part in parts)])
    offsets = [part.offsets[1:] + start for part, start in zip(parts, before[:-1], strict=True)]
    rows, starts, ends = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("rows", "starts", "ends")
    )
    return Spans(rows, starts, ends, np.concatenate([[0], *offsets]).astype(np.int64))


def masks_of(spans: Spans, which: IndexArray, size_px: tuple[int, int] = WINDOW_PX) -> BoolArray:
    """Masks (N, h, w) bool of silhouettes `which` (N,) in images of (width, height)."""
    masks = np.zeros((len(which), size_px[1], size_px[0]), bool)
    kernels.draw_runs(spans.rows, spans.starts, spans.ends, spans.offsets, np.asarray(which), masks)
    return masks
