"""Background models against the paper's formula, and on synthetic scenes."""

import re

import numpy as np
import pytest

from silhouette_core.image.background import BackgroundModel
from silhouette_core.tuning import BACKGROUND
from tests.oracles import image as reference
from tests.silhouette_core.image.drawn_figures import noisy

SIZE = (48, 64)


# An empty room: smooth light over a coloured wall, (H, W, 3).
LIGHT = 110 + 60 * np.linspace(0, 1, SIZE[1]) + 20 * np.linspace(0, 1, SIZE[0])[:, None]
ROOM = LIGHT[..., None] * np.array([1.0, 0.9, 0.8])


def paper_reference(frames: list[np.ndarray], frame: np.ndarray) -> np.ndarray:
    """Okada and Stenger, section 5.1, in NumPy."""
    colours = np.stack(frames).astype(np.float64)
    units = colours / np.linalg.norm(colours, axis=3, keepdims=True)
    mean, unit_mean = colours.mean(0), units.mean(0)
    least = (BACKGROUND.noise / np.linalg.norm(mean, axis=2, keepdims=True)) ** 2
    variance = np.maximum(units.var(0), least)
    log_peak = np.log(1 / np.sqrt(2 * np.pi * variance)).sum(axis=2)
    limits, mask = (BACKGROUND.log_likelihood, BACKGROUND.raw_difference), np.empty(SIZE, bool)
    reference.paper_mask(frame, mean, unit_mean, 0.5 / variance, log_peak, *limits, mask)
    return mask


def test_the_paper_method_equals_the_formula():
    rng = np.random.default_rng(0)
    *frames, frame = (noisy(ROOM, rng) for _ in range(21))
    frame[10:30, 20:30] = (40, 40, 180)
    frame[10:30, 40:50] = (frame[10:30, 40:50] * 0.4).astype(np.uint8)
    result = BackgroundModel.from_frames(frames, "paper").silhouette(frame)
    np.testing.assert_array_equal(result, paper_reference(frames, frame))


def test_wrong_frames_are_refused():
    model = BackgroundModel.from_frames([noisy(ROOM, np.random.default_rng(3))])
    for shape in (SIZE, (20, 20, 3)):
        with pytest.raises(ValueError, match=re.escape(f"(48, 64, 3) uint8, got {shape}")):
            model.silhouette(np.zeros(shape, np.uint8))
    for of_nothing in (BackgroundModel.from_frames, BackgroundModel.from_occupied):
        with pytest.raises(ValueError, match="got none"):
            of_nothing([])
