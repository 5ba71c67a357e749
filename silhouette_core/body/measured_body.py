"""Bodies made from measurements: those taken on the mesh are the wanted ones.

A template is warped at waist, hips and thighs, then deformed along the axes of the shape space.
Eight parameters answer eight measurements; a measurement that is not known leaves its parameter
where the template, or the other parameters, suggest.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares

from calib.checks import FloatArray
from calib.errors import InputError
from silhouette_core.body.mesh_measurements import BodyMeasurements, TapeMeasure
from silhouette_core.body.model import BodyModel, read_template
from silhouette_core.body.population import check_measurements
from silhouette_core.body.sizes import SHAPE_AXES, BodySizes
from silhouette_core.tuning import MEASURING

_AXES = {axis.name: k for k, axis in enumerate(SHAPE_AXES)}
# Parameters: the axes that each moves, and by how much, per cent; the last four are changes of the
# template.
_PARAMETERS: tuple[dict[str, int], ...] = (
    {"trunk_length": 100},
    {"thigh_length": 100, "shin_length": 100},
    {"upper_arm_length": 100, "forearm_length": 100, "hand_length": 70},
    {"shoulder_width": 100},
    {},
    {},
    {},
    dict(upper_arm_girth=80, forearm_girth=70, hand_girth=20, shin_girth=75, neck_girth=50),
)
_TRUNK, _LEGS, _ARMS, _SHOULDERS, _CHEST, _WAIST, _HIPS, _LIMBS = range(len(_PARAMETERS))
_MEASURED = tuple(
    "stature_m leg_length_m arm_length_m shoulder_breadth_m chest_girth_m waist_girth_m hip_girth_m"
    " mass_kg".split()
)
"""The measurement that each parameter answers."""
# Bounds of the parameters, per cent.
_LOWEST = np.array([-45, -45, -45, -60, -55, -50, -50, -50]) / 100
_HIGHEST = np.array([80, 60, 80, 100, 120, 150, 150, 90]) / 100
_CHANGES = slice(_CHEST, _LIMBS + 1)
_DIGITS = 8
# Heads grow early: a child of 1.1 m has a head that is larger by so much against its stature than
# an adult's (Snyder et al., Anthropometry of Infants, Children, and Youths to Age 18, 1977: head
# breadth and length at six years are some 92 % of an adult's; recalled, not looked up).
_CHILD_M, _ADULT_M = 110 / 100, 160 / 100
_CHILD_HEAD = {"head_length": 30, "head_girth": 36, "neck_girth": 12, "foot_length": 2}  # per cent


def body_from_measurements(wanted: BodyMeasurements, sex: str = "unknown") -> BodyModel:
    """Body whose measurements, taken on its mesh, are the wanted ones; its `sizes` and `shape` make
    it again. Raises InputError where a measurement is no person's, or no body has all of them.

    Args:
        wanted: the stature, and what else is known.
        sex: "male", "female" or "unknown", which takes the man's template.
    """
    check_measurements(wanted, sex)
    family = _family("female" if sex == "female" else "male")
    scale = wanted.stature_m / family.stature_m
    powers = {name: 3 if name == "mass_kg" else 1 for name in _MEASURED}
    # Solved at the template's size.
    targets = {name: value / scale ** powers[name] for name, value in wanted.known().items()}
    head = _head(wanted.stature_m)
    solution = least_squares(
        family.residuals,
        np.zeros(len(_PARAMETERS)),
        bounds=(_LOWEST, _HIGHEST),
        args=(targets, head),
        xtol=1e-9,
        ftol=1e-12,
        diff_step=1e-4,
        max_nfev=60,
    )
    parameters = np.round(solution.x, _DIGITS) + 0.0
    measured = family.measured(parameters, head).known()
    apart = {name: abs(measured[name] / value - 1) for name, value in targets.items()}
    if max(apart.values()) > MEASURING.tolerance:
        worst = max(apart, key=lambda name: (name != "stature_m", apart[name]))
        raise _no_body(worst, wanted, measured[worst] * scale ** powers[worst])
    sizes = BodySizes(
        wanted.stature_m, measured["chest_girth_m"] * scale, sex, *parameters[_CHANGES].tolist()
    )
    return BodyModel.from_sizes(sizes).reshaped(_shape(parameters) + head)


def _no_body(name: str, wanted: BodyMeasurements, nearest: float) -> InputError:
    unit = "kg" if name.endswith("_kg") else "m"
    return InputError(
        f"no body has all these measurements: {name} {wanted.known()[name]:g} does not fit the"
        f" others (the nearest body has {nearest:.4g} {unit}): check it, or leave it out"
    )


def _shape(parameters: FloatArray) -> FloatArray:
    """Deviations (20,) along the shape axes."""
    shape = np.zeros(len(SHAPE_AXES))
    for value, axes in zip(parameters, _PARAMETERS, strict=True):
        for name, factor in axes.items():
            shape[_AXES[name]] += factor / 100 * value
    return shape


def _head(stature_m: float) -> FloatArray:
    """Deviations (20,) that give a child its head."""
    young = float(np.clip((_ADULT_M - stature_m) / (_ADULT_M - _CHILD_M), 0, 1.2))
    shape = np.zeros(len(SHAPE_AXES))
    for name, deviation in _CHILD_HEAD.items():
        shape[_AXES[name]] = young * (deviation / 100)
    return shape


@dataclass(frozen=True, eq=False)
class _Family:
    """All bodies of a template: linear in the shape, and in the warp."""

    stature_m: float  #: of the template.
    tape: TapeMeasure  #: takes the measurements.
    #: shape space of the template, and its changes per unit of each of its changes.
    spaces: tuple[tuple[FloatArray, FloatArray], ...]
    joints_m: FloatArray  #: (27, 3) of the template.
    joints_change: FloatArray  #: (20, 27, 3) along the shape axes.

    def measured(self, parameters: FloatArray, head: FloatArray) -> BodyMeasurements:
        """Measurements of a body of the template's size."""
        shape = _shape(parameters) + head
        warp = (1.0, *parameters[_CHANGES])
        vertices = sum(
            factor * (rest + np.tensordot(shape, change, 1))
            for factor, (rest, change) in zip(warp, self.spaces, strict=True)
        )
        joints = self.joints_m + np.tensordot(shape, self.joints_change, 1)
        return self.tape.measure(np.asarray(vertices), joints)

    def residuals(
        self, parameters: FloatArray, targets: dict[str, float], head: FloatArray
    ) -> FloatArray:
        """(8,) relative differences of known measurements, and of the rest from what is usual."""
        measured = self.measured(parameters, head).known()
        p = parameters
        chest = 0.0 if "hip_girth_m" not in targets else p[_HIPS]
        chest = p[_WAIST] if "waist_girth_m" in targets else chest
        girth = (p[_CHEST] + p[_WAIST] + p[_HIPS]) / 3
        limbs = MEASURING.limb_slope * girth
        usual = (0.0, p[_TRUNK], p[_LEGS], 0.0, chest, p[_CHEST], p[_CHEST], limbs)
        return np.array(
            [
                measured[name] / targets[name] - 1 if name in targets else p[k] - usual[k]
                for k, name in enumerate(_MEASURED)
            ]
        )


@lru_cache(maxsize=2)
def _family(sex: str) -> _Family:
    body = read_template(sex)
    spaces = [(body.space.vertices_m, body.space.vertices_change)]
    for change in range(4):
        first, second, third, fourth = np.eye(4)[change].tolist()
        warped = body.warped((first, second, third, fourth)).space
        spaces.append(
            (
                warped.vertices_m - body.space.vertices_m,
                warped.vertices_change - body.space.vertices_change,
            )
        )
    return _Family(
        float(np.ptp(body.vertices_m[:, 2])),
        TapeMeasure.of(body),
        tuple(spaces),
        body.space.joints_m,
        body.space.joints_change,
    )
