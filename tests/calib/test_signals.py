"""Clock offsets from signals, without a calibration."""

import numpy as np
import pytest

from calib.errors import InputError
from calib.signals import (
    Correlogram,
    Signal,
    SignalSettings,
    correlogram,
    joint_correlation,
    masked_correlation,
    offsets_from_signals,
    sampled,
)

BEGIN_S = {"cam_1": 1.3, "cam_2": 0.0, "cam_3": 2.11, "cam_4": 0.4}
RATES = {"cam_1": 25.0, "cam_2": 30.0, "cam_3": 60.0, "cam_4": 12.0}
TRUE_S = np.array([BEGIN_S["cam_1"] - begin for begin in BEGIN_S.values()])


def motion(seed: int = 0):
    """Values by time of something that never repeats itself, up to about 1.5 Hz."""
    rng = np.random.default_rng(seed)
    hertz, phase = rng.uniform(0.1, 1.5, 25), rng.uniform(0, 2 * np.pi, 25)
    return lambda time_s: np.sin(2 * np.pi * np.outer(time_s, hertz) + phase).sum(axis=1) / 5


def signals(noise: float = 0.05, seed: int = 0, count: int = 4) -> list[Signal]:
    rng, same = np.random.default_rng(seed), motion(seed)
    made = []
    for name in list(BEGIN_S)[:count]:
        time_s = np.arange(int(15 * RATES[name])) / RATES[name]
        other = rng.normal(size=len(time_s))  # nothing that others see
        seen = same(time_s + BEGIN_S[name]) + noise * rng.normal(size=len(time_s))
        made.append(Signal(name, time_s, np.column_stack([seen, other])))
    return made


@pytest.mark.parametrize("reference", [None, "cam_3"])
def test_offsets_are_found_at_any_rates(reference):
    result = offsets_from_signals(signals(), SignalSettings(4.0), reference)
    assert result.reference == (reference or "cam_1")
    late = TRUE_S - (TRUE_S[2] if reference else 0)
    np.testing.assert_allclose([line.offset_s for line in result.offsets], late, atol=0.004)
    assert [line.camera for line in result.offsets] == list(BEGIN_S)
    assert result.agreed
    assert result.disagreement_s < 0.004
    assert all(line.error_s < 0.004 for line in result.offsets)
    for line in result.offsets:
        assert line.frames == pytest.approx(line.offset_s * RATES[line.camera])
    assert result.offset_s[result.reference] == 0


def test_moments_without_a_value_are_left_out():
    made = signals()
    made[1].values[100:220] = np.nan
    made[2].values[:300] = np.nan
    result = offsets_from_signals(made, SignalSettings(4.0))
    np.testing.assert_allclose([line.offset_s for line in result.offsets], TRUE_S, atol=0.006)


def test_clocks_may_begin_anywhere():
    made = signals()
    made[1] = Signal("cam_2", made[1].time_s + 7.0, made[1].values)
    result = offsets_from_signals(made, SignalSettings(10.0))
    late = TRUE_S + np.array([0, 7.0, 0, 0])
    np.testing.assert_allclose([line.offset_s for line in result.offsets], late, atol=0.004)


def test_signals_are_sampled_at_multiples_of_the_step():
    values = np.ones((5, 2))
    values[2, 1] = np.nan
    even = sampled(Signal("cam_1", 0.105 + np.arange(5) / 10, values), SignalSettings(1.0, 0.05))
    np.testing.assert_allclose(even.time_s, np.arange(3, 11) * 0.05)
    assert np.isfinite(even.values[:, 0]).all()
    unknown = (even.time_s > 0.205) & (even.time_s < 0.405)
    assert np.isnan(even.values[:, 1]).tolist() == unknown.tolist()


def test_standard_errors_are_as_large_as_the_noise_makes_them():
    stated, found = [], np.zeros(0)
    for seed in range(10):
        result = offsets_from_signals(signals(1.0, seed), SignalSettings(4.0))
        stated += [line.error_s for line in result.offsets[1:]]
        offsets = [line.offset_s for line in result.offsets[1:]]
        found = np.r_[found, offsets - TRUE_S[1:]]
    ratio = np.sqrt(np.mean(np.square(stated)) / np.mean(np.square(found)))
    assert 0.6 < ratio < 1.8


def test_a_camera_that_measured_something_else_is_named():
    made = signals()
    rng = np.random.default_rng(9)
    made[3] = Signal("cam_4", made[3].time_s, rng.normal(size=made[3].values.shape))
    result = offsets_from_signals(made, SignalSettings(1.0))
    assert "cam_4" in result.unlike + result.ambiguous
    assert not result.agreed


def test_cameras_that_measured_at_different_times_are_named():
    time_s = np.arange(50) / 10
    made = [
        Signal(name, time_s + begin, motion()(time_s + begin)[:, None])
        for name, begin in (("cam_1", 0.0), ("cam_2", 30.0))
    ]
    for most in (0.001, 2.0):
        result = offsets_from_signals(made, SignalSettings(most))
        assert result.unlike == ("cam_1", "cam_2")


def test_what_repeats_itself_is_ambiguous():
    time_s = np.arange(300) / 25
    values = [np.sin(2 * np.pi * (time_s + late))[:, None] for late in (0.0, 0.1)]
    made = [Signal(f"cam_{k + 1}", time_s, value) for k, value in enumerate(values)]
    result = offsets_from_signals(made, SignalSettings(3.0))
    assert result.ambiguous == ("cam_1", "cam_2")
    assert np.isnan(result.disagreement_s)
    near = offsets_from_signals(made, SignalSettings(0.3))
    assert near.agreed
    assert near.offsets[1].offset_s == pytest.approx(-0.1, abs=0.002)


def test_too_few_cameras_are_refused():
    with pytest.raises(InputError, match="one camera alone"):
        offsets_from_signals(signals()[:1], SignalSettings(1.0))
    with pytest.raises(InputError, match="no camera cam_9"):
        offsets_from_signals(signals(), SignalSettings(1.0), "cam_9")


def test_masked_correlation_is_that_of_what_both_know():
    rng = np.random.default_rng(0)
    first, second = rng.normal(size=40), rng.normal(size=25)
    first[5:9] = np.nan
    second[20] = np.nan
    found = masked_correlation(first, second)
    assert found.shape == (64,)
    for row, shift in enumerate(range(-39, 25)):
        a = first[max(0, -shift) :][: 25 - max(0, shift)]
        b = second[max(0, shift) :][: len(a)]
        a = a[: len(b)]
        both = np.isfinite(a) & np.isfinite(b)
        if both.sum() < 6:
            assert np.isnan(found[row])
        else:
            assert found[row] == pytest.approx(np.corrcoef(a[both], b[both])[0, 1], abs=1e-9)


def test_what_correlates_well_counts_most():
    each = np.array([[0.9, 0.0, np.nan], [0.0, -0.8, np.nan]])
    np.testing.assert_allclose(joint_correlation(each), [np.sqrt(1 - np.sqrt(1 - 0.81)), 0, np.nan])


def test_a_peak_lies_between_two_steps():
    offsets_s = np.arange(-50, 51) * 0.01
    curve = Correlogram(offsets_s, 0.9 - 4 * (offsets_s - 0.1234) ** 2)
    peak_s, weight = curve.peak(0.1)
    assert peak_s == pytest.approx(0.1234)
    assert weight == pytest.approx(8 * 0.9 / (1 - 0.81), rel=0.01)
    assert curve.peak(-0.4) == (-0.4, 0.0)


def test_offsets_have_the_sign_of_the_clock():
    settings = SignalSettings(4.0)
    first, second = (sampled(signal, settings) for signal in signals()[:2])
    curve = correlogram(first, second, settings)
    assert curve.offsets_s[np.nanargmax(curve.values)] == pytest.approx(1.3, abs=0.011)
