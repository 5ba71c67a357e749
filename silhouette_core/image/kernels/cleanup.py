"""Areas of the components of a silhouette.

Source: own. Called by `silhouette_core.image.cleanup`. Reference:
`silhouette_core.image.kernels.reference`.
"""

from silhouette_core.jit import parallel_kernel, prange


@parallel_kernel
def select_labels(labels, keep, mask):
    """mask (H, W) bool: keep (n,) bool of each pixel's label."""
    for row in prange(labels.shape[0]):
        for column in range(labels.shape[1]):
            mask[row, column] = keep[labels[row, column]]
