"""Residuals of a frame against the background, and the sharpening of a silhouette's edges.

Source: own, see `silhouette_core.image.foreground`, which calls them. Reference:
`tests.oracles.image`.
"""

import numpy as np

from silhouette_core.jit import kernel
from silhouette_core.tuning import COLOURS, CUT

# How often a pixel of the background is lit as it was, over the constant of the density of three
# Gaussians, and the constant of that of two.
_LIT = np.float32(COLOURS.lit / np.sqrt(2 * np.pi) ** 3)
_SHADED = np.float32(1 / (2 * np.pi))
# How often the background shows another of its colours, where it is known and where it is guessed.
_OTHERWISE = np.float32(CUT.otherwise), np.float32(1)
_MOST_ODDS = np.float32(COLOURS.most_odds)


@kernel
def _split(frame, mean, scales, row, column):
    """Projects a pixel's colour onto the background's colour.

    Frame (3, H, W); mean (3, H, W) is the background's colour; scales (3, H, W) holds
    1 / |background|^2, 1 / noise and |background| / noise. Returns the three components of the
    residual, in noise, and the ratio of the projection to the background.
    """
    colour_0 = np.float32(frame[0, row, column])
    colour_1 = np.float32(frame[1, row, column])
    colour_2 = np.float32(frame[2, row, column])
    background_0 = mean[0, row, column]
    background_1 = mean[1, row, column]
    background_2 = mean[2, row, column]
    ratio = (colour_0 * background_0 + colour_1 * background_1 + colour_2 * background_2) * scales[
        0, row, column
    ]
    scale = scales[1, row, column]
    residual_0 = (colour_0 - ratio * background_0) * scale
    residual_1 = (colour_1 - ratio * background_1) * scale
    residual_2 = (colour_2 - ratio * background_2) * scale
    return residual_0, residual_1, residual_2, ratio


@kernel
def sampled_chroma(frame, mean, scales, clip, radius, step, out):
    """Fills out (H', W') float32: length of the pooled residual at every step-th pixel."""
    height, width = frame.shape[1], frame.shape[2]
    for k in range(out.shape[0]):
        for j in range(out.shape[1]):
            sum_0 = sum_1 = sum_2 = np.float32(0.0)
            count = 0
            for row in range(max(k * step - radius, 0), min(k * step + radius + 1, height)):
                for column in range(max(j * step - radius, 0), min(j * step + radius + 1, width)):
                    residual_0, residual_1, residual_2, _ = _split(frame, mean, scales, row, column)
                    square = (
                        residual_0 * residual_0 + residual_1 * residual_1 + residual_2 * residual_2
                    )
                    factor = np.float32(1.0)
                    if square > clip * clip:
                        factor = clip / np.sqrt(square)
                    sum_0 += residual_0 * factor
                    sum_1 += residual_1 * factor
                    sum_2 += residual_2 * factor
                    count += 1
            out[k, j] = np.sqrt(sum_0 * sum_0 + sum_1 * sum_1 + sum_2 * sum_2) / count


@kernel
def residuals(frame, mean, scales, unit, clip, parts):
    """Fills parts (3, H, W) int16: the chromatic residual cut to length clip, in 1 / unit of the
    noise. Without branches, so that the compiler uses vectors.
    """
    _, height, width = parts.shape
    limit = clip * clip
    for row in range(height):
        for column in range(width):
            residual_0, residual_1, residual_2, _ = _split(frame, mean, scales, row, column)
            square = residual_0 * residual_0 + residual_1 * residual_1 + residual_2 * residual_2
            factor = unit * (clip / np.sqrt(max(square, limit)))
            parts[0, row, column] = np.int16(np.int32(residual_0 * factor))
            parts[1, row, column] = np.int16(np.int32(residual_1 * factor))
            parts[2, row, column] = np.int16(np.int32(residual_2 * factor))


@kernel
def brightness(frame, mean, scales, out):
    """Fills out (H, W) float32: signed difference along the background's colour, in noise."""
    height, width = out.shape
    for row in range(height):
        for column in range(width):
            _, _, _, ratio = _split(frame, mean, scales, row, column)
            out[row, column] = (ratio - np.float32(1.0)) * scales[2, row, column]


@kernel
def log_odds(
    frame, mean, scales, noise, flicker, shades, uneven, spread_across, densities, shift, known, out
):
    """Fills out (H, W) float32: log p(colour | person) - log p(colour | background), limited, and
    times the third of the densities (n, n, n) where that is below 0.

    The first of them is the first logarithm. The background is seen as it was, but for a brightness
    with the relative deviation flicker, or in a shadow, whose brightness has the density shades
    (m,) from 0 to 1, each with Gaussian noise `noise` times the model's, or otherwise, with the
    second density, more often where it is not known (H, W) but guessed. Frame
    and mean are (3, H, W), see `_split`.
    """
    table, others, worn = densities
    _, height, width = frame.shape
    for row in range(height):
        for column in range(width):
            colour = (
                frame[0, row, column] >> shift,
                frame[1, row, column] >> shift,
                frame[2, row, column] >> shift,
            )
            background = others[colour] * _OTHERWISE[0 if known[row, column] else 1]
            if table[colour] - np.log(background) <= -_MOST_ODDS:  # whatever else it may be
                out[row, column] = -_MOST_ODDS * worn[colour]
                continue
            residual_0, residual_1, residual_2, ratio = _split(frame, mean, scales, row, column)
            deviation = noise / scales[1, row, column]
            across = max(deviation * deviation, spread_across)
            square = (
                residual_0 * residual_0 + residual_1 * residual_1 + residual_2 * residual_2
            ) / (noise * noise)
            along = (ratio - np.float32(1.0)) * scales[2, row, column] / noise
            spread = np.float32(1.0) + (flicker * scales[2, row, column] / noise) ** 2
            background += (
                _LIT
                * np.exp(np.float32(-0.5) * (square + along * along / spread))
                / (across * deviation * np.sqrt(spread))
            )
            if np.float32(0.0) < ratio < np.float32(1.0):
                length = scales[2, row, column] / scales[1, row, column]
                background += (
                    _SHADED
                    * shades[int(ratio * len(shades))]
                    * np.exp(np.float32(-0.5) * (square + uneven[row, column]))
                    / (across * length)
                )
            odds = table[colour] - np.log(background)
            odds = np.float32(max(-_MOST_ODDS, min(_MOST_ODDS, odds)))
            out[row, column] = odds if odds >= np.float32(0.0) else odds * worn[colour]


@kernel
def _sharpen_row(row, images, light, regions, reach, least_contrast, mask):
    """One row of `sharpen`."""
    planes, mean = images
    band, inside, outside = regions
    height, width = mask.shape
    stride = max(1, reach // 4)
    first, last = width, -1
    for column in range(width):
        if band[row, column]:
            first = min(first, column)
            last = column
    if last < 0:
        return
    left, right = max(first - reach, 0), min(last + reach + 1, width)
    # Sums over the window's rows, for every column: inside and outside pixels, and the colours
    # of the frame inside, of the frame outside, of the model outside.
    sums = np.zeros((11, right - left), np.float32)
    within = np.empty(right - left, np.float32)
    beyond = np.empty(right - left, np.float32)
    for y in range(max(row - reach, 0), min(row + reach + 1, height), stride):
        for k in range(right - left):
            within[k] = np.float32(inside[y, left + k])
            beyond[k] = np.float32(outside[y, left + k]) * (np.float32(1.0) - within[k])
            sums[0, k] += within[k]
            sums[1, k] += beyond[k]
        for channel in range(3):
            for k in range(right - left):
                value = np.float32(planes[channel, y, left + k])
                sums[2 + channel, k] += within[k] * value
                sums[5 + channel, k] += beyond[k] * value
                sums[8 + channel, k] += beyond[k] * mean[channel, y, left + k]
    window = np.empty(11, np.float32)
    for column in range(first, last + 1):
        if not band[row, column]:
            continue
        window[:] = 0
        for x in range(max(column - reach, 0), min(column + reach + 1, width), stride):
            for k in range(11):
                window[k] += sums[k, x - left]
        if window[0] < 3 or window[1] < 3:
            continue
        fraction = np.float32(0.0)
        contrast = np.float32(0.0)
        for channel in range(3):
            ratio = window[5 + channel] / max(window[8 + channel], np.float32(1e-3))
            background = mean[channel, row, column] * min(max(ratio, light[0]), light[1])
            axis = window[2 + channel] / window[0] - background
            fraction += (np.float32(planes[channel, row, column]) - background) * axis
            contrast += axis * axis
        if contrast > least_contrast * least_contrast:
            mask[row, column] = fraction > np.float32(0.5) * contrast


@kernel
def sharpen(planes, mean, light, band, inside, outside, reach, least_contrast, mask):
    """Sets mask in the band: whether more than half of a pixel's colour is the person's.

    The person's colour is the mean of the window's inside pixels. The background's is the model's,
    times what light and shadow have as ratio, within the two of light, on the window's outside
    pixels. Pixels with too few of either, or too little contrast, keep their label. Frame and mean
    are (3, H, W).
    """
    images, regions = (planes, mean), (band, inside, outside)
    for row in range(mask.shape[0]):
        # range counts in uint64, which would be compiled as well.
        _sharpen_row(np.int64(row), images, light, regions, reach, least_contrast, mask)
