"""Subtraction of the background, and its median, pixel by pixel.

Source: Okada and Stenger, section 5.1; the median is ours. Called by
`silhouette_core.image.background`. Reference: `tests.oracles.image`.
"""

import numpy as np

from silhouette_core.jit import kernel


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
