"""Visual hull of silhouettes, as voxels."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.kernels import blocks
from voxelpose.multiview.carving.views import Masks, block_order, mask_list, pack_masks, pack_rig


@dataclass(frozen=True)
class CarveRule:
    """Condition under which a voxel is occupied; see `carve`.

    A camera sees a voxel whose centre is in front of it, inside the field of its lens, and whose
    nearest pixel is in its image. A camera that sees it agrees where that pixel is foreground, and
    objects where it is background.

    Attributes:
        tolerance: Most cameras that may object.
        outside: Effect of a camera that does not see the voxel (behind it, or outside its image):
            "keep" has none, "carve" counts as objecting.
        least_agreeing: Fewest cameras that must agree, so that an object near one camera and
            invisible to the others is not mistaken for a body; 0 keeps even voxels that no camera
            sees. None means three quarters of the cameras, less the tolerance.
    """

    tolerance: int = 0
    outside: Literal["keep", "carve"] = "keep"
    least_agreeing: int | None = None

    def __post_init__(self) -> None:
        """Checks every value once."""
        if self.tolerance < 0:
            raise ValueError(f"tolerance must be at least 0 cameras, got {self.tolerance}")
        if self.outside not in ("keep", "carve"):
            raise ValueError(f'outside must be "keep" or "carve", got {self.outside!r}')
        if self.least_agreeing is not None and self.least_agreeing < 0:
            raise ValueError(
                f"least_agreeing must be at least 0 cameras, got {self.least_agreeing}"
            )

    def packed(self, cameras: int) -> tuple[int, int, int]:
        """Rule for a number of cameras, as `blocks.carve_blocks` takes it."""
        least = (
            max(1, 3 * cameras // 4 - self.tolerance)
            if self.least_agreeing is None
            else self.least_agreeing
        )
        return self.tolerance, least, blocks.OBJECTS if self.outside == "carve" else blocks.BLIND


def carve(
    rig: Rig,
    masks: Masks,
    grid: VoxelGrid,
    rule: CarveRule | None = None,
    unknown: Sequence[NDArray[np.bool_]] | None = None,
) -> NDArray[np.bool_]:
    r"""Visual hull: the voxels whose projections are foreground.

    A voxel with centre v is occupied where

    .. math::

        \sum_{c=1}^{C} s_c(v)\, (1 - P_c(\pi_c(v))) \le k
        \quad \text{and} \quad \sum_{c=1}^{C} s_c(v)\, P_c(\pi_c(v)) \ge a

    with :math:`s_c(v)` = 1 if camera c sees v and 0 otherwise, :math:`P_c` its silhouette (1 in the
    foreground), :math:`\pi_c` the projection to the nearest pixel, lens distortion included, k the
    tolerance and a the least number of agreeing cameras of the rule. A point's nearest pixel is
    floor(x + 0.5), floor(y + 0.5): a tie goes to the right and downward. The result is, bit for
    bit, that of `tests.oracles.carving.carve_voxels`, for every number of threads.

    Whole blocks are decided first: a block's image lies in a box around the pixel of its centre
    (widened by a bound on the lens's stretching), and a summed-area table shows whether that box is
    all foreground or all background.

    Args:
        rig: C cameras.
        masks: Silhouettes, (h, w) bool each: by camera name, or in the order of the rig.
        rule: Condition for a voxel; by default every camera that sees it agrees, and three quarters
            of all cameras do.
        unknown: Pixels about which nothing is known, (h, w) bool each, in the order of the rig: a
            camera neither agrees nor objects to what projects there, whatever the rule; None:
            there are none.

    Returns:
        (nx, ny, nz) bool, True where the voxel is occupied.

    Raises:
        ValueError: A mask is missing, or differs in size from its camera's image.
        TypeError: A mask is not bool.

    Source: shape from silhouette, which Iiyama, Kameda and Minoh assume as input, as in Laurentini,
    "The visual hull concept for silhouette-based image understanding" (1994); tolerance and blocks
    are ours.
    """
    rule = rule or CarveRule()
    frames, sums, pixels = pack_masks(mask_list(rig, masks), unknown)
    rows, kinds, bounds = pack_rig(rig)
    occupancy = np.zeros(grid.shape, dtype=np.bool_)
    axes = grid.axes(blocks.LARGEST)
    order = block_order(math.prod(len(axis) // blocks.LARGEST for axis in axes))
    blocks.carve_blocks(
        rows, kinds, bounds, frames, sums, pixels, rule.packed(len(rig)), axes, order, occupancy
    )
    return occupancy
