"""One body's hull and silhouettes from the raw silhouettes of one frame."""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt

from calib.components import MaskComponents, label_components
from calib.errors import InputError
from silhouette_core.image.cleanup import bounding_box, dilated
from silhouette_core.refinement.observation import Observation, PinholeViews
from voxelpose.multiview.carving.bounds import LEAST_CAMERAS
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.footprint import footprint
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.tuning import CARVING

COMPONENT = np.dtype([("volume_m3", "f8"), ("center_m", "f8", 3), ("bounds_m", "f8", (2, 3))])
"""A connected component of a hull: volume, centre of mass, lower and upper corner of its box."""


@dataclass(frozen=True, eq=False)
class FrameObservation:
    """One frame ready for fitting: the silhouettes of one body, and its hull."""

    views: PinholeViews  #: the C cameras.
    masks: list[np.ndarray]
    """C arrays (h, w) bool, silhouettes without what does not belong to the hull."""
    grid: VoxelGrid  #: a window of voxels around the body.
    occupancy: np.ndarray  #: (nx, ny, nz) bool, the hull's largest component in it.

    @cached_property
    def observation(self) -> Observation:
        """The silhouettes with contours and distances, for refinement; prepared when first used."""
        middle = self.grid.occupied_points(self.occupancy).mean(0)
        return observation_at(self.views, self.masks, middle)


def observation_at(
    views: PinholeViews, masks: list[np.ndarray], place_m: np.ndarray
) -> Observation:
    """Silhouettes (h, w) bool of C views, with contour points for a body near a place (3,)."""
    distance = float(np.median(np.linalg.norm(views.center_m - place_m, axis=1)))
    return Observation.from_masks(views, masks, distance)


def hull_components(voxels: MaskComponents, grid: VoxelGrid) -> np.ndarray:
    """Components of a grid's voxels, rows (n,) of dtype `COMPONENT`."""
    rows = np.empty(len(voxels.sizes) - 1, COMPONENT)
    rows["volume_m3"] = voxels.sizes[1:] * grid.voxel_size_m**3
    rows["center_m"] = grid.origin_m + (voxels.centroids + 0.5) * grid.voxel_size_m
    rows["bounds_m"] = grid.origin_m + voxels.bounds * grid.voxel_size_m
    return rows


def body_rule(cameras: int, tolerance: int, partly_unknown: int = 0) -> CarveRule:
    """Rule by which a voxel may belong to a body.

    A voxel that too few cameras see is no evidence: one occluded by a wall would pass for a body.
    Raises InputError where so many cameras may be wrong that none need agree.

    Args:
        tolerance: number of them that may be wrong about a voxel.
        partly_unknown: number of them of which parts are unknown, so that fewer may agree, but two.
    """
    most = max(2, 3 * cameras // 4)
    if not 0 <= tolerance <= most:
        raise InputError(
            f"a tolerance of {tolerance} of {cameras} cameras leaves none to agree: give at most"
            f" {most}"
        )
    return CarveRule(tolerance, least_agreeing=_least(most - tolerance, partly_unknown))


def _least(usual: int, partly_unknown: int) -> int:
    """Fewest cameras that must agree where parts of some are unknown."""
    return max(usual - partly_unknown, min(usual, 2))


def widened(views: PinholeViews, masks: list[np.ndarray], grid: VoxelGrid) -> list[np.ndarray]:
    """Silhouettes (h, w) bool of C views widened by half a voxel of a grid.

    A voxel then stays where it touches the body, so that thin limbs do not vanish between voxel
    centres.
    """
    middle = grid.origin_m + 0.5 * grid.size_m
    wide = []
    for c, mask in enumerate(masks):
        depth = float(views.rotation[c, 2] @ middle + views.translation_m[c, 2])
        reach = round(0.5 * grid.voxel_size_m * views.intrinsics[c, 0] / max(depth, 0.1))
        wide.append(dilated(mask, 2 * reach + 1))
    return wide


class HullObserver:
    """Turns a frame's raw silhouettes into one body's hull and silhouettes.

    Args:
        volume: where the body may be.
        voxel_size_m: of the fine window.
        rule: how many cameras may object to a voxel.
        joined_m: pieces of a hull up to so far apart are one body's; 0: only those above one
            another are. Thin arms of other bodies than a person's vanish between voxels.
    """

    def __init__(
        self,
        views: PinholeViews,
        volume: VoxelGrid,
        voxel_size_m: float,
        rule: CarveRule | None = None,
        joined_m: float = 0.0,
        person: bool = True,
    ):
        """Keeps the settings."""
        self.views = views
        self._joined_m, self._person = joined_m, person
        self.voxel_size_m = voxel_size_m
        self.rule = rule or CarveRule()
        self.volume = volume
        low = volume.origin_m
        self.coarse = VoxelGrid.from_bounds(
            low, low + volume.size_m, max(CARVING.coarse_m, voxel_size_m)
        )

    def with_unknown(self, unknown: Sequence[np.ndarray]) -> "HullObserver":
        """The same for a frame in which more is unknown: C arrays (h, w) bool."""
        marked = self.views.unknown or [np.False_] * len(unknown)
        views = replace(
            self.views, unknown=tuple(a | b for a, b in zip(unknown, marked, strict=True))
        )
        observer = copy(self)
        observer.views = views
        observer.rule = body_rule(len(unknown), self.rule.tolerance, views.partly_unknown)
        return observer

    def observe(
        self, masks: list[np.ndarray], near_m: np.ndarray | None = None
    ) -> FrameObservation | None:
        """One body of a frame, or None where no hull of a body's size is left.

        Args:
            masks: a silhouette (h, w) bool per camera.
            near_m: (3,) where the body was last; of several hulls the one there is used. None: the
                largest.
        """
        return self.observe_people(masks, [near_m])

    def observe_people(
        self, masks: list[np.ndarray], places_m: Sequence[np.ndarray | None]
    ) -> FrameObservation | None:
        """The bodies at several places of a frame, as of `observe`, as one."""
        components = self.components(masks)
        bodies = [self.body(components, near_m) for near_m in places_m]
        bodies = [body for body in bodies if body is not None]
        if not bodies:
            return None
        grid = self.window(components, *bodies)
        carved = self.carve(masks, grid)
        parts = [self.select(*carved, grid, near_m) for near_m in places_m]
        parts = [one for one in parts if one is not None]
        if len(parts) < 2:
            return parts[0] if parts else None
        return replace(parts[0], occupancy=np.any([one.occupancy for one in parts], axis=0))

    def components(self, masks: list[np.ndarray]) -> np.ndarray:
        """Rows (n,) of dtype `COMPONENT` of the coarse hull of the whole volume."""
        labelled = _label_bodies(self.coarse_hull(masks), self.coarse, self._joined_m)
        return hull_components(labelled, self.coarse)

    def coarse_hull(self, masks: list[np.ndarray]) -> np.ndarray:
        """Voxels of the whole volume, (nx, ny, nz) bool in the grid `coarse`."""
        return carve(self.views.rig, masks, self.coarse, self.rule, self.views.unknown)

    def body(self, components: np.ndarray, near_m: np.ndarray | None) -> int | None:
        """Index of the body's component, or None where none is large enough.

        Args:
            near_m: (3,) where the body was last: near components are preferred. None: the largest;
                of a person, those larger or shorter than persons are count for less.
        """
        weight = components["volume_m3"]
        if not len(weight):
            return None
        if self._person:
            longest_m = np.ptp(components["bounds_m"], axis=1).max(axis=1)
            fitting = np.minimum(CARVING.person_m3 / weight, 1) * np.minimum(
                longest_m / CARVING.person_m, 1
            )
            weight = weight * fitting**2
        if near_m is not None and len(weight) > 1:
            distance = np.linalg.norm(components["center_m"] - near_m, axis=1)
            weight = weight * np.exp(-((distance / CARVING.limb_m) ** 2))
        best = int(weight.argmax())
        return best if components["volume_m3"][best] >= CARVING.smallest_m3 else None

    def window(self, components: np.ndarray, *bodies: int) -> VoxelGrid:
        """Fine grid around one component of the coarse hull, or some."""
        bounds = components["bounds_m"][[*bodies]]
        low, high = bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)
        return VoxelGrid.from_bounds(
            low - 2 * CARVING.coarse_m, high + 2 * CARVING.coarse_m, self.voxel_size_m
        )

    def carve(
        self, masks: list[np.ndarray], grid: VoxelGrid
    ) -> tuple[list[np.ndarray], np.ndarray]:
        """Silhouettes (h, w) bool confirmed by others, and their hull (nx, ny, nz) in a window."""
        masks = self._confirmed_by_others(masks, self._surroundings(grid))
        wide, unknown = widened(self.views, masks, grid), self.views.unknown
        return masks, carve(self.views.rig, wide, grid, self.rule, unknown)

    def _surroundings(self, grid: VoxelGrid) -> VoxelGrid:
        """Where silhouettes are confirmed: the window, or as far as limbs go that only one camera
        may see, and that are no part of the hull therefore.
        """
        if len(self.views.rig) - self.views.partly_unknown >= LEAST_CAMERAS:
            return grid
        low, high = grid.origin_m - CARVING.limb_m, grid.origin_m + grid.size_m + CARVING.limb_m
        return VoxelGrid.from_bounds(low, high, CARVING.coarse_m)

    def select(
        self,
        masks: list[np.ndarray],
        occupancy: np.ndarray,
        grid: VoxelGrid,
        near_m: np.ndarray | None,
    ) -> FrameObservation | None:
        """The body's component of a carved window, or None where it is too small for a body."""
        voxels = _label_bodies(occupancy, grid, self._joined_m)
        body = self.body(hull_components(voxels, grid), near_m)
        if body is None:
            return None
        return FrameObservation(self.views, masks, grid, voxels.labels == body + 1)

    def _confirmed_by_others(self, masks: list[np.ndarray], grid: VoxelGrid) -> list[np.ndarray]:
        """Pixels of each silhouette into which a voxel near the body projects.

        A limb that one camera misses leaves the hull, and all other cameras then show something
        that the hull does not explain. So where at least two cameras are explained, large pieces
        that only some of the others show are false foreground. Small ones stay,
        if most cameras agree: hands and feet are easily lost from a hull.
        """
        strict_rule = self.rule
        if self.views.unknown is not None:  # what no other camera sees, none contradicts
            strict_rule = replace(self.rule, least_agreeing=1)
        wide = widened(self.views, masks, grid)
        strict = self._confirmed(masks, wide, grid, strict_rule)
        if len(masks) < 4:
            return strict
        tolerance = self.rule.tolerance + max(1, len(masks) // 4)
        least = _least(3 * len(masks) // 4 - tolerance + 1, self.views.partly_unknown)
        loose_rule = replace(self.rule, tolerance=tolerance, least_agreeing=least)
        loose = self._confirmed(masks, wide, grid, loose_rule)
        missing = sorted(
            1 - np.count_nonzero(a) / max(np.count_nonzero(b), 1)
            for a, b in zip(strict, loose, strict=True)
        )
        if missing[1] >= CARVING.small:
            return loose
        return [
            sure | _small_components(likely & ~sure, CARVING.small * np.count_nonzero(sure))
            for sure, likely in zip(strict, loose, strict=True)
        ]

    def _confirmed(
        self, masks: list[np.ndarray], wide: list[np.ndarray], grid: VoxelGrid, rule: CarveRule
    ) -> list[np.ndarray]:
        """Pixels of silhouettes into which the hull of widened ones projects."""
        rig = self.views.rig
        hull = _without_crumbs(carve(rig, wide, grid, rule, self.views.unknown))
        return [
            footprint(hull, grid, camera, mask) for camera, mask in zip(rig, masks, strict=True)
        ]


def _label_bodies(occupancy: np.ndarray, grid: VoxelGrid, joined_m: float) -> MaskComponents:
    """Components of a hull, where pieces above one another are one.

    A stripe of the wall's colour in one camera cuts a hull in two at its height, and what is above
    a gap belongs to what is below it. People beside each other remain apart, unless pieces up to
    `joined_m` apart are one.
    """
    reach = round(0.5 * CARVING.gap_m / grid.voxel_size_m)
    columns = occupancy.reshape(-1, occupancy.shape[2]).view(np.uint8)
    line = np.ones((1, 2 * reach + 1), np.uint8)
    joined = np.asarray(cv2.dilate(columns, line)).view(np.bool_).reshape(occupancy.shape)
    if joined_m and occupancy.any():
        apart = np.asarray(distance_transform_edt(~occupancy), float) * grid.voxel_size_m
        joined = joined | (apart <= 0.5 * joined_m)
    labels = np.where(occupancy, label_components(joined).labels, 0)
    return MaskComponents(labels, np.bincount(labels[occupancy], minlength=1))


def _without_crumbs(occupancy: np.ndarray) -> np.ndarray:
    """Components of a hull large enough to be a limb that a gap in one silhouette cut off."""
    components = label_components(occupancy)
    return (components.sizes >= CARVING.small * components.sizes.max(initial=1))[components.labels]


def _small_components(mask: np.ndarray, most_px: float) -> np.ndarray:
    """Connected components of a mask of at most `most_px` pixels."""
    result, window = np.zeros_like(mask), bounding_box(mask)
    components = label_components(mask[window])
    result[window] = mask[window] & (components.sizes <= most_px)[components.labels]
    return result
