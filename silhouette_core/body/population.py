"""How measurements are spread over people of a stature: what is usual, and what is absurd.

Means and standard deviations over stature. Adults, at 1.756 m (men) and 1.629 m (women): ANSUR II
(Gordon et al., 2012 Anthropometric Survey of U.S. Army Personnel: Methods and Summary Statistics,
NATICK/TR-15/007, 2014), tables of stature, chest circumference, waist circumference (omphalion),
buttock circumference, biacromial breadth, crotch height and weight, of 4082 men and 1986 women.
Children, at 1.10 m: Snyder et al., Anthropometry of Infants, Children, and Youths to Age 18 for
Product Safety Design (UM-HSRI-77-17, 1977), ages 5 to 6. Both were recalled when this was written
and rounded, and could not be compared with the printed tables; arm lengths, measured to joint
centres, are those of the templates. Between and beyond these statures the ratios are interpolated
by us.
"""

import numpy as np

from calib.errors import InputError
from silhouette_core.body.mesh_measurements import BodyMeasurements
from silhouette_core.body.sizes import BodySizes

# Stature, then mean and standard deviation over stature (mass over stature cubed) there.
_ROWS: dict[str, dict[str, tuple[tuple[float, float, float], ...]]] = {
    "male": {
        "chest_girth_m": ((1.10, 0.518, 0.027), (1.756, 0.602, 0.050)),
        "waist_girth_m": ((1.10, 0.482, 0.033), (1.756, 0.536, 0.064)),
        "hip_girth_m": ((1.10, 0.536, 0.036), (1.756, 0.581, 0.043)),
        "arm_length_m": ((1.10, 0.312, 0.012), (1.756, 0.320, 0.012)),
        "leg_length_m": ((1.10, 0.430, 0.016), (1.756, 0.482, 0.018)),
        "shoulder_breadth_m": ((1.10, 0.220, 0.010), (1.756, 0.237, 0.011)),
        "mass_kg": ((1.10, 14.3, 1.7), (1.756, 15.8, 2.5)),
    },
    "female": {
        "chest_girth_m": ((1.10, 0.509, 0.027), (1.629, 0.581, 0.051)),
        "waist_girth_m": ((1.10, 0.477, 0.033), (1.629, 0.528, 0.061)),
        "hip_girth_m": ((1.10, 0.541, 0.036), (1.629, 0.627, 0.047)),
        "arm_length_m": ((1.10, 0.308, 0.012), (1.629, 0.310, 0.012)),
        "leg_length_m": ((1.10, 0.430, 0.016), (1.629, 0.474, 0.018)),
        "shoulder_breadth_m": ((1.10, 0.218, 0.010), (1.629, 0.224, 0.011)),
        "mass_kg": ((1.10, 14.1, 1.8), (1.629, 15.7, 2.5)),
    },
}
_ADULTS_M = {"male": (1.756, 0.0686), "female": (1.629, 0.0642)}
_MOST_ODDS = 3.0  # of the logarithm: nobody's sex is certain by the stature, and children have one
_TALL_M = 2.1  # girths grow less than statures do beyond the adults' mean
_TALL_GIRTH = 0.92
_FARTHEST = 6.0  # standard deviations, beyond which a measurement is taken for a mistake


def usual_range(name: str, stature_m: float, sex: str) -> tuple[float, float]:
    """Mean and standard deviation of a measurement over people of a stature.

    Args:
        name: of `BodyMeasurements`, other than stature_m.
        stature_m: of these people.
        sex: "male", "female" or "unknown", for which the men's are taken.

    Returns:
        Both in the measurement's unit.
    """
    power = 3 if name == "mass_kg" else 1
    rows = np.array(_ROWS["female" if sex == "female" else "male"][name])
    if name.endswith("girth_m") or name == "mass_kg":
        shrink = _TALL_GIRTH if name != "mass_kg" else _TALL_GIRTH**2
        rows = np.vstack([rows, [_TALL_M, *(rows[-1, 1:] * shrink)]])
    mean, deviation = (float(np.interp(stature_m, rows[:, 0], rows[:, k])) for k in (1, 2))
    return mean * stature_m**power, deviation * stature_m**power


def sex_probability(sex: str, stature_m: float) -> float:
    """Probability that somebody of a stature is "male" or "female", of whom there are as many."""
    men, women = (
        0.5 * ((stature_m - mean) / deviation) ** 2 + np.log(deviation)
        for mean, deviation in (_ADULTS_M["male"], _ADULTS_M["female"])
    )
    women_odds = float(np.clip(men - women, -_MOST_ODDS, _MOST_ODDS))
    return 1 / (1 + np.exp(-women_odds if sex == "female" else women_odds))


def check_measurements(measurements: BodyMeasurements, sex: str) -> None:
    """Checks that each measurement is one that a person of this stature may have.

    Raises:
        InputError: one is not; the line names it and what is usual.
    """
    BodySizes(measurements.stature_m, sex=sex)
    for name, value in measurements.known().items():
        if name == "stature_m":
            continue
        mean, deviation = usual_range(name, measurements.stature_m, sex)
        low, high = max(mean - _FARTHEST * deviation, 0.45 * mean), mean + _FARTHEST * deviation
        if not low <= value <= high:
            unit = "kg" if name == "mass_kg" else "m"
            raise InputError(
                f"{name} {value:g} is not that of a person of {measurements.stature_m:g} m:"
                f" {mean:.3g} {unit} is usual, {low:.3g} to {high:.3g} {unit} is possible; give"
                f" {'kilograms' if unit == 'kg' else 'metres'}"
            )
