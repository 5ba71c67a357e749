"""From images to the patches that the filters of a convolution read, and back.

Source: Chellapilla, Puri and Simard, High performance convolutional neural networks for document
processing (2006). Reference: `tests.oracles.proposal`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def gather_patches(images, top, left, stride, patches):
    """Fills patches (N, rows, columns, size, size, C) of images (N, h, w, C), both without gaps.

    The first patch begins `top` rows above an image and `left` columns before it, the next ones
    `stride` cells farther on; outside the images everything is 0.
    """
    count, height, width, channels = images.shape
    rows, columns, size = patches.shape[1], patches.shape[2], patches.shape[3]
    # Cells of a row of a patch follow upon one another in the image as well.
    run, end = size * channels, width * channels
    given, filled = images.reshape(-1), patches.reshape(-1)
    target = np.uint64(0)  # unsigned numbers are not asked whether they count from the end
    for n in range(count):
        for row in range(rows):
            for column in range(columns):
                start = (column * stride - left) * channels
                first, last = max(-start, 0), min(run, end - start)
                for i in range(size):
                    y = row * stride - top + i
                    if not 0 <= y < height:
                        for k in range(np.uint64(run)):
                            filled[target + k] = 0
                    elif last - first == run:
                        source = np.uint64((n * height + y) * end + start)
                        for k in range(np.uint64(run)):
                            filled[target + k] = given[source + k]
                    else:
                        source = (n * height + y) * end + start
                        for k in range(run):
                            value = given[source + k] if first <= k < last else 0
                            filled[target + np.uint64(k)] = value
                    target += np.uint64(run)


@kernel
def scatter_patches(patches, top, left, stride, images):
    """Adds patches (N, rows, columns, size, size, C) to images (N, h, w, C), the places from which
    `gather_patches` takes them; what lies outside is left out.
    """
    count, height, width, channels = images.shape
    rows, columns, size = patches.shape[1], patches.shape[2], patches.shape[3]
    run, end = size * channels, width * channels
    given, filled = patches.reshape(-1), images.reshape(-1)
    source = np.uint64(0)
    for n in range(count):
        for row in range(rows):
            for column in range(columns):
                start = (column * stride - left) * channels
                first, last = max(-start, 0), min(run, end - start)
                for i in range(size):
                    y = row * stride - top + i
                    if 0 <= y < height:
                        target = np.uint64((n * height + y) * end + start + first)
                        begin = source + np.uint64(first)
                        for k in range(np.uint64(last - first)):
                            filled[target + k] += given[begin + k]
                    source += np.uint64(run)
