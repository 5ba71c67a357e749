"""Background subtraction, pixel by pixel. Plain arrays only; the door is `silhouette_core.image.background`."""

import numpy as np

from silhouette_core.jit import parallel_kernel, prange


@parallel_kernel
def add_moments(frame, sum_raw, sum_unit, sum_unit_squared):
    """Adds one frame (H, W, 3) uint8 to the running sums, each (H, W, 3) float64."""
    height, width = frame.shape[0], frame.shape[1]
    for row in prange(height):
        for column in range(width):
            blue = np.float64(frame[row, column, 0])
            green = np.float64(frame[row, column, 1])
            red = np.float64(frame[row, column, 2])
            length = max(np.sqrt(blue * blue + green * green + red * red), 1.0)
            for channel, value in enumerate((blue, green, red)):
                unit = value / length
                sum_raw[row, column, channel] += value
                sum_unit[row, column, channel] += unit
                sum_unit_squared[row, column, channel] += unit * unit


@parallel_kernel
def paper_mask(frame, mean, unit_mean, half_precision, log_peak, log_threshold, raw_threshold, mask):
    """Okada and Stenger, section 5.1: unlikely direction of colour, or a clearly different colour."""
    height, width = mask.shape
    limit = raw_threshold * raw_threshold
    for row in prange(height):
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
                step = np.float32(frame[row, column, channel]) * scale - unit_mean[row, column, channel]
                log_likelihood -= step * step * half_precision[row, column, channel]
            mask[row, column] = log_likelihood < log_threshold or difference > limit
