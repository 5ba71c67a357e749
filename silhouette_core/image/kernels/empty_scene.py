"""Colours of a pixel over time, and which of them continues the background around it.

Source: ours; the paths are Dijkstra's. Called by `silhouette_core.image.empty_scene`. Reference:
`tests.oracles.image`.
"""

import heapq

import numpy as np

from silhouette_core.jit import kernel, parallel_kernel, prange


@parallel_kernel
def colour_modes(samples, radius, mean, share, shown):
    """Fills the modes of each pixel's colour over time: the sample with most others closer than the
    radius and the mean of these, again of what they leave, and so on.

    Samples (T, n, 3) float32, T at most 64; mean (n, K, 3) float32; share (n, K) float32 of the
    samples, 0 for modes that a pixel does not have; shown (n, K) uint64, bit t for sample t.
    Distances are summed over the channels.
    """
    count, pixels, modes = samples.shape[0], samples.shape[1], mean.shape[1]
    for pixel in prange(pixels):
        near = np.zeros((count, count), np.bool_)
        left = np.ones(count, np.bool_)
        for a in range(count):
            for b in range(count):
                distance = np.float32(0.0)
                for channel in range(3):
                    distance += abs(samples[a, pixel, channel] - samples[b, pixel, channel])
                near[a, b] = distance < radius
        for mode in range(modes):
            most, middle = 0, 0
            for a in range(count):
                if left[a]:
                    others = 0
                    for b in range(count):
                        others += left[b] and near[a, b]
                    if others > most:
                        most, middle = others, a
            share[pixel, mode] = np.float32(most) / np.float32(count)
            mean[pixel, mode] = 0
            members = np.uint64(0)
            for b in range(count):
                if most > 0 and left[b] and near[middle, b]:
                    left[b] = False
                    members |= np.uint64(1) << np.uint64(b)
                    for channel in range(3):
                        mean[pixel, mode, channel] += samples[b, pixel, channel] / np.float32(most)
            shown[pixel, mode] = members


@kernel
def grow_background(colour, unknown, index, mean, share, shown, every, limits, step):
    """Gives each unknown pixel the mode that continues the known colours around it best, and fills
    the largest step between neighbours on the way there.

    Paths of least cost from the known pixels (Dijkstra). A step costs the square of the difference
    beyond the tolerance, times the fraction of the samples that show only one of the two modes, of
    those that show either: background is seen beside background, at edges of furniture too. That
    fraction counts as `apart_least` at least. And a step costs `rarity` times the share of the
    samples that do not show the mode.

    Colour (H, W, 3) float32, filled where unknown (H, W) bool; index (H, W) int32 of unknown pixels
    in mean (n, K, 3), share (n, K) and shown (n, K) uint64, of which bit t says whether sample t
    shows the mode; every: bits of all samples; limits: tolerance, apart_least and rarity; step
    (H, W) float32, of the differences times the root of that fraction. Pixels that cannot be
    reached keep their colour and step.
    """
    height, width = unknown.shape
    done = ~unknown
    heap = [(0.0, 0, 0, 0.0) for _ in range(0)]
    modes = mean, share, shown, index
    for pixel in range(height * width):
        if not unknown[pixel // width, pixel % width]:
            _offer(heap, colour, done, modes, limits, pixel, every, 0.0, 0.0)
    while len(heap) > 0:
        cost, pixel, mode, largest = heapq.heappop(heap)
        row, column = pixel // width, pixel % width
        if done[row, column]:
            continue
        done[row, column] = True
        colour[row, column] = mean[index[row, column], mode]
        step[row, column] = largest
        frames = shown[index[row, column], mode]
        _offer(heap, colour, done, modes, limits, pixel, frames, cost, largest)


@kernel
def _offer(heap, colour, done, modes, limits, pixel, frames, cost, largest):
    """Offers a pixel's neighbours the path through it."""
    mean, share, shown, index = modes
    tolerance, apart_least, rarity = limits
    height, width = done.shape
    row, column = pixel // width, pixel % width
    for side in range(4):
        y = row + (side == 0) - (side == 1)
        x = column + (side == 2) - (side == 3)
        if y < 0 or x < 0 or y >= height or x >= width or done[y, x]:
            continue
        other = index[y, x]
        for mode in range(mean.shape[1]):
            if share[other, mode] > 0:
                difference = 0.0
                for channel in range(3):
                    difference += abs(colour[row, column, channel] - mean[other, mode, channel])
                both = _bits(frames & shown[other, mode])
                apart = 1.0 - both / _bits(frames | shown[other, mode])
                beyond = max(difference - tolerance, 0.0)
                weighted = beyond * np.sqrt(max(apart, apart_least))
                price = cost + weighted * weighted + rarity * (1 - share[other, mode])
                heapq.heappush(heap, (price, y * width + x, mode, max(largest, weighted)))


@kernel
def _bits(value):
    """Number of bits that are set."""
    count = 0
    while value != np.uint64(0):
        value &= value - np.uint64(1)
        count += 1
    return count
