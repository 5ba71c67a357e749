"""Objects that came with the person and do not move, like a chair: what silhouettes show beside the
body, always in the same place.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from calib.checks import BoolArray
from calib.components import label_components
from calib.moments import even_moments
from silhouette_core.body.model import BodyModel
from silhouette_core.image.cleanup import dilated
from silhouette_core.image.raster import render_parts
from silhouette_core.motion.pose import Pose
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.silhouette_error import posed_mesh
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.footprint import footprint
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import HullObserver
from voxelpose.multiview.silhouettes.mask_store import MaskStore
from voxelpose.multiview.tuning import CARVING, STATIC_OBJECTS

_FRAMES = 24

Mask = BoolArray
Masks = list[Mask]


@dataclass(frozen=True, eq=False)
class StaticObjects:
    """Objects beside a body."""

    pixels: Masks  #: (h, w) bool of each camera that they cover.
    apart: bool
    """Whether they are nowhere near the body, so that they are certainly no part of it, and smaller
    than a person, so that they are not the person either."""


def find_static_objects(
    model: BodyModel,
    poses: Sequence[Pose | None],
    store: MaskStore,
    observer: HullObserver,
    *,
    behind: bool = False,
) -> StaticObjects | None:
    """Objects beside a body; None where there are none, or nothing moves, so that none is known.

    A voxel belongs to one if all cameras show foreground there in nearly all frames, and at least
    half of them beside the body's outline whenever the body is not before it.

    Args:
        model: the body.
        poses: of the T frames.
        store: their silhouettes.
        observer: of the hulls.
        behind: whether what the body hides of them, too, is returned: where it may be wrong.
    """
    posed = [(t, pose) for t, pose in enumerate(poses) if pose is not None]
    chosen = [posed[k] for k in even_moments(len(posed), _FRAMES)]
    places_m = np.array([posed_mesh(model, pose) for _, pose in chosen])
    if np.ptp(places_m, axis=0).max() < STATIC_OBJECTS.apart_m:
        return None
    views = observer.views
    foreground, clear, beside = (
        [np.zeros(camera.size[::-1], np.int32) for camera in views.rig] for _ in range(3)
    )
    for t, pose in chosen:
        bodies = _around_body(model, pose, views)
        for c, (mask, body) in enumerate(zip(store[t], bodies, strict=True)):
            foreground[c] += mask
            clear[c] += ~body
            beside[c] += mask & ~body
    always = [count >= STATIC_OBJECTS.always * len(chosen) for count in foreground]
    witnessed = [
        foreground_frames
        & (seen >= STATIC_OBJECTS.seen * len(chosen))
        & (count >= STATIC_OBJECTS.always * seen)
        for foreground_frames, seen, count in zip(always, clear, beside, strict=True)
    ]
    low = observer.volume.origin_m
    grid = VoxelGrid.from_bounds(low, low + observer.volume.size_m, CARVING.voxel_m)
    objects = _large_pieces(_carved(always, witnessed, grid, observer), grid)
    if not objects.any():
        return None
    apart = _apart(objects, grid, model, [pose for _, pose in chosen])
    covered = [footprint(objects, grid, camera) for camera in views.rig]
    if behind:
        return StaticObjects(covered, apart)
    pairs = enumerate(zip(covered, witnessed, strict=True))
    wide = [_widened(pixels & seen, grid, views, c) for c, (pixels, seen) in pairs]
    return StaticObjects(wide, apart)


def _apart(voxels: BoolArray, grid: VoxelGrid, model: BodyModel, poses: Sequence[Pose]) -> bool:
    """Whether voxels stay away from the body's surface in all poses, in pieces too small for
    people.
    """
    longest = np.ptp(label_components(voxels).bounds, axis=1).max()
    if longest * grid.voxel_size_m >= CARVING.person_m:
        return False
    tree = KDTree(grid.occupied_points(voxels))
    least_m = STATIC_OBJECTS.apart_m
    return all(tree.query(posed_mesh(model, pose))[0].min() > least_m for pose in poses)


def _around_body(model: BodyModel, pose: Pose, views: PinholeViews) -> Masks:
    """Pixels (h, w) bool of each camera within `beside_m` of the body's outline, or inside."""
    vertices_m, bodies = posed_mesh(model, pose), []
    for camera in views.rig:
        seen = vertices_m @ camera.rotation.T + camera.translation
        parts, _ = render_parts(seen, model.faces, model.face_part, camera.matrix, camera.size)
        depth_m = max(float(np.median(seen[:, 2])), 0.3)
        reach = round(STATIC_OBJECTS.beside_m * camera.matrix[0, 0] / depth_m)
        bodies.append(dilated(parts > 0, 2 * reach + 1))
    return bodies


def _carved(always: Masks, witnessed: Masks, grid: VoxelGrid, observer: HullObserver) -> BoolArray:
    """Voxels that are always foreground, and witnessed."""
    views = observer.views
    wide = [dilated(pixels, 3) for pixels in always]
    static = carve(views.rig, wide, grid, observer.rule, views.unknown)
    half = (len(views.rig) + 1) // 2
    rule = CarveRule(len(views.rig) - half, least_agreeing=half)
    return static & carve(views.rig, witnessed, grid, rule)


def _large_pieces(voxels: BoolArray, grid: VoxelGrid) -> BoolArray:
    components = label_components(voxels)
    large = components.sizes * grid.voxel_size_m**3 >= CARVING.smallest_m3
    large[0] = False
    return large[components.labels]


def _widened(pixels: BoolArray, grid: VoxelGrid, views: PinholeViews, c: int) -> Mask:
    """Pixels and those around them, up to the outline of the body beside them."""
    camera = views.rig.cameras[c]
    middle_m = grid.origin_m + 0.5 * grid.size_m
    depth_m = max(float(camera.rotation[2] @ middle_m + camera.translation[2]), 0.3)
    reach = round(STATIC_OBJECTS.beside_m * camera.matrix[0, 0] / depth_m) + 1  # a pixel more
    return dilated(pixels, 2 * reach + 1)
