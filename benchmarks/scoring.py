"""The compiled scoring backend against the one in NumPy."""

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.carving import scene
from benchmarks.cases import Case, Timed, case
from benchmarks.scene import ring, silhouettes
from silhouette_core.image.spans import Spans
from silhouette_core.scoring.backend import Voxels, signed_prefix
from silhouette_core.scoring.cpu import CpuBackend
from silhouette_core.scoring.reference import ReferenceBackend
from voxelpose.carving.carver import carve


@case("voxel overlap, 2000 placements")
def voxel_overlap() -> Case:
    rig, masks, grid = scene(128)
    voxels = Voxels(carve(rig, masks, grid), grid.origin_m, grid.voxel_size_m)
    rng = np.random.default_rng(0)
    points, weights = rng.normal(size=(400, 3)) * (0.05, 0.05, 0.15), np.full(400, 1e-5)
    arguments = (
        voxels,
        points,
        weights,
        Rotation.random(2000, random_state=0).as_matrix(),
        rng.normal(size=(2000, 3)) * 0.2 + (0, 0, 1.2),
    )
    return _same(
        Timed(lambda _: CpuBackend().voxel_overlap(*arguments), repeats=5),
        Timed(lambda _: ReferenceBackend().voxel_overlap(*arguments)),
    )


@case("silhouette distance, 2000 poses")
def span_distance() -> Case:
    (camera,) = ring(1, (320, 240))
    mask = silhouettes(ring(1, (320, 240)))[0]
    shifts = np.random.default_rng(0).integers(-30, 30, (2000, 2))
    library = [np.roll(mask, tuple(shift), (0, 1)) for shift in shifts]
    spans = Spans.from_masks(library)
    weights = np.ones((camera.size[1], camera.size[0]))
    prefix, base = signed_prefix(mask, weights)
    # In float32, as one would store such weights.
    light = weights.astype(np.float32)
    dense = Timed(lambda _: np.array([light[mask ^ one].sum(dtype=np.float64) for one in library]))
    ours = Timed(lambda _: CpuBackend().span_distance(prefix, base, spans), repeats=20)
    return _same(ours, dense, "XOR of the images in NumPy")


def _same(ours: Timed, reference: Timed, name: str = "NumPy") -> Case:
    """Makes a case whose results must be equal."""
    return Case(
        ours, reference, name, lambda a, b: "" if np.allclose(a, b) else "the results differ"
    )
