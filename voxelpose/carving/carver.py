"""The visual hull of silhouettes, as voxels."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.camera import Rig
from voxelpose.carving.grid import VoxelGrid
from voxelpose.carving.kernels import blocks
from voxelpose.carving.views import Masks, block_order, mask_list, pack_masks, pack_rig


@dataclass(frozen=True)
class CarveRule:
    """When a voxel stays.

    A camera sees a voxel whose centre is in front of it, inside the field of its lens, and whose
    nearest pixel is in its image. A camera that sees it agrees where that pixel is foreground, and
    objects where it is background.

    Attributes: tolerance: Most cameras that may object: k where a voxel stays when at least C - k
        of the C cameras that see it agree. outside: What a camera says of a voxel that it does not
        see (behind it, or outside its image): "keep" says nothing,
            "carve" objects.
        least_agreeing: Fewest cameras that must agree, so that what stands near one camera and out
            of sight of the others is not taken for a body; 0 keeps even what no camera sees. None
            means three quarters of the cameras, less the tolerance.
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
        """Returns the rule for so many cameras as `blocks.carve_blocks` takes it."""
        least = (
            max(1, 3 * cameras // 4 - self.tolerance)
            if self.least_agreeing is None
            else self.least_agreeing
        )
        return self.tolerance, least, blocks.OBJECTS if self.outside == "carve" else blocks.BLIND


def carve(
    rig: Rig, masks: Masks, grid: VoxelGrid, rule: CarveRule | None = None
) -> NDArray[np.bool_]:
    """Carves a volume: voxels whose projections are background are removed.

    Lenses are respected. A point's nearest pixel is floor(x + 0.5), floor(y + 0.5): a tie goes to
    the right and downward. The result is, bit for bit, that of `voxelpose.carving.reference.carve`,
    for every number of threads.

    Whole blocks are decided first: a block's image lies in a box around its middle's pixel (for a
    lens, widened by how much it can stretch there), and a summed-area table tells at once if that
    box is all foreground or all background.

    Args: rig: C cameras. masks: Silhouettes, (h, w) bool each: by camera name, or in the order of
        the rig. grid: The volume. rule: When a voxel stays; by default when every camera that sees
        it agrees, and three quarters do.

    Returns:
        (nx, ny, nz) bool, True where the voxel stays.

    Raises:
        ValueError: A mask is missing, or differs in size from its camera's image.
        TypeError: A mask is not bool.

    Source: the shape from silhouette that Iiyama, Kameda and Minoh assume as input; the blocks are
    ours.
    """
    rule = rule or CarveRule()
    frames, sums, pixels = pack_masks(mask_list(rig, masks))
    rows, kinds, bounds = pack_rig(rig)
    occupancy = np.zeros(grid.shape, dtype=np.bool_)
    axes = grid.axes(blocks.LARGEST)
    order = block_order(math.prod(len(axis) // blocks.LARGEST for axis in axes))
    blocks.carve_blocks(
        rows, kinds, bounds, frames, sums, pixels, rule.packed(len(rig)), axes, order, occupancy
    )
    return occupancy
