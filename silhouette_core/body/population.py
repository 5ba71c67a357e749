"""How measurements are spread over people of a stature: what is usual, and what is absurd.

population.toml beside this has their means and deviations, and where they come from.
"""

import tomllib
from pathlib import Path

import numpy as np

from calib.errors import InputError
from silhouette_core.body.mesh_measurements import BodyMeasurements
from silhouette_core.body.sizes import BodySizes
from silhouette_core.tuning import MEASURING

_PEOPLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_TALL_M, _TALL_GIRTH = _PEOPLE["tall_m"], _PEOPLE["tall_girth"]


def usual_range(name: str, stature_m: float, sex: str) -> tuple[float, float]:
    """Mean and standard deviation of a measurement, in its unit, over people of a stature.

    Args:
        name: of `BodyMeasurements`, other than stature_m.
        sex: "male", "female" or "unknown", for which the men's are taken.
    """
    power = 3 if name == "mass_kg" else 1
    rows = np.array(_PEOPLE["female" if sex == "female" else "male"][name])
    if name.endswith("girth_m") or name == "mass_kg":
        shrink = _TALL_GIRTH if name != "mass_kg" else _TALL_GIRTH**2
        rows = np.vstack([rows, [_TALL_M, *(rows[-1, 1:] * shrink)]])
    mean, deviation = (float(np.interp(stature_m, rows[:, 0], rows[:, k])) for k in (1, 2))
    return mean * stature_m**power, deviation * stature_m**power


def sex_probability(sex: str, stature_m: float) -> float:
    """Probability that somebody of a stature is "male" or "female", of whom there are as many."""
    men, women = (
        0.5 * ((stature_m - mean) / deviation) ** 2 + np.log(deviation)
        for mean, deviation in (_PEOPLE[label]["stature_m"] for label in ("male", "female"))
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
