"""How measurements are spread over people of a stature: what is usual, and what is absurd.

Means and standard deviations over stature. Adults, at 1.756 m (men) and 1.629 m (women): ANSUR II
(Gordon et al., 2012 Anthropometric Survey of U.S. Army Personnel: Methods and Summary Statistics,
NATICK/TR-15/007, 2014), tables of stature, chest circumference, waist circumference (omphalion),
buttock circumference, biacromial breadth, crotch height and weight, of 4082 men and 1986 women.
Children, at 1.10 m: Snyder et al., Anthropometry of Infants, Children, and Youths to Age 18 for
Product Safety Design (UM-HSRI-77-17, 1977), ages 5 to 6. Both were recalled when this was written
and rounded, and could not be compared with the printed tables; arm lengths, measured to joint
centres, are those of the templates. Between and beyond these statures ratios are interpolated.
"""

import numpy as np

from calib.errors import InputError
from silhouette_core.body.mesh_measurements import BodyMeasurements
from silhouette_core.body.sizes import BodySizes
from silhouette_core.tuning import MEASURING

# Stature, then mean and standard deviation over stature (mass over stature cubed) there, in
# thousandths: of a metre, of the stature, of kg/m³.
_ROWS = {
    "male": {
        "chest_girth_m": ((1100, 518, 27), (1756, 602, 50)),
        "waist_girth_m": ((1100, 482, 33), (1756, 536, 64)),
        "hip_girth_m": ((1100, 536, 36), (1756, 581, 43)),
        "arm_length_m": ((1100, 312, 12), (1756, 320, 12)),
        "leg_length_m": ((1100, 430, 16), (1756, 482, 18)),
        "shoulder_breadth_m": ((1100, 220, 10), (1756, 237, 11)),
        "mass_kg": ((1100, 14300, 1700), (1756, 15800, 2500)),
    },
    "female": {
        "chest_girth_m": ((1100, 509, 27), (1629, 581, 51)),
        "waist_girth_m": ((1100, 477, 33), (1629, 528, 61)),
        "hip_girth_m": ((1100, 541, 36), (1629, 627, 47)),
        "arm_length_m": ((1100, 308, 12), (1629, 310, 12)),
        "leg_length_m": ((1100, 430, 16), (1629, 474, 18)),
        "shoulder_breadth_m": ((1100, 218, 10), (1629, 224, 11)),
        "mass_kg": ((1100, 14100, 1800), (1629, 15700, 2500)),
    },
}
# Girths grow less than statures do: those of people so tall, over the adults' mean's. By eye.
_TALL_M, _TALL_GIRTH = 2100 / 1000, 920 / 1000
_ADULTS = {"male": (17560, 686), "female": (16290, 642)}  # statures, tenths of a millimetre


def usual_range(name: str, stature_m: float, sex: str) -> tuple[float, float]:
    """Mean and standard deviation of a measurement, in its unit, over people of a stature.

    Args:
        name: of `BodyMeasurements`, other than stature_m.
        sex: "male", "female" or "unknown", for which the men's are taken.
    """
    power = 3 if name == "mass_kg" else 1
    rows = np.array(_ROWS["female" if sex == "female" else "male"][name]) / 1000
    if name.endswith("girth_m") or name == "mass_kg":
        shrink = _TALL_GIRTH if name != "mass_kg" else _TALL_GIRTH**2
        rows = np.vstack([rows, [_TALL_M, *(rows[-1, 1:] * shrink)]])
    mean, deviation = (float(np.interp(stature_m, rows[:, 0], rows[:, k])) for k in (1, 2))
    return mean * stature_m**power, deviation * stature_m**power


def sex_probability(sex: str, stature_m: float) -> float:
    """Probability that somebody of a stature is "male" or "female", of whom there are as many."""
    men, women = (
        0.5 * ((stature_m - mean) / deviation) ** 2 + np.log(deviation)
        for mean, deviation in (np.array(_ADULTS[label]) / 10_000 for label in ("male", "female"))
    )
    women_odds = float(np.clip(men - women, -MEASURING.most_odds, MEASURING.most_odds))
    return 1 / (1 + np.exp(-women_odds if sex == "female" else women_odds))


def check_measurements(measurements: BodyMeasurements, sex: str) -> None:
    """Checks that each measurement is one that a person of this stature may have. Raises InputError
    where one is not; the line names it and what is usual.
    """
    BodySizes(measurements.stature_m, sex=sex)
    for name, value in measurements.known().items():
        if name == "stature_m":
            continue
        mean, deviation = usual_range(name, measurements.stature_m, sex)
        reach = 6 * deviation  # beyond, it is a mistake
        low, high = max(mean - reach, 0.45 * mean), mean + reach
        if not low <= value <= high:
            unit = "kg" if name == "mass_kg" else "m"
            raise InputError(
                f"{name} {value:g} is not that of a person of {measurements.stature_m:g} m:"
                f" {mean:.3g} {unit} is usual, {low:.3g} to {high:.3g} {unit} is possible; give"
                f" {'kilograms' if unit == 'kg' else 'metres'}"
            )
