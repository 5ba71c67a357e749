"""Encoders convolve, learn, and order their codes."""

import numpy as np
import pytest
from scipy.signal import correlate

from silhouette_core.monocular.making.learning_settings import TrainingSettings
from silhouette_core.monocular.making.network_training import (
    PictureBatch,
    TrainingBatch,
    read_codes,
    train_encoders,
)
from silhouette_core.monocular.proposal.convolutional_encoder import ConvolutionalEncoder
from silhouette_core.monocular.proposal.silhouette_features import (
    FEET_GRID,
    GRID,
    INSIDE_CODES,
    OUTLINE_CODES,
    SilhouetteBasis,
    inside_images,
    outline_images,
)
from silhouette_core.progress import SilentReporter

CELLS = FEET_GRID[0] * FEET_GRID[1]
FEET = SilhouetteBasis(np.zeros(CELLS, np.float32), np.zeros((CELLS, 1), np.float32))


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def in_double(encoder):
    return ConvolutionalEncoder(
        tuple(one.astype(float) for one in encoder.weights),
        tuple(one.astype(float) for one in encoder.biases),
    )


def convolved(image, weights, bias, size, margins):
    """One convolution by scipy; margins: cells before and after, in rows and columns."""
    padded = np.pad(image, [*margins, (0, 0)])
    filters = weights.reshape(size, size, image.shape[-1], -1)
    maps = [
        correlate(padded, filters[..., k], "valid", "direct")[::2, ::2, 0] + bias[k]
        for k in range(len(bias))
    ]
    return np.maximum(np.stack(maps, axis=-1), 0)


def test_an_encoder_convolves_at_every_other_cell(rng):
    encoder = in_double(ConvolutionalEncoder.initial(2, 3, 5, rng))
    for bias in encoder.biases:
        bias[:] = rng.normal(0, 0.3, bias.shape)
    images = rng.normal(size=(3, *GRID, 2))
    margins = [((1, 2), (1, 2)), ((0, 1), (0, 1)), ((1, 1), (0, 1))]
    for image, codes in zip(images, encoder.encode(images), strict=True):
        state = image
        for layer, (size, margin) in enumerate(zip((5, 3, 3), margins, strict=True)):
            state = convolved(state, encoder.weights[layer], encoder.biases[layer], size, margin)
        assert state.shape == (8, 10, 12)
        expected = state.reshape(-1) @ encoder.weights[3] + encoder.biases[3]
        np.testing.assert_allclose(codes, expected, atol=1e-9)


def test_codes_of_many_images_are_those_of_each(rng):
    encoder = ConvolutionalEncoder.initial(1, 4, 6, rng)
    images = rng.random((37, *GRID, 1), np.float32)
    codes = encoder.encode(images)
    assert codes.shape == (37, 6) and encoder.encode(images[:0]).shape == (0, 6)
    np.testing.assert_allclose(codes[[2, 36]], encoder.encode(images[[2, 36]]), atol=1e-5)


def test_training_reads_the_codes_that_encoders_give(rng):
    outline, inside = (ConvolutionalEncoder.initial(channels, 3, 5, rng) for channels in (1, 2))
    for bias in (*outline.biases, *inside.biases):
        bias[:] = rng.normal(0, 0.3, bias.shape)
    images = [rng.random((6, *GRID, channels), np.float32) for channels in (1, 2)]
    coloured, others = np.arange(6) % 3 > 0, rng.random((6, 3), np.float32)
    samples = TrainingBatch(others, np.zeros((6, 2, 3)), np.zeros((6, 3)))
    layers = [(encoder.weights, encoder.biases) for encoder in (outline, inside)]
    found = read_codes(*layers, PictureBatch(*images, coloured, samples)).inputs
    known = coloured[:, None]
    codes = outline.encode(images[0]), inside.encode(images[1]) * known
    np.testing.assert_allclose(found, np.concatenate([*codes, known, others], axis=1), atol=1e-4)


def test_ordered_codes_are_uncorrelated_and_tell_the_same(rng):
    encoder = ConvolutionalEncoder.initial(2, 4, 6, rng)
    images = rng.random((200, *GRID, 2), np.float32) * rng.random((200, 1, 1, 2), np.float32)
    before, codes = encoder.encode(images), encoder.ordered(images).encode(images)
    np.testing.assert_allclose(codes.mean(axis=0), 0, atol=1e-3)
    covariance = np.cov(codes.T)
    deviation = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(covariance / np.outer(deviation, deviation), np.eye(6), atol=0.02)
    assert deviation[0] == pytest.approx(1, rel=0.01) and (np.diff(deviation) < 0).all()
    fitted = np.linalg.lstsq(np.pad(codes, ((0, 0), (0, 1)), constant_values=1), before, rcond=None)
    np.testing.assert_allclose(
        np.pad(codes, ((0, 0), (0, 1)), constant_values=1) @ fitted[0], before, atol=1e-3
    )


def test_trained_encoders_tell_places_that_are_seen(rng):
    """A blob's place is the pose; half of it is seen inside only."""

    def draw(rng, samples):
        places = rng.uniform(-0.4, 0.4, (samples, 2))
        rows, columns = np.indices(GRID)
        y, x = 30 + 40 * places[:, :1, None], 40 + 40 * places[:, 1:, None]
        coverage = 4 * (np.abs(columns - x) < 6) * (np.abs(rows - 30) < 9)
        skin = 4 * (np.abs(rows - y) < 6) * (np.abs(columns - 40) < 9)
        joints = np.zeros((samples, 1, 3), np.float32)
        joints[:, 0, [2, 0]] = places
        return PictureBatch(
            outline_images(coverage),
            inside_images(skin, np.full(skin.shape, 32)),
            np.ones(samples, bool),
            TrainingBatch(
                np.zeros((samples, 1), np.float32), joints, np.zeros((samples, 3), np.float32)
            ),
        )

    settings = TrainingSettings(steps=40, batch=48, rate=5e-3, units=32, blocks=1, modes=1)
    encoders = train_encoders(draw, FEET, settings, rng, SilentReporter())
    assert encoders.outline.codes == OUTLINE_CODES and encoders.inside.codes == INSIDE_CODES
    seen = draw(rng, 200)
    codes = (
        encoders.outline.encode(seen.outline)[:, :6],
        encoders.inside.encode(seen.inside)[:, :6],
    )
    for own, axis in zip(codes, (0, 2), strict=True):
        rows = np.pad(own, ((0, 0), (0, 1)), constant_values=1)
        place = seen.samples.joints[:, 0, axis]
        fitted = rows @ np.linalg.lstsq(rows, place, rcond=None)[0]
        assert np.std(fitted - place) < 0.25 * np.std(place)
