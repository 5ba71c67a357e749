"""Crude people, distances from them the slow way, noise, and how well silhouettes agree."""

import cv2
import numpy as np
from scipy.spatial import cKDTree


def figure(rng, shape=(60, 80)):
    """A crude person: trunk, head and four limbs of random direction."""
    image = np.zeros(shape, np.uint8)
    h = shape[0]
    middle = np.array([shape[1] / 2, h / 2]) + rng.uniform(-0.04, 0.04, 2) * h
    cv2.ellipse(
        image, middle.astype(int).tolist(), (h // 12, h // 6), rng.uniform(-20, 20), 0, 360, 1, -1
    )
    for _ in range(5):
        angle = rng.uniform(0, 2 * np.pi)
        end = middle + np.array([np.cos(angle), np.sin(angle)]) * h * rng.uniform(0.2, 0.4)
        cv2.line(image, middle.astype(int).tolist(), end.astype(int).tolist(), 1, max(1, h // 20))
    return image.astype(bool)


def noisy(picture, rng, noise=1.5):
    return np.clip(np.rint(picture + rng.normal(0, noise, picture.shape)), 0, 255).astype(np.uint8)


def agreements(model, frames, masks):
    """Intersection over union of the silhouettes of frames with the true ones."""
    silhouettes = np.stack([model.silhouette(frame) for frame in frames])
    return (silhouettes & masks).sum(axis=(1, 2)) / (silhouettes | masks).sum(axis=(1, 2))


def to_set(points, shape):
    """Distance of every pixel to the nearest of `points`, the slow way."""
    grid = np.stack(np.mgrid[: shape[0], : shape[1]], -1).reshape(-1, 2)
    return cKDTree(np.argwhere(points)).query(grid)[0].reshape(shape)
