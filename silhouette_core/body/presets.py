"""The 24 bodies of the paper: ten men after JIS L 4004, fourteen women after JIS L 4005.

The sources of every number are told in presets.toml, and what could not be verified.
"""

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from silhouette_core.body.measured_body import body_from_measurements
from silhouette_core.body.mesh_measurements import BodyMeasurements
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes

SOURCES = {"d": "by the designation", "t": "from sellers' tables", "c": "computed by us"}
"""Where a number comes from, by its letter in presets.toml."""
_STANDARDS = {"men": ("male", "JIS L 4004"), "women": ("female", "JIS L 4005")}
_MEASURES = "stature_m", "chest_girth_m", "waist_girth_m", "hip_girth_m"


@dataclass(frozen=True)
class BodyPreset:
    """A body of the paper's."""

    name: str  #: designation of the size.
    sex: str  #: "male" or "female".
    standard: str  #: the standard after which it is named.
    measurements: BodyMeasurements
    sources: Mapping[str, str]  #: For each measurement, by name, where the number is from.

    def body(self) -> BodyModel:
        """The body, made from its measurements."""
        return body_from_measurements(self.measurements, self.sex)


@cache
def body_presets() -> tuple[BodyPreset, ...]:
    """All 24, men first, in the order of presets.toml."""
    text = (Path(__file__).parent / "presets.toml").read_text(encoding="utf-8")
    presets = []
    for group, entries in tomllib.loads(text).items():
        sex, standard = _STANDARDS[group]
        for name, (*centimetres, letters) in entries.items():
            metres = dict(zip(_MEASURES, (round(cm / 100, 4) for cm in centimetres), strict=True))
            sources = {
                measure: SOURCES[letter] for measure, letter in zip(_MEASURES, letters, strict=True)
            }
            presets.append(BodyPreset(name, sex, standard, BodyMeasurements(**metres), sources))
    return tuple(presets)


def body_preset(name: str) -> BodyPreset | None:
    """The preset of a name, in capitals or not; None: there is none."""
    return next((preset for preset in body_presets() if preset.name == name.upper()), None)


def nearest_preset(stature_m: float, chest_m: float | None, sex: str = "unknown") -> BodyPreset:
    """The preset that is closest in stature and chest girth.

    The paper states no measure of closeness: here each difference is divided by the standard
    deviation over the presets that are compared, and the squares are added. Raises InputError where
    a measurement is no person's.

    Args:
        chest_m: chest or bust girth; None: only the stature counts.
        sex: "male", "female" or "unknown", for which all 24 are compared.

    Source: Okada and Stenger, section 7.
    """
    BodySizes(stature_m, chest_m, sex)
    presets = [preset for preset in body_presets() if sex in ("unknown", preset.sex)]
    sizes = np.array([[getattr(p.measurements, name) for name in _MEASURES[:2]] for p in presets])
    wanted = np.array([stature_m, np.nan if chest_m is None else chest_m])
    distance = np.nansum(((sizes - wanted) / sizes.std(axis=0)) ** 2, axis=1)
    return presets[int(distance.argmin())]
