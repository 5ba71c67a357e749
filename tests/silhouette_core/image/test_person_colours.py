"""What has the colours of the person is found where it hardly differs from the background."""

import numpy as np
import pytest

from silhouette_core.image.background import BackgroundModel
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
def density(rng):
    """Learned where the wall is pink."""
    colours = PersonColours()
    assert colours.density() is None
    for _ in range(3):
        colours.add(filmed(PINK, rng, SHIRT), body())
    density = colours.density()
    assert density is not None
    return density


def test_clothes_like_a_shadow_on_the_wall_are_found_by_their_colours(rng, density):
    background = BackgroundModel.from_frames([filmed(GREY, rng) for _ in range(12)])
    picture = filmed(GREY, rng, SHIRT, shadow=0.75)
    missed = background.with_shadow(0.4).silhouette(picture)
    assert (missed & body()).sum() < 0.3 * body().sum()
    found = background.with_shadow(0.4).coloured_silhouette(picture, density)
    assert (found.likely ^ body()).sum() < 0.1 * body().sum()  # not the shadow beside
    assert not found.alike[SHADOW].any() and found.alike[BODY].mean() > 0.95


def test_a_wall_of_the_same_colour_may_be_the_person(rng, density):
    background = BackgroundModel.from_frames([filmed(SHIRT, rng) for _ in range(12)])
    found = background.coloured_silhouette(filmed(SHIRT, rng, SHIRT), density)
    assert found.alike.mean() > 0.9 and found.likely.mean() < 0.02


def test_another_persons_colours_tell_nothing(rng, density):
    background = BackgroundModel.from_frames([filmed(GREY, rng) for _ in range(12)])
    found = background.coloured_silhouette(filmed(GREY, rng, (40, 200, 60)), density)
    assert not found.alike.any()


def test_outside_the_region_nothing_is_found(rng, density):
    background = BackgroundModel.from_frames([filmed(GREY, rng) for _ in range(12)])
    region = np.arange(320) < 105
    found = background.coloured_silhouette(
        filmed(GREY, rng, SHIRT), density, np.tile(region, (240, 1))
    )
    for mask in (found.likely, found.alike):
        assert mask[:, :100].any() and not mask[:, 105:].any()


def test_the_density_is_that_of_the_pixels_inside(rng, density):
    """Its sum over all colours is 1; of the person's pixels 95 % have a colour above the least."""
    total = np.exp(density.log_density.astype(float)).sum() * 8**3
    assert total == pytest.approx(1, rel=1e-3)
    shirt = filmed(PINK, rng, SHIRT)[BODY] >> 3
    inside = np.exp(density.log_density)[tuple(np.moveaxis(shirt, -1, 0))]
    assert (inside >= density.least * 0.999).mean() > 0.94
    wide = PersonColours()
    wide.add(filmed(PINK, rng, SHIRT), np.pad(body()[2:-2, 2:-2], 2) | body())
    loose = np.zeros_like(body())
    loose[58:162, 78:132] = True  # an edge two pixels wide of the wall
    wide.add(filmed(PINK, rng, SHIRT), loose)
    pink = tuple(value >> 3 for value in PINK)
    assert wide.density().log_density[pink] == pytest.approx(np.log(0.01 / 256**3), abs=0.1)
