"""The kernels of this folder in NumPy, as close to their equations as can be: what tests compare
with. Each takes the arguments of the kernel of its name and fills the same arrays.
"""

import numpy as np

from silhouette_core.tuning import COLOURS, CUT


def paper_mask(
    frame, mean, unit_mean, half_precision, log_peak, log_threshold, raw_threshold, mask
):
    """Okada and Stenger, section 5.1: Gaussian of the normalised colour, or clear difference."""
    colour = frame.astype(np.float64)
    log_likelihood = log_peak - ((_unit(colour) - unit_mean) ** 2 * half_precision).sum(axis=2)
    mask[:] = (log_likelihood < log_threshold) | (
        np.linalg.norm(colour - mean, axis=2) > raw_threshold
    )


def median(stack, out):
    """Lower median over time."""
    out[:] = np.sort(stack, axis=0)[(len(stack) + 1) // 2 - 1]


def colour_modes(samples, radius, mean, share, shown):
    """Greedy grouping: the sample with most neighbours and these, then of what is left."""
    mean[:], share[:], shown[:] = 0, 0, 0
    near = np.abs(samples[:, None] - samples[None]).sum(axis=3) < radius  # (T, T, n)
    for pixel in range(samples.shape[1]):
        left = np.ones(len(samples), bool)
        for mode in range(mean.shape[1]):
            counts = (near[:, :, pixel] & left).sum(axis=1) * left
            if not counts.any():
                break
            members = near[counts.argmax(), :, pixel] & left
            mean[pixel, mode] = samples[members, pixel].mean(axis=0)
            share[pixel, mode] = members.mean()
            shown[pixel, mode] = sum(1 << int(t) for t in np.flatnonzero(members))
            left &= ~members


def step_costs(mean, share, radius, still, border, right, down):
    """Steps between the colours of modes, dear where one pixel shows the other's at other times."""
    modes = share.shape[2]

    def shows(pixel, label, colour):
        return any(
            k != label and np.abs(mean[pixel][k] - colour).sum() < radius
            for k in np.flatnonzero(share[pixel])
        )

    for first in np.ndindex(share.shape[:2]):
        for costs, step in ((right, (0, 1)), (down, (1, 0))):
            second = first[0] + step[0], first[1] + step[1]
            if second[0] >= share.shape[0] or second[1] >= share.shape[1]:
                continue
            table = np.zeros((modes + 1, modes + 1))
            table[modes, :modes] = table[:modes, modes] = border
            for a in np.flatnonzero(share[first]):
                for b in np.flatnonzero(share[second]):
                    colours = mean[first][a], mean[second][b]
                    apart = np.abs(colours[0] - colours[1]).sum()
                    moves = shows(first, a, colours[1]) or shows(second, b, colours[0])
                    step = np.clip((apart / radius - 1) / 2, 0, 1)
                    table[a, b] = step * (1 if moves else still)
            costs[first] = table


def least_cost_labels(own, right, down, rounds, labels):
    """Min-sum belief propagation with a dictionary of messages, in the same order."""
    height, width, count = own.shape
    messages = {}

    def incoming(pixel, but=None):
        return own[pixel] + sum(
            (message for (_, to), message in messages.items() if to == pixel and _ != but),
            np.zeros(count),
        )

    def send(source, target, costs):
        message = (incoming(source, but=target)[:, None] + costs).min(axis=0)
        messages[source, target] = message - message.min()

    for _ in range(rounds):
        for y in range(height):
            for x in range(width - 1):
                send((y, x), (y, x + 1), right[y, x])
            for x in range(width - 1, 0, -1):
                send((y, x), (y, x - 1), right[y, x - 1].T)
        for y in range(height - 1):
            for x in range(width):
                send((y, x), (y + 1, x), down[y, x])
        for y in range(height - 1, 0, -1):
            for x in range(width):
                send((y, x), (y - 1, x), down[y - 1, x].T)
    for pixel in np.ndindex(height, width):
        labels[pixel] = incoming(pixel).argmin()


def contrast(frame, mean, known, out):
    """Differences of neighbours beyond those of the background."""
    out[:] = 0
    for side, axis in ((0, 1), (1, 0)):
        own = np.abs(np.diff(frame.astype(float), axis=axis)).sum(axis=2)
        behind = np.abs(np.diff(mean, axis=axis)).sum(axis=2)
        both = known[:, 1:] & known[:, :-1] if axis else known[1:] & known[:-1]
        shape = own.shape
        out[side, : shape[0], : shape[1]] = np.maximum(own - np.where(both, behind, 0), 0)


def pass_on(odds, links, told):
    """Messages of belief propagation with two labels, row by row."""
    for row in range(1, len(odds)):
        most = links[row - 1]
        told[0, row] = np.clip(odds[row - 1] + told[0, row - 1], -most, most)
    for row in range(len(odds) - 1, 0, -1):
        most = links[row - 1]
        told[1, row - 1] = np.clip(odds[row] + told[1, row], -most, most)


def sampled_chroma(frame, mean, scales, clip, radius, step, out):
    """Length of the mean chromatic residual of a window, each pixel's cut to length clip."""
    residual, _ = _split(frame, mean, scales)
    length = np.linalg.norm(residual, axis=0)
    residual = residual * np.minimum(1, clip / np.maximum(length, 1e-9))
    for k, j in np.ndindex(out.shape):
        rows = slice(max(k * step - radius, 0), k * step + radius + 1)
        columns = slice(max(j * step - radius, 0), j * step + radius + 1)
        out[k, j] = np.linalg.norm(residual[:, rows, columns].mean(axis=(1, 2)))


def residuals(frame, mean, scales, unit, clip, parts):
    """Chromatic residual cut to length clip."""
    residual, _ = _split(frame, mean, scales)
    length = np.linalg.norm(residual, axis=0)
    parts[:] = unit * residual * np.minimum(1, clip / np.maximum(length, 1e-9))


def brightness(frame, mean, scales, out):
    """Signed difference along the background's colour, in noise."""
    out[:] = (_split(frame, mean, scales)[1] - 1) * scales[2]


def log_odds(
    frame, mean, scales, noise, flicker, shades, uneven, spread_across, densities, shift, known, out
):
    """Person's density over that of the background: lit, shaded, or any of its colours."""
    colour, mean = (image.transpose(1, 2, 0).astype(float) for image in (frame, mean))
    sigma = noise / scales[1]
    length = np.linalg.norm(mean, axis=2)
    unit = mean / length[..., None]
    along = (colour * unit).sum(axis=2)
    off = colour - along[..., None] * unit
    variance = np.maximum(sigma**2, spread_across)
    across = np.exp(-0.5 * (off**2).sum(axis=2) / sigma**2) / (2 * np.pi * variance)
    bright = np.hypot(sigma, flicker * length)
    lit = across * np.exp(-0.5 * ((along - length) / bright) ** 2) / (np.sqrt(2 * np.pi) * bright)
    ratio = along / length
    shade = shades[np.clip((ratio * len(shades)).astype(int), 0, len(shades) - 1)]
    shaded = across * np.exp(-0.5 * uneven) * shade * (ratio < 1) / length
    table, others, worn = densities
    any_share = np.where(known, CUT.otherwise, 1) * others[tuple(frame >> shift)]
    background = 0.85 * lit + shaded + any_share
    person = table[tuple(frame >> shift)]
    odds = np.clip(person - np.log(background), -COLOURS.most_odds, COLOURS.most_odds)
    out[:] = np.where(odds < 0, odds * worn[tuple(frame >> shift)], odds)


def sharpen(planes, mean, light, band, inside, outside, reach, least_contrast, mask):
    """Pixels more than half of whose colour is the person's, along the line between the means."""
    frame, mean = (image.transpose(1, 2, 0) for image in (planes, mean))
    stride = max(1, reach // 4)
    for row, column in np.argwhere(band):
        window = (
            slice(max(row - reach, 0), row + reach + 1, stride),
            slice(max(column - reach, 0), column + reach + 1, stride),
        )
        inner, outer = inside[window], outside[window] & ~inside[window]
        if min(inner.sum(), outer.sum()) < 3:
            continue
        ratio = frame[window][outer].sum(axis=0) / mean[window][outer].sum(axis=0)
        background = mean[row, column] * np.clip(ratio, *light)
        step = frame[window][inner].mean(axis=0) - background
        if step @ step > least_contrast**2:
            mask[row, column] = (frame[row, column] - background) @ step > 0.5 * step @ step


def draw(vertices, faces, face_part, matrix, near, cull, parts, depth):
    """Meshes in front of the near plane: every edge function at every pixel, in whole 1/256 px."""
    homogeneous = vertices @ matrix.T
    corners = np.floor(homogeneous[:, :2] / homogeneous[:, 2:] * 256 + 0.5).astype(np.int64)
    x, y = np.meshgrid(np.arange(parts.shape[1]) * 256, np.arange(parts.shape[0]) * 256)
    for face, part in zip(faces, face_part, strict=True):
        (a, b, c), w = corners[face], 1 / vertices[face, 2]
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if area == 0 or (cull and area > 0):
            continue
        if area < 0:
            b, c, w, area = c, b, w[[0, 2, 1]], -area
        edges, inside = [], np.ones(parts.shape, bool)
        for p, q in ((b, c), (c, a), (a, b)):
            dx, dy = q - p
            edge = dx * (y - p[1]) - dy * (x - p[0])
            inside &= (edge >= 0) if dy < 0 or (dy == 0 and dx > 0) else (edge > 0)
            edges.append(edge)
        z = area / np.maximum(np.tensordot(w, edges, 1), 1e-9)
        nearer = inside & (z.astype(np.float32) < depth)
        parts[nearer], depth[nearer] = part + 1, z[nearer]


def draw_many(vertices, faces, face_part, matrix, near, cull, parts):
    """Each pose into its own image."""
    own = np.broadcast_to(face_part, (len(vertices), len(faces)))
    for pose, part, image in zip(vertices, own, parts, strict=True):
        depth = np.full(image.shape, np.inf, np.float32)
        draw(pose, faces, part, matrix, near, cull, image, depth)


def thin_in_place(image, removable):
    """Guo and Hall, algorithm A1: two passes in turn over all pixels, until nothing goes."""
    height, width = image.shape
    around = ((0, 0), (0, 1), (0, 2), (1, 2), (2, 2), (2, 1), (2, 0), (1, 0))
    inner, before = image[1:-1, 1:-1], np.empty(0)
    while not np.array_equal(before, image):
        before = image.copy()
        for going in removable:
            code = sum(
                image[y : y + height - 2, x : x + width - 2].astype(int) << bit
                for bit, (y, x) in enumerate(around)
            )
            inner[going[code]] = 0


def _unit(colour):
    """Colours (H, W, 3) over their lengths; black stays black."""
    return colour / np.maximum(np.linalg.norm(colour, axis=2, keepdims=True), 1.0)


def _split(frame, mean, scales):
    """Residual (3, H, W), in noise, after projection onto the background's colour; its multiple."""
    colour = frame.astype(np.float64)
    ratio = (colour * mean).sum(axis=0) * scales[0]
    return (colour - ratio * mean) * scales[1], ratio
