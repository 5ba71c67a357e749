"""Shading is what is left of a picture's brightness when its colours are taken away."""

import numpy as np
import pytest

from silhouette_core.image.shading import ColourBrightness, chromaticity, relative_shading

SHIRT, SKIN = np.array([60, 90, 200]), np.array([130, 160, 215])


def grey(picture):
    return picture.mean(axis=2).astype(np.uint8)


def dressed(light):
    """Picture (h, w, 3) in a light (h, w), of two colours side by side."""
    colours = np.where((np.arange(light.shape[1]) % 20 < 10)[None, :, None], SHIRT, SKIN)
    return np.clip(np.rint(colours * light[..., None]), 0, 255).astype(np.uint8)


def brightness(picture):
    """Learned from a picture."""
    known = ColourBrightness()
    known.add(chromaticity(picture).ravel(), grey(picture).ravel())
    return known


def shading(light, **how):
    picture = dressed(light)
    known = brightness(picture)
    inside = how.get("inside", np.ones(light.shape, bool))
    return relative_shading(chromaticity(picture), grey(picture), known.mean(), inside)


def test_light_is_found_whatever_the_colours():
    light = np.repeat(np.linspace(0.5, 1, 40), 100).reshape(40, 100)
    found = shading(light)
    np.testing.assert_allclose(found.mean(axis=0), 0, atol=0.03)
    expected = np.log(light) - np.log(light).mean()
    assert np.abs(found - expected).max() < 0.12  # of the grey levels that are added
    slope = np.polyfit(expected.ravel(), found.ravel(), 1)[0]
    assert 0.8 < slope <= 1.001


def test_colours_keep_their_number_in_other_light():
    numbers = [
        chromaticity((SHIRT * light)[None, None].astype(np.uint8))[0, 0] for light in (1, 0.6)
    ]
    assert abs(int(numbers[0]) // 64 - int(numbers[1]) // 64) <= 1
    assert chromaticity(SKIN[None, None].astype(np.uint8)) != numbers[0]
    assert chromaticity(np.full((1, 1, 3), 255, np.uint8)).max() < 4096
    with pytest.raises(TypeError, match="picture must be"):
        chromaticity(np.zeros((4, 4, 3)))


def test_outside_and_of_rare_colours_nothing_is_said():
    light = np.ones((40, 100))
    inside = np.zeros((40, 100), bool)
    assert not shading(light * np.linspace(0.4, 1, 100), inside=inside).any()
    picture = dressed(light)[:4, :4]
    few = brightness(picture)
    assert np.isnan(few.mean()).all()
    brighter = np.minimum(picture + 30, 255).astype(np.uint8)
    found = relative_shading(chromaticity(picture), grey(brighter), few.mean(), picture[..., 0] > 0)
    assert not found.any()
