"""Distances of a fitted body, and of the hull of its frame, from a scan of the person."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.errors import InputError
from calib.files.fields import METRES
from silhouette_core.body.rigs.closed_surface import MESH_SUFFIXES, read_triangles
from silhouette_core.motion import kinematics
from voxelpose.results import Result
from voxelpose.view.open3d_import import import_open3d
from voxelpose.view.viewer.result_scenes import ResultScenes

Surface = tuple[NDArray[np.float64], NDArray[np.integer]]
"""Vertices (V, 3), m, and triangles (F, 3)."""

_MOST_TRIANGLES = 3_000_000
_POINTS = 20_000  # of each surface that are compared, about a square centimetre each
_FEW_POINTS = 500  # by which the turn to begin with is found
_ALIKE = 3  # times as large as the body, or as small, a scan in the right unit may be


@dataclass(frozen=True)
class SurfaceDistance:
    """Distances of points, spread evenly over one surface, from another surface."""

    mean_mm: float  #: signed: above 0 where the points lie outside of the other surface.
    rms_mm: float  #: root of the mean square.
    p95_mm: float  #: of 95 % of the points, at most, on either side.
    worst_mm: float  #: the largest, on either side.


@dataclass(frozen=True)
class ScanScore:
    """A fitted body against a scan."""

    frame: int  #: number of the frame whose pose is compared.
    body_to_scan: SurfaceDistance
    """Of the body's surface from the scan: what is too large is outside."""
    scan_to_body: SurfaceDistance
    """Of the scan from the body, which also sees what the body lacks."""
    hull_to_scan: SurfaceDistance | None = None
    """Of the carved hull, which no body's proportions bound; None without a hull."""
    scan_to_hull: SurfaceDistance | None = None  #: likewise.
    moved_mm: float = 0
    """How far the scan's middle was moved onto the body; 0 if it was not to be."""
    turned_deg: float = 0  #: by how much it was turned.
    notes: tuple[str, ...] = ()  #: what is missing, in words.


def evaluate_scan(
    result: Path | str,
    scan: Path | str,
    frame: int | None = None,
    unit: Literal["m", "cm", "mm"] = "m",
    align: bool = False,
    recording: Path | None = None,
) -> ScanScore:
    """Compares the fitted body of one frame, and the frame's hull, with a scan of the person.

    Where surfaces of the body cut each other, as at an armpit, the sign may be wrong, and the
    surface within is one, too.

    Args:
        result: a result's folder.
        scan: closed mesh (PLY, STL, OBJ, DAE) in the recording's world, taken in the same pose.
        frame: number of the frame; None: the first that has a pose.
        unit: of the scan's lengths.
        align: whether the scan, which may then be in any upright frame, is moved onto the body
            first; where the body stands is not compared then.
        recording: where the result's recording is now, if it was moved; without it there is no
            hull.

    Raises:
        InputError: open3d is missing, a file cannot be read, the scan is not closed, of another
            unit, or elsewhere, or the frame has no pose.
    """
    open3d = import_open3d()
    motion = Result.open(result).motion
    if not len(motion):
        raise InputError(f"{result} has no pose: nothing can be compared with a scan")
    frame = int(motion.frames[0]) if frame is None else frame
    if frame not in motion.frames:
        first, last = motion.frames[[0, -1]]
        raise InputError(
            f"frame {frame} of {result} has no pose: choose another, from {first} to {last}"
        )
    size_m = float(np.ptp(motion.model.vertices_m, axis=0).max())
    vertices, faces = read_scan(Path(scan), unit, size_m)
    scenes = ResultScenes(result, recording)
    try:
        scene = scenes.scene(frame)
    finally:
        scenes.close()
    upright = motion.upright()
    placed = [array[np.flatnonzero(motion.frames == frame)[0]] for array in upright.parts()]
    body = kinematics.skin(motion.model, *placed), motion.model.faces
    measured = motion.upright_frame.points(vertices), faces
    moved_mm = turned_deg = 0.0
    if align:
        vertices, turned_deg = _aligned_with(open3d, measured, body)
        moved_mm = 1000 * float(np.linalg.norm((vertices - measured[0]).mean(0)))
        measured = vertices, faces
    else:
        _refuse_elsewhere(Path(scan), measured, body)
    both = {"body": _both_ways(open3d, body, measured)}
    if scene.hull is not None:
        hull = scene.hull.vertices_m, scene.hull.faces
        both["hull"] = _both_ways(open3d, hull, measured)
    return ScanScore(
        frame, *both["body"], *both.get("hull", (None, None)), moved_mm, turned_deg, scene.notes
    )


def read_scan(path: Path, unit: str, body_m: float) -> Surface:
    """Surface of a scan, whose size is that of a person.

    Args:
        unit: of its lengths.
        body_m: largest extent of the body with which it is to be compared, m.

    Raises:
        InputError: it cannot be read, is not closed, or is of another size than the body.
    """
    if path.suffix.lower() not in MESH_SUFFIXES:
        raise InputError(f"{path} is none of {', '.join(MESH_SUFFIXES)}: convert it")
    mesh = read_triangles(path, _MOST_TRIANGLES)
    mesh.merge_vertices(merge_tex=True, merge_norm=True)  # formats keep seams, STL every corner
    used = np.bincount(mesh.edges_unique_inverse) % 2
    if used.any():
        raise InputError(
            f"{path} is not closed: {int(used.sum())} of its edges bound a hole; close its holes,"
            " for example in MeshLab, since only a closed surface has an inside"
        )
    if mesh.body_count > 1:
        raise InputError(
            f"{path} is in {mesh.body_count} pieces: keep one closed surface, since what lies"
            " within others is none of the body's"
        )
    extent = float(np.ptp(mesh.vertices, axis=0).max())
    fitting = [
        name
        for name, metres in METRES.items()
        if body_m < _ALIKE * extent * metres < _ALIKE**2 * body_m
    ]
    if unit not in fitting:
        asked = (
            f"is it in {fitting[0]}? Then say --unit {fitting[0]}" if fitting else "whose is it?"
        )
        raise InputError(
            f"{path} would be {extent * METRES[unit]:.3g} m large if it were in {unit}, and the"
            f" body is {body_m:.3g} m: {asked}"
        )
    return np.asarray(mesh.vertices, float) * METRES[unit], np.asarray(mesh.faces, np.int64)


def _refuse_elsewhere(path: Path, scan: Surface, body: Surface) -> None:
    low, high = (
        np.stack([edge(surface[0], axis=0) for surface in (scan, body)])
        for edge in (np.min, np.max)
    )
    apart_m = np.linalg.norm(np.maximum(low.max(0) - high.min(0), 0))
    if apart_m > 0:
        raise InputError(
            f"{path} is {apart_m:.2f} m beside the body: bring it into the world of the recording's"
            " calibration, or say --align"
        )


def _both_ways(
    open3d: Any, first: Surface, second: Surface
) -> tuple[SurfaceDistance, SurfaceDistance]:
    """Distances of the one surface from the other, and of the other from the one."""
    return _distance(open3d, first, second), _distance(open3d, second, first)


def _distance(open3d: Any, surface: Surface, other: Surface) -> SurfaceDistance:
    middle = other[0].mean(0)  # open3d computes in 32 bits
    scene = open3d.t.geometry.RaycastingScene()
    scene.add_triangles((other[0] - middle).astype(np.float32), other[1].astype(np.uint32))
    points = (_spread_points(surface, _POINTS)[0] - middle).astype(np.float32)
    # Of three rays, since one may pass through an edge.
    signed_mm = 1000 * scene.compute_signed_distance(points, nsamples=3).numpy().astype(float)
    size = np.abs(signed_mm)
    return SurfaceDistance(
        float(signed_mm.mean()),
        float(np.sqrt((size**2).mean())),
        float(np.quantile(size, 0.95)),
        float(size.max()),
    )


def _spread_points(surface: Surface, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (count, 3) spread evenly over a surface, always the same, and the normals there."""
    import trimesh

    mesh = trimesh.Trimesh(*surface, process=False)
    points, faces = trimesh.sample.sample_surface(mesh, count, seed=np.random.default_rng(0))[:2]
    return np.asarray(points, float), np.asarray(mesh.face_normals[faces], float)


def _aligned_with(open3d: Any, scan: Surface, body: Surface) -> tuple[NDArray[np.float64], float]:
    """Vertices of a scan, moved and turned onto a body, and the turn in degrees.

    The scan's up may be any axis, and it may face any way: of all these turns the one is taken from
    which a few points come nearest to the body. Source: Besl and McKay, "A method for registration
    of 3-D shapes" (PAMI 1992), by the points' tangent planes at the end.
    """
    registration = open3d.pipelines.registration

    def cloud(surface: Surface, count: int) -> Any:
        points, normals = _spread_points(surface, count)
        made = open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))
        made.normals = open3d.utility.Vector3dVector(normals)
        return made

    def matched(count: int, start: NDArray[np.float64], method: Any) -> Any:
        limit_m = 10 * float(np.ptp(body[0]))  # every point has a partner
        return registration.registration_icp(*clouds[count], limit_m, start, method)

    clouds = {count: (cloud(scan, count), cloud(body, count)) for count in (_FEW_POINTS, _POINTS)}
    by_points, by_planes = (
        registration.TransformationEstimationPointToPoint(),
        registration.TransformationEstimationPointToPlane(),
    )
    to_z = Rotation.create_group("O").as_matrix()[None]
    halfway = Rotation.from_euler("z", [[0], [45]], degrees=True).as_matrix()[:, None]
    starts = np.tile(np.eye(4), (48, 1, 1))
    starts[:, :3, :3] = (halfway @ to_z).reshape(-1, 3, 3)
    starts[:, :3, 3] = body[0].mean(0) - starts[:, :3, :3] @ scan[0].mean(0)
    registrations = [matched(_FEW_POINTS, start, by_points) for start in starts]
    best = min(registrations, key=lambda result: result.inlier_rmse)
    placed = matched(_POINTS, best.transformation, by_planes).transformation
    turned = Rotation.from_matrix(placed[:3, :3]).magnitude()
    return scan[0] @ placed[:3, :3].T + placed[:3, 3], float(np.degrees(turned))
