"""Rigs broken in every way that users break them are reported."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from silhouettes import filmed, stage

from calib.agreement import Agreement, agreement, trimmed_mean
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.repair import Repair, explain
from calib.rotation import matrix_from_rodrigues
from calib.tangency import Outline, OutlineTrack, interpolate, main_components

MOMENTS = np.arange(3, 19, 2)
FPS = 10.0
BoardCamera = dict[str, list[np.ndarray]]


@pytest.fixture(scope="module")
def rig() -> Rig:
    return stage(4)


@pytest.fixture(scope="module")
def film(rig) -> BoardCamera:
    return filmed(rig, 22)


def at(film: BoardCamera, moments=MOMENTS) -> list[dict[str, np.ndarray]]:
    return [{name: masks[moment] for name, masks in film.items()} for moment in moments]


def tracks(rig: Rig, film: BoardCamera) -> dict[str, OutlineTrack]:
    return {
        camera.name: OutlineTrack.from_masks(
            camera, np.arange(len(film[camera.name])) / FPS, film[camera.name]
        )
        for camera in rig
    }


def check(rig: Rig, moments: list[dict[str, np.ndarray]]) -> Agreement:
    times = np.arange(len(moments), dtype=float)
    seen = [
        OutlineTrack.from_masks(camera, times, [moment[camera.name] for moment in moments])
        for camera in rig
    ]
    return agreement(seen, times)


def explained(rig: Rig, film: BoardCamera) -> Repair:
    """The one explanation."""
    seen = tracks(rig, film)
    (repair,) = explain(seen, agreement(list(seen.values()), MOMENTS / FPS), MOMENTS / FPS, 5 / FPS)
    return repair


def bumped(rig: Rig, name: str, degrees: float, shift_m=(0, 0, 0), axis=(0.6, 0.8, 0)) -> Rig:
    turn = matrix_from_rodrigues(np.radians(degrees) * np.array(axis))
    moved = [
        (
            replace(
                one,
                rotation=turn @ one.rotation,
                translation=turn @ one.translation + np.array(shift_m),
            )
            if one.name == name
            else one
        )
        for one in rig
    ]
    return Rig(tuple(moved))


def boxed(masks: list[np.ndarray], height: int) -> list[np.ndarray]:
    """Scales pictures down to a height, between black bars."""
    top = (masks[0].shape[0] - height) // 2
    pictures = []
    for mask in masks:
        picture = np.zeros_like(mask)
        small = cv2.resize(
            mask.astype(np.uint8) * 255, (mask.shape[1], height), interpolation=cv2.INTER_AREA
        )
        picture[top : top + height] = small > 127
        pictures.append(picture)
    return pictures


def test_a_right_rig_agrees(rig, film):
    result = check(rig, at(film))
    assert result.agrees
    assert result.culprits == ()
    assert result.error_px < 0.3
    assert "all 4 cameras agree" in result.summary


def test_scaled_down_silhouettes_can_be_used(rig, film):
    def small(mask: np.ndarray) -> np.ndarray:
        return (
            cv2.resize(mask.astype(np.uint8) * 255, (160, 120), interpolation=cv2.INTER_AREA) > 127
        )

    result = check(
        rig, [{name: small(mask) for name, mask in moment.items()} for moment in at(film)]
    )
    assert result.agrees
    assert result.error_px < 0.5


@pytest.mark.parametrize("name", ["cam_0", "cam_1", "cam_2", "cam_3"])
def test_a_camera_bumped_by_a_degree_is_named_and_repaired(rig, film, name):
    wrong = bumped(rig, name, 1)
    result = check(wrong, at(film))
    assert result.culprits == (name,)
    assert f"{name} (" in result.summary
    repair = explained(wrong, film)
    assert repair.kind == "turned"
    assert (
        f"{name} was turned by about 1." in repair.summary
        or f"{name} was turned by about 0.9" in repair.summary
    )
    assert pose_difference(repair.after, rig[name])[1] < 0.2
    assert repair.after_px < 0.3
    assert check(repair.rig(wrong), at(film)).agrees


def test_a_camera_moved_is_repaired(rig, film):
    wrong = bumped(rig, "cam_1", 4, (0.3, 0.1, -0.2))
    repair = explained(wrong, film)
    assert repair.kind == "moved"
    millimetres, degrees = pose_difference(repair.after, rig["cam_1"])
    assert millimetres < 60
    assert degrees < 1.2
    there, back = (
        pose_difference(wrong["cam_1"], rig["cam_1"]),
        pose_difference(wrong["cam_1"], repair.after),
    )
    assert back[0] == pytest.approx(there[0], abs=60)


def test_swapped_videos_are_reported(rig, film):
    repair = explained(rig, film | {"cam_0": film["cam_1"], "cam_1": film["cam_0"]})
    assert repair.summary == "the videos of cam_0 and cam_1 are swapped"
    assert repair.after_px < 0.3


@pytest.mark.parametrize("frames", [3, -2])
def test_a_video_out_of_step_is_reported(rig, film, frames):
    shifted = film | {
        "cam_2": [film["cam_2"][int(np.clip(step - frames, 0, 21))] for step in range(22)]
    }
    repair = explained(rig, shifted)
    assert repair.kind == "out of step"
    assert repair.offset_s * FPS == pytest.approx(frames, abs=0.15)
    assert ("late" if frames > 0 else "early") in repair.summary


def test_a_letterboxed_video_is_reported(rig, film):
    repair = explained(rig, film | {"cam_3": boxed(film["cam_3"], 180)})
    assert repair.kind == "scaled"
    shape = np.diag(repair.after.matrix)[:2] / np.diag(rig["cam_3"].matrix)[:2]
    np.testing.assert_allclose(shape, [1, 0.75], atol=0.02)


@pytest.mark.slow
def test_bad_silhouettes_are_distinguished_from_bad_cameras(rig, film):
    shadowed, headless = ([mask.copy() for mask in film["cam_1"]] for _ in range(2))
    for mask, other in zip(shadowed, headless, strict=True):
        row, column = np.nonzero(mask)
        mask[row.max() - 12 : row.max() + 6, column.min() : column.max() + 60] = True
        other[: row.min() + 30] = False
    for broken in (shadowed, headless):
        repair = explained(rig, film | {"cam_1": broken})
        assert repair.camera == "cam_1"
        assert repair.kind == "unexplained"
        assert "look at its silhouettes" in repair.summary


def test_two_bad_cameras_of_six(film):
    rig = stage(6)
    wrong = bumped(bumped(rig, "cam_2", 2), "cam_4", 3)
    result = check(wrong, at(filmed(rig, 19), MOMENTS[:6]))
    assert result.culprits == ("cam_2", "cam_4")
    assert "do not agree" in result.summary


def test_flicker_far_from_the_body_does_not_matter(rig, film):
    rng = np.random.default_rng(0)
    noisy = [
        {name: mask | (rng.random(mask.shape) < 0.002) for name, mask in moment.items()}
        for moment in at(film)
    ]
    assert check(rig, noisy).agrees


def test_two_cameras_can_be_checked_but_not_distinguished(rig, film):
    pair = rig.select(["cam_0", "cam_1"])
    assert check(pair, at(film)).summary.startswith("both cameras agree")
    result = check(bumped(pair, "cam_0", 3), at(film))
    assert not result.agrees
    assert result.culprits == ()
    assert "only a third could tell" in result.summary


def test_what_cannot_be_checked_is_refused(rig, film):
    with pytest.raises(InputError, match="one camera alone"):
        check(rig.select(["cam_0"]), at(film))
    empty = [moment | {"cam_2": np.zeros_like(moment["cam_2"])} for moment in at(film)]
    with pytest.raises(InputError, match="cam_2 never sees somebody whole"):
        check(rig, empty)
    for error, mask in [(TypeError, np.zeros((3, 3))), (ValueError, np.zeros((3, 3), bool))]:
        with pytest.raises(
            error, match=r"cam_0: silhouette must be \(240, 320\) bool, got \(3, 3\)"
        ):
            check(rig, [at(film)[0] | {"cam_0": mask}])


def test_a_body_that_leaves_the_picture_is_not_compared_there(rig, film):
    cut = [mask.copy() for mask in film["cam_0"]]
    for mask in cut:
        mask[: np.nonzero(mask)[0].max() - 60] = False
    rolled = [np.roll(mask, 239 - np.nonzero(mask)[0].max(), axis=0) for mask in cut]
    track = OutlineTrack.from_masks(rig["cam_0"], np.arange(22) / FPS, rolled)
    baseline = rig["cam_1"].center_m - rig["cam_0"].center_m
    angle, _ = track.tangent_angles(baseline / np.linalg.norm(baseline), track.toward_body())
    assert np.isnan(angle).any(axis=1).mean() > 0.5
    assert np.isfinite(angle).any()


def test_the_parts(rig, film):
    outline = Outline.from_mask(rig["cam_0"], film["cam_0"][4])
    row, column = np.nonzero(film["cam_0"][4])
    assert outline is not None
    np.testing.assert_allclose(
        outline.pixels.min(0), [column.min() - 0.5, row.min() - 0.5], atol=0.01
    )
    np.testing.assert_allclose(
        outline.pixels.max(0), [column.max() + 0.5, row.max() + 0.5], atol=0.01
    )
    assert Outline.from_mask(rig["cam_0"], np.zeros((240, 320), bool)) is None
    speckled = film["cam_0"][4].copy()
    speckled[0, 0] = True
    np.testing.assert_array_equal(main_components(speckled), film["cam_0"][4])
    values = interpolate(
        np.array([0.0, 1, 2]), np.array([[0.0], [10], [np.nan]]), np.array([-0.5, 0, 0.25, 1, 1.5])
    )
    np.testing.assert_array_equal(values[:, 0], [np.nan, 0, 2.5, 10, np.nan])
    assert trimmed_mean(np.array([1, -1, 1, -1, 100.0, np.nan])) == 1
