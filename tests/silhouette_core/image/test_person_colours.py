"""What has the colours of the person is found where it hardly differs from the background."""

from dataclasses import replace

import numpy as np
import pytest

from silhouette_core.image.cut import SceneColours
from silhouette_core.image.difference import Background
from silhouette_core.image.person_colours import PersonColours

GREY, PINK, SHIRT = (130, 130, 130), (150, 130, 220), (75, 75, 75)
BODY, SHADOW = (slice(60, 160), slice(80, 130)), (slice(60, 160), slice(180, 230))


def filmed(wall, rng, shirt=None, shadow=None):
    """A wall, the body before it, and a shadow beside, which leaves a share of the light."""
    picture = np.full((240, 320, 3), wall, float)
    if shadow is not None:
        picture[SHADOW] *= shadow
    if shirt is not None:
        picture[BODY] = shirt
    return np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)


def body():
    mask = np.zeros((240, 320), bool)
    mask[BODY] = True
    return mask


@pytest.fixture(scope="module")
def rng():
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def colours(rng):
    """Learned where the wall is pink."""
    colours = PersonColours()
    assert colours.density() is None
    for _ in range(3):
        colours.add(filmed(PINK, rng, SHIRT), body())
    return colours


@pytest.fixture
def density(colours):
    return colours.density()


def test_clothes_like_a_shadow_on_the_wall_are_found_by_their_colours(rng, density):
    wall = np.full((240, 320, 3), GREY, np.float32)
    background = Background.from_noise(wall, np.full(wall.shape[:2], 2.0))
    scene = SceneColours.of(replace(background, shadow=0.4))
    picture = filmed(GREY, rng, SHIRT, shadow=0.75)
    assert (scene.silhouette(picture) & body()).sum() < 0.3 * body().sum()
    found = scene.wearing(density).silhouette(picture)
    assert (found ^ body()).sum() < 0.1 * body().sum()  # not the shadow beside


def test_the_density_is_that_of_the_pixels_inside(rng, colours, density):
    """Its sum over all colours is 1; of the person's pixels 95 % have a colour above the least."""
    total = np.exp(density.astype(float)).sum() * 8**3
    assert total == pytest.approx(1, rel=1e-3)
    shirt = filmed(PINK, rng, SHIRT)[BODY] >> 3
    inside = np.exp(density)[tuple(np.moveaxis(shirt, -1, 0))]
    assert (inside >= np.exp(colours.least(density)) * 0.999).mean() > 0.94
    wide = PersonColours()
    wide.add(filmed(PINK, rng, SHIRT), np.pad(body()[2:-2, 2:-2], 2) | body())
    loose = np.zeros_like(body())
    loose[58:162, 78:132] = True  # an edge two pixels wide of the wall
    wide.add(filmed(PINK, rng, SHIRT), loose)
    pink = tuple(value >> 3 for value in PINK)
    assert wide.density()[pink] == pytest.approx(np.log(0.01 / 256**3), abs=0.1)
