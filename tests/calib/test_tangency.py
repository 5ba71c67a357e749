"""Tangent planes of two cameras: signs, clocks and reduced silhouettes."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from silhouettes import filmed, stage

from calib.camera import Rig
from calib.tangency import Outline, OutlineTrack, tangency

FPS = 10.0
COUNT = 14
MOMENTS = np.arange(3, 11) / FPS


@pytest.fixture(scope="module")
def rig() -> Rig:
    """Of two cameras, the second has the finer pixels."""
    first, second = stage(2)
    matrix = second.matrix * np.array([[1.3], [1.3], [1]])
    matrix[:2, 2] = second.matrix[:2, 2]
    return Rig((first, replace(second, matrix=matrix)))


@pytest.fixture(scope="module")
def film(rig) -> dict[str, list[np.ndarray]]:
    return filmed(rig, COUNT)


def track_of(rig: Rig, film: dict[str, list[np.ndarray]], name: str, ahead_s: float = 0.0):
    return OutlineTrack.from_masks(rig[name], np.arange(COUNT) / FPS + ahead_s, film[name])


def test_both_planes_have_the_sign_of_the_outlines_error_and_exchanged_ones_the_opposite(rig, film):
    square = np.ones((7, 7), np.uint8)
    thicker = [cv2.dilate(mask.view(np.uint8), square).view(bool) for mask in film["cam_0"]]
    thick, other = track_of(rig, {"cam_0": thicker}, "cam_0"), track_of(rig, film, "cam_1")
    errors, exchanged = tangency(thick, other, MOMENTS), tangency(other, thick, MOMENTS)
    low, high = np.nanmedian(errors, axis=0)
    # 3 px along the axes, 4.2 px along the diagonals; the mean of the two cameras' pixels.
    assert 2.5 < low < 6 and 2.5 < high < 6
    np.testing.assert_allclose(exchanged[:, ::-1], -errors, atol=1e-6)


def test_a_clock_that_is_ahead_is_corrected(rig, film):
    first, ahead = track_of(rig, film, "cam_0"), track_of(rig, film, "cam_1", 0.2)
    errors = [np.nanmean(np.abs(tangency(first, ahead, MOMENTS, (0.0, s)))) for s in (0.2, -0.2)]
    in_step = tangency(first, track_of(rig, film, "cam_1"), MOMENTS)
    assert errors[0] == pytest.approx(np.nanmean(np.abs(in_step)))
    assert errors[1] > 3 * errors[0]


def test_a_reduced_silhouette_has_the_same_corners(rig):
    camera = rig.cameras[0]
    camera = replace(camera, distortion=np.zeros(0))
    whole = np.zeros(camera.size[::-1], bool)
    whole[40:120, 60:160] = True
    outlines = [Outline.from_mask(camera, mask) for mask in (whole, whole[::4, ::4])]
    for outline in outlines:
        assert outline is not None
        np.testing.assert_allclose(outline.pixels.min(0), [59.5, 39.5], atol=1e-6)
        np.testing.assert_allclose(outline.pixels.max(0), [159.5, 119.5], atol=1e-6)
        np.testing.assert_allclose(outline.middle, [109.5, 79.5], atol=2)


def test_where_something_unknown_hides_the_body_no_plane_is_compared(rig, film):
    unknown = np.zeros_like(film["cam_0"][0])
    unknown[: len(unknown) // 2] = True
    cut = [mask & ~unknown for mask in film["cam_0"]]
    other = track_of(rig, film, "cam_1")

    def errors(hidden: np.ndarray | None) -> np.ndarray:
        track = OutlineTrack.from_masks(rig["cam_0"], np.arange(COUNT) / FPS, cut, hidden)
        return np.abs(tangency(track, other, MOMENTS))

    whole = np.abs(tangency(track_of(rig, film, "cam_0"), other, MOMENTS))
    assert np.nanmax(errors(None)) > 3 * np.nanmax(whole)
    known = errors(unknown)
    assert np.isnan(known).any(axis=1).all()
    assert not np.isfinite(known).any() or np.nanmax(known) < 1.5 * np.nanmax(whole)


def test_what_is_unknown_elsewhere_changes_nothing(rig, film):
    mask = film["cam_0"][0]
    unknown = np.zeros_like(mask)
    unknown[:4, :4] = True
    found, plain = (Outline.from_mask(rig["cam_0"], mask, where) for where in (unknown, None))
    assert found is not None and plain is not None
    np.testing.assert_array_equal(found.pixels, plain.pixels)
    np.testing.assert_array_equal(found.inside, plain.inside)
