"""The background model against the paper's formula, and on made-up scenes."""

import numpy as np
import pytest

from silhouette_core.image.background import BackgroundModel, BackgroundSettings

SIZE = (48, 64)


def scene(rng: np.random.Generator) -> np.ndarray:
    """An empty room: smooth light over a coloured wall, (H, W, 3) float."""
    light = (
        110
        + 60 * np.linspace(0, 1, SIZE[1])[None, :, None]
        + 20 * np.linspace(0, 1, SIZE[0])[:, None, None]
    )
    return light * np.array([1.0, 0.9, 0.8])


def shot(picture: np.ndarray, rng: np.random.Generator, noise: float = 1.5) -> np.ndarray:
    return np.clip(np.rint(picture + rng.normal(0, noise, picture.shape)), 0, 255).astype(np.uint8)


def paper_reference(
    frames: list[np.ndarray], frame: np.ndarray, settings: BackgroundSettings
) -> np.ndarray:
    """Section 5.1 as near to its sentences as NumPy allows."""
    colours = np.stack(frames).astype(np.float64)
    units = colours / np.linalg.norm(colours, axis=3, keepdims=True)
    mean, unit_mean = colours.mean(0), units.mean(0)
    variance = np.maximum(
        units.var(0), (settings.noise / np.linalg.norm(mean, axis=2, keepdims=True)) ** 2
    )
    unit = frame / np.linalg.norm(frame.astype(np.float64), axis=2, keepdims=True)
    likelihood = np.prod(
        np.exp(-((unit - unit_mean) ** 2) / (2 * variance)) / np.sqrt(2 * np.pi * variance), axis=2
    )
    return (likelihood < np.exp(settings.log_likelihood)) | (
        np.linalg.norm(frame - mean, axis=2) > settings.raw_difference
    )


def test_paper_method_is_the_papers_formula():
    rng = np.random.default_rng(0)
    settings = BackgroundSettings(method="paper")
    frames = [shot(scene(rng), rng) for _ in range(20)]
    frame = shot(scene(rng), rng)
    frame[10:30, 20:30] = (40, 40, 180)
    frame[10:30, 40:50] = (frame[10:30, 40:50] * 0.4).astype(np.uint8)
    found = BackgroundModel.from_frames(frames, settings).silhouette(frame)
    np.testing.assert_array_equal(found, paper_reference(frames, frame, settings))


def test_a_still_is_enough():
    rng = np.random.default_rng(1)
    model = BackgroundModel.from_still(shot(scene(rng), rng))
    picture = scene(rng)
    picture[10:34, 20:36] = (40, 40, 180)
    truth = np.zeros(SIZE, bool)
    truth[10:34, 20:36] = True
    found = model.silhouette(shot(picture, rng))
    assert (found & truth).sum() / (found | truth).sum() > 0.95


def test_median_forgets_who_walks_through():
    rng = np.random.default_rng(2)
    frames = []
    for step in range(15):
        picture = scene(rng)
        picture[10:40, 4 * step : 4 * step + 8] = (40, 40, 180)
        frames.append(shot(picture, rng))
    model = BackgroundModel.from_median(frames)
    assert np.abs(model.mean - scene(rng)).max() < 6
    assert model.size == (64, 48)


def test_wrong_frames_are_named():
    rng = np.random.default_rng(3)
    model = BackgroundModel.from_still(shot(scene(rng), rng))
    with pytest.raises(ValueError, match=r"\(48, 64, 3\) uint8, got \(48, 64\)"):
        model.silhouette(np.zeros(SIZE, np.uint8))
    with pytest.raises(ValueError, match=r"\(48, 64, 3\) uint8, got \(20, 20, 3\)"):
        model.silhouette(np.zeros((20, 20, 3), np.uint8))
    with pytest.raises(ValueError, match="got none"):
        BackgroundModel.from_frames([])
    with pytest.raises(ValueError, match="got none"):
        BackgroundModel.from_median([])
