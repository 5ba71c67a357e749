"""Bodies made from measurements, over people from a child of 1.1 m to a man of 2.1 m.

`python -m benchmarks.measured_bodies [COUNT]` draws people at random, makes their bodies, and
prints the largest difference of each measurement, taken on the mesh, from the wanted one; how many
bodies cut themselves at rest; and the seconds a body takes. Of every second person girths and
lengths are drawn independently of each other, each evenly from the 1st to the 99th percentile, and
the mass is left open, since nobody has any mass with any girths.
"""

import argparse
import time
from collections.abc import Mapping, Sequence

import numpy as np

from calib.errors import InputError
from silhouette_core.body.measured_body import body_from_measurements
from silhouette_core.body.mesh_measurements import BodyMeasurements, measure_body
from silhouette_core.body.model import BodyModel
from silhouette_core.body.population import usual_range

STATURES_M: Mapping[str, tuple[float, float]] = {"male": (1.10, 2.10), "female": (1.10, 1.95)}
GIRTHS = "chest_girth_m", "waist_girth_m", "hip_girth_m"
LENGTHS = "arm_length_m", "leg_length_m", "shoulder_breadth_m"
PERCENTILE_99 = 2.326
"""Standard deviations to the 99th percentile."""
# How far a girth follows the person's stoutness, and varies on its own; likewise the mass. By these
# chest, waist and hips correlate by 0.7 in somebody drawn at random (ANSUR II: 0.65 to 0.85).
_SHARED, _OWN = 0.85, 0.55
_MASS_SHARED, _MASS_OWN = 0.9, 0.35


def somebody(
    sex: str, stature_m: float, stoutness: float, own: Sequence[float]
) -> BodyMeasurements:
    """Measurements of a person, each from its 1st to its 99th percentile at this stature.

    Args:
        sex: "male" or "female".
        stature_m: height.
        stoutness: in standard deviations; girths and mass follow it.
        own: 7 deviations, standard normal: of the girths, the lengths and the mass.
    """
    deviations = [_SHARED * stoutness + _OWN * one for one in own[:3]]
    deviations += list(own[3:6])
    deviations.append(_MASS_SHARED * float(np.mean(deviations[:3])) + _MASS_OWN * own[6])
    values = {}
    for name, deviation in zip((*GIRTHS, *LENGTHS, "mass_kg"), deviations, strict=True):
        mean, sigma = usual_range(name, stature_m, sex)
        values[name] = mean + float(np.clip(deviation, -PERCENTILE_99, PERCENTILE_99)) * sigma
    return BodyMeasurements(stature_m, **values)


def anybody(sex: str, stature_m: float, own: Sequence[float]) -> BodyMeasurements:
    """Girths and lengths that need not go together.

    Args:
        sex: "male" or "female".
        stature_m: height.
        own: 6 deviations from what is usual, in standard deviations.
    """
    values = {}
    for name, deviation in zip((*GIRTHS, *LENGTHS), own, strict=True):
        mean, sigma = usual_range(name, stature_m, sex)
        values[name] = mean + deviation * sigma
    return BodyMeasurements(stature_m, **values)


def intersections(body: BodyModel) -> int:
    """Number of pairs of triangles of a body at rest that cut each other."""
    from voxelpose.view.open3d_import import import_open3d

    open3d = import_open3d()
    mesh = open3d.geometry.TriangleMesh(
        open3d.utility.Vector3dVector(body.vertices_m), open3d.utility.Vector3iVector(body.faces)
    )
    return len(np.asarray(mesh.get_self_intersecting_triangles()))


def differences(body: BodyModel, wanted: BodyMeasurements) -> dict[str, float]:
    """Relative differences of what is measured on a body from what was wanted."""
    taken = measure_body(body).known()
    return {name: abs(taken[name] / value - 1) for name, value in wanted.known().items()}


def main() -> None:
    """Prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", nargs="?", type=int, default=400, help="number of people")
    count = parser.parse_args().count
    rng = np.random.default_rng(1)
    worst: dict[str, float] = {}
    cut = refused = 0
    seconds = []
    for k in range(count):
        sex = str(rng.choice(list(STATURES_M)))
        stature = float(rng.uniform(*STATURES_M[sex]))
        wanted = (
            somebody(sex, stature, float(rng.uniform(-2.5, 2.5)), rng.normal(size=7).tolist())
            if k % 2
            else anybody(sex, stature, rng.uniform(-PERCENTILE_99, PERCENTILE_99, 6).tolist())
        )
        start = time.perf_counter()
        try:
            body = body_from_measurements(wanted, sex)
        except InputError as error:
            refused += 1
            print(f"refused: {sex} {error}")
            continue
        seconds.append(time.perf_counter() - start)
        cut += intersections(body) > 0
        for name, difference in differences(body, wanted).items():
            worst[name] = max(worst.get(name, 0.0), difference)
    for name, difference in worst.items():
        print(f"{name:20} {100 * difference:.4f} %")
    print(f"{count} people, {refused} refused, {cut} bodies cut themselves, ", end="")
    print(f"{np.median(seconds):.2f} s a body (median), {max(seconds):.2f} s at most")


if __name__ == "__main__":
    main()
