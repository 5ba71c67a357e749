"""Turned and late cameras, found by the silhouettes of a recording."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from calib.camera import Rig
from calib.extrinsics import pose_difference
from calib.rotation import matrix_from_rodrigues
from tests.sources import figure_masks, ring
from voxelpose.multiview.silhouettes.camera_repair import RepairedCameras, repair_cameras
from voxelpose.multiview.silhouettes.mask_store import MaskStore

FRAMES, FPS = 40, 25.0


def rig_of(count: int) -> Rig:
    # On two heights, or four cameras on one circle would hardly see each other's roll.
    raised = [
        replace(camera, translation=camera.translation - camera.rotation @ (0, 0, 0.5 * (k % 2)))
        for k, camera in enumerate(ring(count, (320, 240)))
    ]
    return Rig(tuple(raised))


def film_of(rig: Rig) -> list[list[np.ndarray]]:
    """Silhouettes of every frame, one per camera."""
    films = [figure_masks(camera, range(FRAMES)) for camera in rig]
    return [list(masks) for masks in zip(*films, strict=True)]


@pytest.fixture(scope="module")
def rig() -> Rig:
    return rig_of(4)


@pytest.fixture(scope="module")
def film(rig) -> list[list[np.ndarray]]:
    return film_of(rig)


def turned(rig: Rig, degrees: float) -> Rig:
    """The rig with its third camera turned about its centre."""
    turn = matrix_from_rodrigues(np.radians(degrees) * np.array([0.6, 0.8, 0]))
    third = rig.cameras[2]
    third = replace(third, rotation=turn @ third.rotation, translation=turn @ third.translation)
    return Rig((*rig.cameras[:2], third, *rig.cameras[3:]))


def checked(rig: Rig, film: list[list[np.ndarray]], *, repair: bool = True) -> RepairedCameras:
    with closing(MaskStore([camera.size for camera in rig], len(film))) as store:
        for t, masks in enumerate(film):
            store.put(t, masks)
        return repair_cameras(rig, store, np.arange(len(film)) / FPS, FPS, put_right=repair)


def late(film: list[list[np.ndarray]], frames: int) -> list[list[np.ndarray]]:
    """The third camera's pictures come late."""
    return [
        [*masks[:2], film[int(np.clip(t - frames, 0, FRAMES - 1))][2], *masks[3:]]
        for t, masks in enumerate(film)
    ]


def test_cameras_that_agree_are_left_alone(rig, film):
    result = checked(rig, film)
    assert (result.rig, result.late_frames, result.words) == (rig, {}, ())


def test_a_turned_camera_is_put_right(rig, film):
    name = rig.names[2]
    result = checked(turned(rig, 1.5), film)
    assert pose_difference(result.rig[name], rig[name])[1] < 0.3
    assert result.words[0].startswith(f"{name} was turned by about 1.")
    assert "put right" in result.words[0]
    for other in rig.names[:2]:
        assert result.rig[other] is rig[other]


def test_a_camera_that_misses_limbs_keeps_no_other_from_being_put_right():
    rig = rig_of(5)
    film = film_of(rig)
    for t, masks in enumerate(film):  # now of one side of the body, now of the other
        left, *_, right = np.flatnonzero(masks[4].any(axis=0))
        masks[4][:, slice(0, left + 20) if t % 2 else slice(right - 20, None)] = False
    result = checked(turned(rig, 1.5), film)
    name = rig.names[2]
    assert pose_difference(result.rig[name], rig[name])[1] < 0.3
    assert result.words[0].startswith(f"{name} was turned by about 1.")
    assert result.rig.cameras[4] is rig.cameras[4]


def test_a_late_camera_is_put_in_step(rig, film):
    result = checked(rig, late(film, 3))
    assert result.late_frames == {rig.names[2]: 3}
    assert "late" in result.words[0]


def test_nothing_is_changed_unless_it_is_wanted(rig, film):
    wrong = turned(rig, 1.5)
    result = checked(wrong, film, repair=False)
    assert result.rig is wrong and "--repair auto" in result.words[0]


def test_a_large_turn_is_told_but_not_put_right(rig, film):
    wrong = turned(rig, 8)
    result = checked(wrong, film)
    assert result.rig is wrong
    assert "calibrate check" in result.words[0]


def test_of_three_cameras_none_is_put_right(rig, film):
    wrong = Rig(turned(rig, 2).cameras[:3])
    result = checked(wrong, [masks[:3] for masks in film])
    assert result.rig is wrong and result.words


@pytest.mark.parametrize("frames", [2, -3])
def test_silhouettes_are_put_in_step(frames):
    rng = np.random.default_rng(0)
    given = [[rng.random((5, 11)) < 0.5, rng.random((4, 8)) < 0.5] for _ in range(6)]
    with closing(MaskStore([(11, 5), (8, 4)], 6)) as store:
        for t, masks in enumerate(given):
            store.put(t, masks)
        store.advance([frames])
        for t in range(6):
            first, second = store[t]
            np.testing.assert_array_equal(first, given[min(max(t + frames, 0), 5)][0])
            np.testing.assert_array_equal(second, given[t][1])
