"""What a frame's raw silhouettes show of one body: its hull, and the silhouettes without what does
not belong to it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy import ndimage

from silhouette_core.refinement.observation import Observation, PinholeViews
from voxelpose.carving.carver import CarveRule, carve
from voxelpose.carving.grid import VoxelGrid

_COARSE_M = 0.05
_MARGIN_M = 0.10
_EXPLAINED = (
    0.04  # a camera is explained by the hull where less than this share of its silhouette is not
)
_SMALL = 0.02  # of a silhouette; a hand or a foot is smaller
_CRUMB = 0.03  # of the largest piece
_SMALLEST_M3 = 0.004  # a hull smaller than this is noise, not a body


@dataclass(frozen=True, eq=False)
class FrameObservation:
    """One frame ready for fitting: the silhouettes of one body, and its hull.

    Attributes:
        observation: silhouettes, cleared of what does not belong to the hull.
        grid: a window of voxels around the body.
        occupancy: (nx, ny, nz) bool, the hull's largest piece in it.
    """

    observation: Observation
    grid: VoxelGrid
    occupancy: np.ndarray


def body_rule(cameras: int, tolerance: int) -> CarveRule:
    """Returns when a voxel may be a body's: one that too few cameras see is no evidence, or what
    only a wall hides would pass for one.
    """
    return CarveRule(tolerance, least_agreeing=max(2, 3 * cameras // 4) - tolerance)


class HullObserver:
    """Turns a frame's raw silhouettes into one body's hull and silhouettes.

    Args:
        views: the cameras.
        volume: where the body may be.
        voxel_size_m: of the fine window.
        rule: how many cameras may object to a voxel.
    """

    def __init__(
        self,
        views: PinholeViews,
        volume: VoxelGrid,
        voxel_size_m: float,
        rule: CarveRule | None = None,
    ):
        """Keeps the settings."""
        self.views = views
        self.voxel_size_m = voxel_size_m
        self.rule = rule or CarveRule()
        low = volume.origin_m
        self._coarse = VoxelGrid.from_bounds(low, low + volume.size_m, max(_COARSE_M, voxel_size_m))

    def look(
        self, masks: list[np.ndarray], near_m: np.ndarray | None = None
    ) -> FrameObservation | None:
        """Finds the body in one frame.

        Args: masks: a silhouette (h, w) bool per camera. near_m: (3,) where the body was last; of
            several hulls the one there is taken. None: the largest.

        Returns:
            What is seen of it, or None where no hull of a body's size is left.
        """
        coarse = carve(self.views.rig, masks, self._coarse, self.rule)
        piece = _piece(coarse, self._coarse, near_m)
        if piece is None:
            return None
        inside = np.argwhere(piece)
        low = self._coarse.origin_m + inside.min(0) * self._coarse.voxel_size_m - _MARGIN_M
        high = self._coarse.origin_m + (inside.max(0) + 1) * self._coarse.voxel_size_m + _MARGIN_M
        grid = VoxelGrid.from_bounds(low, high, self.voxel_size_m)
        masks = self._belonging(masks, grid)
        occupancy = carve(self.views.rig, self._widened(masks, grid), grid, self.rule)
        fine = _piece(occupancy, grid, near_m)
        if fine is None:
            return None
        middle = grid.occupied_points(fine).mean(0)
        distance = float(np.median(np.linalg.norm(self.views.center_m - middle, axis=1)))
        return FrameObservation(Observation.of(self.views, masks, distance), grid, fine)

    def _widened(self, masks: list[np.ndarray], grid: VoxelGrid) -> list[np.ndarray]:
        """Widens silhouettes by half a voxel: a voxel then stays where it touches the body, so that
        thin limbs are not lost between.
        """
        middle = grid.origin_m + 0.5 * grid.size_m
        wide = []
        for c, mask in enumerate(masks):
            depth = float(self.views.rotation[c, 2] @ middle + self.views.translation_m[c, 2])
            reach = max(
                round(0.5 * grid.voxel_size_m * self.views.intrinsics[c, 0] / max(depth, 0.1)), 0
            )
            wide.append(
                cv2.dilate(mask.astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)).astype(
                    bool
                )
            )
        return wide

    def _belonging(self, masks: list[np.ndarray], grid: VoxelGrid) -> list[np.ndarray]:
        """Keeps of each silhouette what the other cameras confirm: pixels into which a voxel near
        the body projects.

        A limb that one camera misses leaves the hull, and all other cameras then show something
        that the hull does not explain. So where at least two cameras are explained, large pieces
        that only some of the others show are false foreground. Small ones stay,
        if most cameras agree: hands and feet are soon lost to a hull.
        """
        if len(masks) < 4:
            return self._confirmed(masks, grid, self.rule)
        tolerance = self.rule.tolerance + max(1, len(masks) // 4)
        loose = self._confirmed(
            masks,
            grid,
            replace(
                self.rule, tolerance=tolerance, least_agreeing=3 * len(masks) // 4 - tolerance + 1
            ),
        )
        strict = self._confirmed(masks, grid, self.rule)
        missing = sorted(
            1 - np.count_nonzero(a) / max(np.count_nonzero(b), 1)
            for a, b in zip(strict, loose, strict=True)
        )
        if missing[1] >= _EXPLAINED:
            return loose
        return [
            sure | _small_pieces(likely & ~sure, _SMALL * np.count_nonzero(sure))
            for sure, likely in zip(strict, loose, strict=True)
        ]

    def _confirmed(
        self, masks: list[np.ndarray], grid: VoxelGrid, rule: CarveRule
    ) -> list[np.ndarray]:
        points = grid.occupied_points(
            _large_pieces(carve(self.views.rig, self._widened(masks, grid), grid, rule))
        )
        kept = []
        for c, mask in enumerate(masks):
            pixels, depth = self.views.rig.cameras[c].project(points)
            size_px = (
                self.views.intrinsics[c, 0]
                * grid.voxel_size_m
                / max(float(np.nanmin(depth, initial=np.inf)), 0.1)
            )
            pixels = np.rint(pixels[np.isfinite(pixels).all(1)]).astype(int)
            height, width = mask.shape
            pixels = pixels[((pixels >= 0) & (pixels < (width, height))).all(1)]
            footprint = np.zeros(mask.shape, np.uint8)
            footprint[pixels[:, 1], pixels[:, 0]] = 1
            # A voxel's diagonal, so that neighbours close up, and a voxel more for what its centre
            # misses at the edge.
            reach = int(np.ceil(2 * size_px)) | 1
            kept.append(
                mask & cv2.dilate(footprint, np.ones((reach, reach), np.uint8)).astype(bool)
            )
        return kept


def _piece(occupancy: np.ndarray, grid: VoxelGrid, near_m: np.ndarray | None) -> np.ndarray | None:
    """Returns the connected piece of a hull that is the body's, or None."""
    labels, count = ndimage.label(occupancy, np.ones((3, 3, 3)))  # type: ignore[misc]
    if not count:
        return None
    sizes = np.bincount(labels.ravel())[1:] * grid.voxel_size_m**3
    worth = sizes.copy()
    if near_m is not None and count > 1:
        centres = np.array(ndimage.center_of_mass(occupancy, labels, np.arange(1, count + 1)))
        places = grid.origin_m + (centres + 0.5) * grid.voxel_size_m
        worth *= np.exp(-((np.linalg.norm(places - near_m, axis=1) / 1.0) ** 2))
    best = int(worth.argmax())
    return labels == best + 1 if sizes[best] >= _SMALLEST_M3 else None


def _large_pieces(occupancy: np.ndarray) -> np.ndarray:
    """Returns the connected pieces of a hull that are no crumbs: a gap in one silhouette may cut a
    limb off, noise is smaller.
    """
    labels, _ = ndimage.label(occupancy, np.ones((3, 3, 3)))  # type: ignore[misc]
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    return (sizes >= _CRUMB * sizes.max(initial=1))[labels]


def _small_pieces(mask: np.ndarray, most_px: float) -> np.ndarray:
    """Returns the connected pieces of a mask of at most `most_px` pixels."""
    _, labels, stats, _ = map(np.asarray, cv2.connectedComponentsWithStats(mask.astype(np.uint8)))
    kept = stats[:, cv2.CC_STAT_AREA] <= most_px
    kept[0] = False
    return kept[labels]
