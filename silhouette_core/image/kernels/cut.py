"""A frame cut into person and background, nearly of least cost.

Source: belief propagation with two labels (Felzenszwalb and Huttenlocher, 2006), whose messages are
single numbers; contrast as in GrabCut (Rother et al., 2004), weakened at the background's own edges
as in Background Cut (Sun et al., 2006). Called by `silhouette_core.image.cut`. Reference:
`tests.oracles.image`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def contrast(frame, mean, known, out):
    """Fills out (2, H, W) float32: difference of each pixel's colour from that of its right and of
    its lower neighbour, summed over the channels, less that of the background where it is known.

    Frame (H, W, 3) uint8, mean (H, W, 3) float32, known (H, W) bool.
    """
    height, width = known.shape
    for row in range(height):
        for column in range(width):
            for side in range(2):
                y, x = row + side, column + 1 - side
                difference = np.float32(0.0)
                if y < height and x < width:
                    both_known = known[row, column] and known[y, x]
                    for channel in range(3):
                        difference += abs(
                            np.float32(frame[row, column, channel])
                            - np.float32(frame[y, x, channel])
                        )
                        if both_known:
                            difference -= abs(mean[row, column, channel] - mean[y, x, channel])
                out[side, row, column] = max(difference, np.float32(0.0))


@kernel
def pass_on(odds, links, messages):
    """Updates told (2, H, W) float32: odds that a pixel is told from above and from below.

    Each passes on its own odds (H, W) float32, nats, and what it was told from the same side, as
    far as links (H, W) float32 allow, the cost of a pixel and its lower neighbour that differ.
    """
    height, width = odds.shape
    for row in range(height - 1):
        for column in range(width):
            said, most = odds[row, column] + messages[0, row, column], links[row, column]
            messages[0, row + 1, column] = min(max(said, -most), most)
    for row in range(height - 1, 0, -1):
        for column in range(width):
            said, most = odds[row, column] + messages[1, row, column], links[row - 1, column]
            messages[1, row - 1, column] = min(max(said, -most), most)
