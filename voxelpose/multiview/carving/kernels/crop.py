"""Box of a mask's foreground, of which only a crop is carved.

Source: own; `cv2.boundingRect` gives the same at three times the cost. Reference:
`tests.oracles.carving.foreground_box`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def _any(line):
    """Whether anything in a row of uint8 is not zero: faster without stopping early."""
    total = np.uint8(0)
    for x in range(len(line)):
        total |= line[x]
    return total != 0


@kernel
def foreground_box(mask):
    """Left, top, width, height of the box of non-zero pixels of (h, w) uint8, or zeros."""
    height, width = mask.shape
    top, bottom = 0, height
    while top < height and not _any(mask[top]):
        top += 1
    if top == height:
        return 0, 0, 0, 0
    while not _any(mask[bottom - 1]):
        bottom -= 1
    columns = np.zeros(width, np.uint8)
    for y in range(top, bottom):
        for x in range(width):
            columns[x] |= mask[y, x]
    left, right = 0, width
    while not columns[left]:
        left += 1
    while not columns[right - 1]:
        right -= 1
    return left, top, right - left, bottom - top
