"""Cameras whose clocks differ."""

import numpy as np
import pytest
from silhouettes import filmed, stage

from calib import synchronise as synchronisation
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.synchronise import outline_signal, synchronise
from calib.tangency import OutlineTrack

FPS = 20.0
TRUE_S = {"cam_0": 0.0, "cam_1": 0.03, "cam_2": -0.05}
SLOPE_PX = 40.0  # px per second of an offset
BEGIN = {"cam_0": 2.0, "cam_1": 0.0, "cam_2": 6.25, "cam_3": 3.5}


@pytest.fixture(scope="module")
def rig() -> Rig:
    return stage(4)


def tracks(rig: Rig, count: int, begin=None, pace=None) -> list[OutlineTrack]:
    film = filmed(rig, count, begin, pace)
    return [
        OutlineTrack.from_masks(
            camera,
            np.arange(len(film[camera.name])) * (pace or {}).get(camera.name, 1.0) / FPS,
            film[camera.name],
        )
        for camera in rig
    ]


@pytest.fixture(scope="module")
def shifted(rig) -> list[OutlineTrack]:
    return tracks(rig, 36, BEGIN)


def expected(reference: str) -> np.ndarray:
    """A camera that began later shows later moments: it is early."""
    return np.array([BEGIN[reference] - begin for begin in BEGIN.values()])


@pytest.mark.parametrize("reference", ["cam_0", "cam_2"])
def test_whole_and_fractional_offsets_are_found(shifted, reference):
    result = synchronise(shifted, 0.6, reference)
    assert result.reference == reference
    np.testing.assert_allclose(
        [line.frames for line in result.offsets], expected(reference), atol=0.1
    )
    assert result.agreed
    assert result.after_px < 0.35 < 1.0 < result.before_px
    assert all(line.error_s * FPS < 0.1 for line in result.offsets)
    assert [line.offset_s for line in result.offsets if line.camera == reference] == [0.0]


def test_cameras_in_step_are_left_so(rig):
    result = synchronise(tracks(rig, 30), 0.5)
    np.testing.assert_allclose([line.frames for line in result.offsets], 0, atol=0.06)


def test_a_camera_of_half_the_rate(rig):
    result = synchronise(tracks(rig, 40, BEGIN, {"cam_1": 2.0}), 0.6)
    late = np.array([line.offset_s for line in result.offsets]) * FPS
    np.testing.assert_allclose(late, expected("cam_0"), atol=0.12)
    assert result.offsets[1].frames == pytest.approx(late[1] / 2)


def test_a_wrong_calibration_is_noticed(rig, shifted):
    turned = rig.select(["cam_2", "cam_3", "cam_0", "cam_1"])
    mixed = [track.with_camera(camera) for track, camera in zip(shifted, turned, strict=True)]
    assert pose_difference(mixed[0].camera, shifted[0].camera)[0] > 1000
    result = synchronise(mixed, 0.6)
    assert not result.agreed
    assert all(np.isnan(line.error_s) for line in result.offsets)


def test_what_cannot_be_synchronised_is_refused(rig, shifted):
    with pytest.raises(InputError, match="one camera alone"):
        synchronise(shifted[:1], 0.5)
    with pytest.raises(InputError, match="no camera cam_9"):
        synchronise(shifted, 0.5, "cam_9")
    still = [
        OutlineTrack(track.camera, track.time_s, track.outlines[:1] * len(track.outlines))
        for track in shifted
    ]
    with pytest.raises(InputError, match="nobody moves in cam_0"):
        synchronise(still, 0.5)
    nobody = OutlineTrack(shifted[0].camera, shifted[0].time_s, (None,) * len(shifted[0].outlines))
    with pytest.raises(InputError, match="cam_0 sees nobody"):
        synchronise([nobody, *shifted[1:]], 0.5)


def test_outlines_move_up_and_down(shifted):
    assert shifted[0].period_s == pytest.approx(1 / FPS)
    signal = outline_signal(shifted[0])
    assert signal.camera == "cam_0"
    assert signal.values.shape == (36, 3)
    top_px = [outline.pixels[:, 1].min() for outline in shifted[0].outlines]
    heights = np.median([np.ptp(outline.pixels[:, 1]) for outline in shifted[0].outlines])
    np.testing.assert_allclose(
        signal.values[10, 0], (top_px[11] - top_px[9]) * FPS / 2 / heights, atol=1e-9
    )


def noisy(monkeypatch, rig, seed: int, noise_px: float, biased: tuple[str, ...] = ()) -> list:
    """Three tracks whose tangency errors grow evenly with the offset, with noise; a pair that is
    biased has its minimum elsewhere.
    """
    rng, noise = np.random.default_rng(seed), {}

    def measured(first, second, moments_s, offset_s):
        names = first.camera.name, second.camera.name
        if names not in noise:
            noise[names] = noise_px * rng.normal(size=(len(moments_s), 2))
        late = offset_s[1] - offset_s[0] - (TRUE_S[names[1]] - TRUE_S[names[0]])
        return SLOPE_PX * (late + 0.1 * (names == biased)) + noise[names][: len(moments_s)]

    monkeypatch.setattr(synchronisation, "tangency", measured)
    time_s = np.arange(90) / FPS
    return [OutlineTrack(camera, time_s, (None,) * 90) for camera in rig.cameras[:3]]


def test_standard_errors_are_as_large_as_the_noise_makes_them(monkeypatch, rig):
    stated, found = [], []
    for seed in range(12):
        given = noisy(monkeypatch, rig, seed, 0.1)
        offsets, errors = synchronisation._refined_offsets(given, np.zeros(3), np.ones(3))
        stated.append(errors[1:])
        found.append(offsets[1:] - [TRUE_S["cam_1"], TRUE_S["cam_2"]])
    ratio = np.sqrt(np.mean(np.square(stated)) / np.mean(np.square(found)))
    assert 0.65 < ratio < 1.5


def test_a_pair_without_weight_decides_nothing(monkeypatch, rig):
    given = noisy(monkeypatch, rig, 0, 0.0, ("cam_1", "cam_2"))
    offsets, _ = synchronisation._refined_offsets(given, np.zeros(3), np.array([1.0, 1.0, 0.0]))
    np.testing.assert_allclose(offsets, list(TRUE_S.values()), atol=1e-6)
