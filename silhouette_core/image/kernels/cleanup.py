"""Components of a silhouette. Plain arrays only; the door is `silhouette_core.image.cleanup`."""

from silhouette_core.jit import kernel, parallel_kernel, prange


@kernel
def count_labels(labels, area):
    """Adds to area (n,) int64 the pixels of every label but 0 in labels (H, W) int32."""
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            label = labels[row, column]
            if label != 0:
                area[label] += 1


@parallel_kernel
def select_labels(labels, keep, mask):
    """mask (H, W) bool: keep (n,) bool of each pixel's label."""
    for row in prange(labels.shape[0]):
        for column in range(labels.shape[1]):
            mask[row, column] = keep[labels[row, column]]
