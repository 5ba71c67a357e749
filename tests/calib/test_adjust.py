"""Bundle adjustment: what is stated about its accuracy, and what outliers do to it."""

from dataclasses import replace

import numpy as np
import pytest
from boards import looking_at

from calib.adjust import Adjustment, BundleScene, Observations, adjust
from calib.camera import Camera
from calib.extrinsics import pose_difference
from calib.rotation import matrix_from_rodrigues, rodrigues_from_matrix

MATRIX = np.array([[600.0, 0, 319.5], [0, 600, 239.5], [0, 0, 1]])
CORNERS = np.array([[0.08 * x, 0.08 * y, 0.0] for x in range(-3, 4) for y in range(-2, 3)])
NOISE_PX = 0.3


def scene(boards: int = 6, distortion: tuple[float, ...] = ()) -> BundleScene:
    """Three cameras about boards that are held in the middle, tilted this way and that."""
    places = [(3.0, 0.2, 1.0), (0.4, 3.2, 1.6), (-2.6, 1.5, 1.2)]
    cameras = [
        looking_at(f"cam_{k}", np.array(place), np.array([0, 0, 1.0]), MATRIX, (640, 480))
        for k, place in enumerate(places)
    ]
    rng = np.random.default_rng(4)
    upright = np.array([[-0.7, 0.0, 0.7], [0.7, 0.0, 0.7], [0.0, 1.0, 0.0]])
    turns = [matrix_from_rodrigues(rng.uniform(-0.5, 0.5, 3)) @ upright for _ in range(boards)]
    rotations = np.array([np.linalg.qr(turn)[0] for turn in turns])
    rotations *= np.linalg.det(rotations)[:, None, None]
    places = rng.uniform(-0.4, 0.4, (boards, 3)) + np.array([0, 0, 1])
    bent = [replace(camera, distortion=np.array(distortion)) for camera in cameras]
    return BundleScene(tuple(bent), rotations, places)


def photographed(truth: BundleScene, seed: int, noise_px: float = NOISE_PX) -> Observations:
    """All corners of all boards, with noise."""
    rng = np.random.default_rng(seed)
    rows = []
    for c, camera in enumerate(truth.cameras):
        for b, (turn, place) in enumerate(zip(truth.rotations, truth.translations, strict=True)):
            pixels, _ = camera.project(CORNERS @ turn.T + place)
            rows.append((np.full(len(CORNERS), c), np.full(len(CORNERS), b), CORNERS, pixels))
    camera, board, points, pixels = (np.concatenate(column) for column in zip(*rows, strict=True))
    return Observations(camera, board, points, pixels + noise_px * rng.normal(size=pixels.shape))


def deviation(found: Camera, true: Camera) -> np.ndarray:
    """Rotation vector and translation (6,) that lead from the found pose to the true one."""
    turn = true.rotation @ found.rotation.T
    return np.r_[rodrigues_from_matrix(turn), true.translation - turn @ found.translation]


def surprise(adjusted: Adjustment, truth: BundleScene) -> list[float]:
    """Squared errors of the cameras' poses in units of their covariances, 6 on average."""
    values = []
    for k in (1, 2):
        error = deviation(adjusted.scene.cameras[k], truth.cameras[k])
        values.append(float(error @ np.linalg.solve(adjusted.covariances[k], error)))
    return values


def test_errors_are_as_large_as_is_stated():
    truth = scene()
    values = [
        surprise(adjust(truth, photographed(truth, seed), "poses"), truth) for seed in range(6)
    ]
    assert 0.6 < np.mean(values) / 6 < 1.5


def test_errors_that_the_corners_of_a_board_have_in_common_are_stated():
    """Each picture is bent in a way of its own, as a board that is held in the hands."""
    truth = scene(12, (0.0, 0.0, 0.0, 0.0))
    one = BundleScene(truth.cameras[:1], truth.rotations, truth.translations)
    squares = []
    for seed in range(3):
        seen = photographed(one, seed, 0.05)
        bends = np.random.default_rng(seed).normal(0, 6, (12, 2))[seen.board]
        offset = CORNERS[:, :2][np.tile(np.arange(len(CORNERS)), 12)]
        pixels = seen.pixels + bends * (offset**2).sum(axis=1, keepdims=True)
        found = adjust(one, replace(seen, pixels=pixels), "lenses")
        error = np.log(np.diag(found.scene.cameras[0].matrix)[:2] / 600)
        squares.append(error**2 / np.diag(found.covariances[0])[:2])
    assert 0.3 < np.mean(squares) < 3  # 12 if corners counted as independent


def test_a_few_corners_that_were_taken_for_others_do_no_harm():
    truth = scene()
    seen = photographed(truth, 0)
    seen.pixels[::40] += (60.0, -45.0)
    found = adjust(truth, seen, "poses").scene
    for camera, true in zip(found.cameras[1:], truth.cameras[1:], strict=True):
        millimetres, degrees = pose_difference(camera, true)
        assert millimetres < 10 and degrees < 0.3


@pytest.mark.parametrize("fixed", ["camera", "board"])
def test_what_defines_the_world_stays(fixed):
    truth = scene()
    found = adjust(truth, photographed(truth, 1), "poses", fixed)
    moved = [
        np.abs(deviation(found.scene.cameras[0], truth.cameras[0])).max() > 1e-9,
        np.abs(found.scene.translations[0] - truth.translations[0]).max() > 1e-9,
    ]
    assert moved == [fixed == "board", fixed == "camera"]
    assert found.covariances[0].any() == (fixed == "board")


def test_tangential_terms_are_small_where_little_is_seen():
    """A single board in the middle, seen by one camera: its lens could have any of them."""
    truth = scene(1, (0.0, 0.0, 0.0, 0.0))
    one = BundleScene(truth.cameras[:1], truth.rotations, truth.translations)
    terms = []
    for seed in range(3):
        found = adjust(one, photographed(one, seed, 1.0), "lenses").scene.cameras[0]
        terms.append(np.abs(found.distortion[2:4]).max())
    assert np.median(terms) < 0.04
