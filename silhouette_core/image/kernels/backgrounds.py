"""Backgrounds, pixel by pixel: their subtraction and median, colours of a pixel over time and which
of them is the background's.

Source: the subtraction is Okada and Stenger's, section 5.1, the rest ours; messages are those of
belief propagation (Felzenszwalb and Huttenlocher, 2006). Called by `background` and `empty_scene`
of `silhouette_core.image`. Reference: `tests.oracles.image`.
"""

import numpy as np

from silhouette_core.jit import kernel


@kernel
def colour_modes(samples, radius, mean, share, members_of):
    """Fills the modes of each pixel's colour over time: the sample with most others closer than the
    radius and the mean of these, again of what they leave, and so on.

    Samples (T, n, 3) float32, T at most 64; mean (n, K, 3) float32; share (n, K) float32 of the
    samples, 0 for modes that a pixel does not have; shown (n, K) uint64, bit t for sample t.
    Distances are summed over the channels.
    """
    count, pixels, modes = samples.shape[0], samples.shape[1], mean.shape[1]
    near = np.empty((count, count), np.bool_)
    colour = np.empty((3, count), np.float32)  # of one pixel, so that loops over time are fast
    for pixel in range(pixels):
        left = np.ones(count, np.bool_)
        for b in range(count):
            for channel in range(3):
                colour[channel, b] = samples[b, pixel, channel]
        for a in range(count):
            for b in range(count):
                distance = abs(colour[0, a] - colour[0, b])
                distance += abs(colour[1, a] - colour[1, b])
                near[a, b] = distance + abs(colour[2, a] - colour[2, b]) < radius
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
            members_of[pixel, mode] = members


@kernel
def step_costs(mean, share, radius, still, border, right, down):
    """Fills the costs of labels of neighbours: numbers of their modes, or K where the background
    was never seen.

    Mean (h, w, K, 3) and share (h, w, K) float32 as of `colour_modes`; right and down (h, w, K + 1,
    K + 1) float32, by the labels of a pixel and of its neighbour. A step between two colours costs
    half of what it is larger than the radius, in radii, and up to 1, if it moves: if one of the two
    pixels shows, at other times, what the other one is labelled with. The edge of something in
    motion does. Of others it costs the fraction `still`. Seen beside never seen costs `border`.
    """
    height, width, modes = share.shape
    for row in range(height):
        for column in range(width):
            for side in range(2):
                y, x = row + side, column + 1 - side
                if y >= height or x >= width:
                    continue
                costs = right[row, column] if side == 0 else down[row, column]
                costs[:, modes] = border
                costs[modes, :] = border
                costs[modes, modes] = 0
                for a in range(modes):
                    for b in range(modes):
                        costs[a, b] = 0
                        if share[row, column, a] == 0 or share[y, x, b] == 0:
                            continue
                        apart = _apart(mean[row, column, a], mean[y, x, b])
                        if apart <= radius:
                            continue
                        beyond = apart / radius - np.float32(1.0)
                        cost = min(beyond * np.float32(0.5), np.float32(1.0))
                        first, second = mean[row, column], mean[y, x]
                        moving = _shows(first, share[row, column], a, second[b], radius)
                        moving = moving or _shows(second, share[y, x], b, first[a], radius)
                        costs[a, b] = cost if moving else still * cost


@kernel
def _apart(first, second):
    """Difference of two colours, summed over the channels."""
    return abs(first[0] - second[0]) + abs(first[1] - second[1]) + abs(first[2] - second[2])


@kernel
def _shows(mean, share, label, colour, radius):
    """Whether one of a pixel's modes (K, 3) but that of its label has a colour."""
    for mode in range(len(share)):
        if mode != label and share[mode] > 0 and _apart(mean[mode], colour) < radius:
            return True
    return False


@kernel
def least_cost_labels(unary, right, down, rounds, labels):
    """Fills labels (h, w) int64, of least cost together, nearly: belief propagation in sweeps.

    Own costs (h, w, L) float32; right and down (h, w, L, L) as of `step_costs`.
    """
    height, width, count = unary.shape
    # Messages from the left, the right, above and below.
    messages = np.zeros((4, height, width, count), np.float32)
    for _ in range(rounds):
        for row in range(height):
            for column in range(width - 1):
                _send(unary, messages, right[row, column], 0, row, column, row, column + 1)
            for column in range(width - 1, 0, -1):
                _send(unary, messages, right[row, column - 1].T, 1, row, column, row, column - 1)
        for row in range(height - 1):
            for column in range(width):
                _send(unary, messages, down[row, column], 2, row, column, row + 1, column)
        for row in range(height - 1, 0, -1):
            for column in range(width):
                _send(unary, messages, down[row - 1, column].T, 3, row, column, row - 1, column)
    for row in range(height):
        for column in range(width):
            least = np.float32(np.inf)
            for label in range(count):
                cost = unary[row, column, label]
                for source in range(4):
                    cost += messages[source, row, column, label]
                if cost < least:
                    least = cost
                    labels[row, column] = label


@kernel
def _send(unary, messages, costs, source, row, column, y, x):
    """Sets the message from (row, column) to (y, x), which arrives there from a source."""
    count = unary.shape[2]
    back = source ^ 1
    least = np.float32(np.inf)
    for label in range(count):
        lowest = np.float32(np.inf)
        for source_label in range(count):
            cost = unary[row, column, source_label] + costs[source_label, label]
            for other in range(4):
                if other != back:
                    cost += messages[other, row, column, source_label]
            lowest = min(lowest, cost)
        messages[source, y, x, label] = lowest
        least = min(least, lowest)
    for label in range(count):
        messages[source, y, x, label] -= least


@kernel
def paper_mask(
    frame, mean, unit_mean, half_precision, log_peak, log_threshold, raw_threshold, mask
):
    """Fills mask (H, W) bool: improbable normalised colour, or a clearly different colour."""
    height, width = mask.shape
    limit = raw_threshold * raw_threshold
    for row in range(height):
        for column in range(width):
            squares = np.float32(0.0)
            difference = np.float32(0.0)
            for channel in range(3):
                value = np.float32(frame[row, column, channel])
                squares += value * value
                step = value - mean[row, column, channel]
                difference += step * step
            scale = np.float32(1.0) / max(np.sqrt(squares), np.float32(1.0))
            log_likelihood = log_peak[row, column]
            for channel in range(3):
                step = (
                    np.float32(frame[row, column, channel]) * scale
                    - unit_mean[row, column, channel]
                )
                log_likelihood -= step * step * half_precision[row, column, channel]
            mask[row, column] = log_likelihood < log_threshold or difference > limit


@kernel
def median(stack, out):
    """Fills out (H, W, 3) float32: the lower median over time of frames (T, H, W, 3) uint8."""
    count, height, width = stack.shape[0], stack.shape[1], stack.shape[2]
    half = (count + 1) // 2
    for row in range(height):
        histogram = np.zeros(256, np.int32)
        for column in range(width):
            for channel in range(3):
                histogram[:] = 0
                for k in range(count):
                    histogram[stack[k, row, column, channel]] += 1
                middle = 0
                seen = histogram[0]
                while seen < half:
                    middle += 1
                    seen += histogram[middle]
                out[row, column, channel] = middle
