"""Files of a person's body, body.toml.

    format = "voxelpose body 1"
    sex = "male"

    [measurements]      # of the person; only the stature must be known
    stature_m = 1.78
    waist_girth_m = 0.82

    [standard_errors]   # optional: of the measurements, told and not read
    waist_girth_m = 0.02

    [template]          # optional: changes of the template, see `template_warp`
    waist_change = 0.06

    [shape]             # optional: deviations along the axes of `sizes.SHAPE_AXES`
    thigh_length = 0.02

With [template] or [shape], the body is made from these, at the stature; without them, it is the one
that has the measurements.
"""

from dataclasses import fields
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import tomlkit

from calib.errors import InputError
from calib.storage.atomic import write_whole
from calib.storage.documents import load_text, parse_toml
from silhouette_core.body.measured_body import body_from_measurements
from silhouette_core.body.mesh_measurements import BodyMeasurements, measure_body
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import (
    IS_CLOTHING,
    SHAPE_AXES,
    SHAPE_LIMITS,
    TEMPLATE_CHANGES,
    BodySizes,
)

BODY_FORMAT = "voxelpose body 1"
_LARGEST_BYTES = 100_000
_CHANGES = "chest_change", "waist_change", "hip_change", "thigh_change"
_AXES = tuple(axis.name for axis in SHAPE_AXES)
_DIGITS = 9


class _BodyFile(msgspec.Struct, forbid_unknown_fields=True):
    format: str
    measurements: dict[str, float]
    sex: str = "unknown"
    standard_errors: dict[str, float] = {}
    template: dict[str, float] = {}
    shape: dict[str, float] = {}


def read_body(path: Path) -> BodyModel:
    """Body of a body.toml. Raises InputError where it cannot be read, is no such file, or holds
    what no body has.
    """
    return _made(_checked(parse_toml(load_text(path, _LARGEST_BYTES), path), path), path)


def write_body(body: BodyModel, path: Path, comment: str = "") -> None:
    """Writes a body as body.toml, from which it is made again exactly.

    Args:
        body: one made from the templates. Its measurements are told without its clothes.
        comment: a line at its head.
    """
    document = tomlkit.document()
    if comment:
        document.add(tomlkit.comment(" ".join(comment.split())))
    document["format"] = BODY_FORMAT
    document["sex"] = body.sizes.sex
    taken = measure_body(unclothed(body)).known() | {"stature_m": body.sizes.stature_m}
    document["measurements"] = {name: round(value, _DIGITS) for name, value in taken.items()}
    document["template"] = dict(zip(_CHANGES, body.sizes.changes, strict=True))
    document["shape"] = dict(zip(_AXES, body.shape.tolist(), strict=True))
    write_whole(path, tomlkit.dumps(document))


def unclothed(body: BodyModel) -> BodyModel:
    """The same body without its clothes."""
    return body.reshaped(np.where(IS_CLOTHING, 0.0, body.shape))


def _checked(content: dict[str, Any], path: Path) -> _BodyFile:
    """Contents with the right names and types."""
    if content.get("format") != BODY_FORMAT:
        raise InputError(
            f"{path} is no body file of this version (format {str(content.get('format'))[:40]!r},"
            f" wanted {BODY_FORMAT!r}): write one with voxelpose body make"
        )
    try:
        body_file = msgspec.convert(content, _BodyFile)
    except msgspec.ValidationError as error:
        raise InputError(f"{path}: {error}; correct it") from None
    measures = tuple(field.name for field in fields(BodyMeasurements))
    for table, names, low, high in (
        ("measurements", measures, 0.01, 1000.0),
        ("template", _CHANGES, *TEMPLATE_CHANGES),
        ("shape", _AXES, *SHAPE_LIMITS),
    ):
        for name, value in getattr(body_file, table).items():
            if name not in names:
                raise InputError(
                    f"{path}: [{table}] has no {name[:60]!r}: there are {', '.join(names)}"
                )
            if not low <= value <= high:
                raise InputError(f"{path}: {name} is {value:g}: give {low:g} to {high:g}")
    if "stature_m" not in body_file.measurements:
        raise InputError(f"{path}: [measurements] lacks stature_m: add it, in metres")
    return body_file


def _made(file: _BodyFile, path: Path) -> BodyModel:
    measurements = BodyMeasurements(**file.measurements)
    try:
        if not file.template and not file.shape:
            return body_from_measurements(measurements, file.sex)
        chest = measurements.chest_girth_m
        sizes = BodySizes(measurements.stature_m, chest, file.sex, **file.template)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    shape = np.array([file.shape.get(name, 0.0) for name in _AXES])
    return BodyModel.from_sizes(sizes).reshaped(shape)
