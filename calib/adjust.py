"""Bundle adjustment of lenses, camera poses and board poses."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from calib.camera import Camera, FloatArray
from calib.rotation import matrix_from_rodrigues
from calib.tuning import BOARDS

IntArray = NDArray[np.int64]
Free = Literal["boards", "lenses", "poses", "both"]
Fixed = Literal["camera", "board"]


@dataclass(frozen=True, eq=False)
class Observations:
    """Detected corners."""

    camera: IntArray  #: (N,) int64, number of the camera.
    board: IntArray  #: (N,) int64, number of the board.
    points_m: FloatArray  #: (N, 3) float64, m, the corner in the board's frame.
    pixels: FloatArray  #: (N, 2) float64, px, the detected corner.


@dataclass(frozen=True, eq=False)
class BundleScene:
    """Cameras and board poses."""

    cameras: tuple[Camera, ...]
    rotations: FloatArray  #: (B, 3, 3) float64, world from board.
    translations: FloatArray  #: (B, 3) float64, m, world from board.


@dataclass(frozen=True, eq=False)
class Adjustment:
    """A scene after adjustment."""

    scene: BundleScene
    residuals_px: FloatArray  #: (N, 2) float64, px, observed minus reprojected.
    covariances: tuple[FloatArray, ...]
    """One (p, p) float64 per camera, of its free parameters: rotation (rad, about camera axes) and
    translation (m), then focal lengths (as logarithms), centre and distortion, or one of the two
    groups; zeros for fixed parameters. None where no parameter of a camera is free."""


def adjust(
    scene: BundleScene, observations: Observations, free: Free, fixed: Fixed = "camera"
) -> Adjustment:
    """Minimises the reprojection error.

    Args:
        free: "poses": poses of boards and cameras are free. "lenses": poses of boards and the lens
            parameters are free. "both": all are free. "boards": poses of boards alone.
        fixed: What defines the world if camera poses are free: the first camera or the first board.

    Returns:
        The adjusted scene; covariances assume that boards, not corners, have independent errors.

    Source: Triggs et al., Bundle Adjustment - A Modern Synthesis, 1999, 3.4, 4 and 10.
    """
    problem = _Problem(scene, observations, free, fixed)
    from_step = _decoupled(problem)
    step = least_squares(
        lambda step: problem.residuals(problem.parameters(from_step @ step)),
        np.zeros(len(problem.moving)),
        jac=lambda step: problem.jacobian(problem.parameters(from_step @ step)) @ from_step,  # pyright: ignore[reportArgumentType]  # stubs know dense ones only
        loss="soft_l1",
        f_scale=BOARDS.robust_px,
        tr_solver="lsmr",
        ftol=1e-6,
    ).x
    parameters = problem.parameters(from_step @ step)
    residuals = problem.reprojection(parameters)
    covariances = _covariances(problem.jacobian(parameters), residuals, problem)
    return Adjustment(problem.scene(parameters), residuals, covariances)


def _decoupled(problem: "_Problem") -> sparse.csr_matrix:
    """Block Jacobi preconditioner: variables that are uncorrelated within a camera or a board.

    Without it the inner iterations need many steps; focal length and distance, for example, have
    almost the same effect on a small board.
    """
    jacobian = problem.jacobian(np.zeros(problem.size)).tocsc()
    starts = [
        *range(0, problem.boards_at, problem.block or 1),
        *range(problem.boards_at, problem.size, 6),
    ]
    edges = np.searchsorted(problem.moving, [*starts, problem.size])
    blocks = []
    for first, last in pairwise(edges):
        if last > first:
            columns = jacobian[:, first:last]
            level, axes = np.linalg.eigh((columns.T @ columns).toarray())
            # Directions without effect get a bounded step.
            blocks.append(axes / np.sqrt(np.maximum(level, 1e-12 * max(level.max(), 1e-12))))
    return sparse.csr_matrix(sparse.block_diag(blocks))


def ideal_poses(
    camera: Camera, points_m: FloatArray, pixels: FloatArray, refine: bool = True
) -> list[tuple[FloatArray, FloatArray, float]]:
    """Poses of a flat board relative to a camera.

    Args:
        camera: The camera, whose pose is ignored.
        points_m: (N, 3), m, with z = 0.
        pixels: (N, 2), px, the recorded corners; those without a ray are ignored.
        refine: Whether to refine the closed-form solution by least squares.

    Returns:
        Up to two poses, better first: rotation (3, 3) and translation (3,), camera from board, and
        the rms error in ideal coordinates. There are two because a small flat board looks almost
        the same when tilted either way.

    Source: Collins and Bartoli, Infinitesimal Plane-Based Pose Estimation, 2014 (OpenCV's
    SOLVEPNP_IPPE).
    """
    normalised = camera.lens.undistort((pixels - camera.matrix[:2, 2]) / np.diag(camera.matrix)[:2])
    has_ray = np.isfinite(normalised).all(axis=1)
    points_m, normalised = points_m[has_ray], normalised[has_ray]
    if len(points_m) < 4:
        return []
    count, rotvecs, shifts, _ = cv2.solvePnPGeneric(
        points_m, normalised, np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_IPPE
    )
    poses = []
    for index in range(int(count)):
        rotvec, shift = rotvecs[index].copy(), shifts[index].copy()
        if refine:
            rotvec, shift = cv2.solvePnPRefineLM(
                points_m, normalised, np.eye(3), np.zeros(4), rotvec, shift
            )
        rotation = matrix_from_rodrigues(rotvec)
        translation = np.asarray(shift, dtype=np.float64).ravel()
        points_camera = points_m @ rotation.T + translation
        if (points_camera[:, 2] > 0).all():
            error = np.linalg.norm(points_camera[:, :2] / points_camera[:, 2:] - normalised, axis=1)
            poses.append((rotation, translation, float(np.sqrt((error**2).mean()))))
    return sorted(poses, key=lambda pose: pose[2])


class _Problem:
    """Parameter vector and residuals of the adjustment.

    The parameters are one block per camera (6 of its pose, then those of its lens, or one of the
    two), then 6 per board: a rotation vector applied to the initial rotation, and a translation
    added to the initial one. The vector `x` of the solver holds the free ones among them.
    """

    def __init__(
        self, scene: BundleScene, observations: Observations, free: Free, fixed: Fixed
    ) -> None:
        self.start, self.observations, self.free = scene, observations, free
        self.term_count = max((len(camera.distortion) for camera in scene.cameras), default=0)
        self.lens_at = 0 if free in ("boards", "lenses") else 6
        lenses_free = free in ("lenses", "both")
        self.block = self.lens_at + (4 + self.term_count if lenses_free else 0)
        self.boards_at = self.block * len(scene.cameras)
        self.size = self.boards_at + 6 * len(scene.translations)
        still = 0 if fixed == "camera" else self.boards_at
        self.moving = (
            np.arange(self.size)
            if free in ("boards", "lenses")
            else np.delete(np.arange(self.size), np.s_[still : still + 6])
        )

    def parameters(self, x: FloatArray) -> FloatArray:
        """All parameters, zero for the fixed ones."""
        parameters = np.zeros(self.size)
        parameters[self.moving] = x
        return parameters

    def scene(self, parameters: FloatArray) -> BundleScene:
        """Scene for all parameters."""
        boards = parameters[self.boards_at :].reshape(-1, 6)
        turned = Rotation.from_rotvec(boards[:, :3]).as_matrix() @ self.start.rotations
        blocks = parameters[: self.boards_at].reshape(len(self.start.cameras), self.block)
        cameras = tuple(
            self._moved(camera, block)
            for camera, block in zip(self.start.cameras, blocks, strict=True)
        )
        return BundleScene(cameras, turned, self.start.translations + boards[:, 3:])

    def _moved(self, camera: Camera, block: FloatArray) -> Camera:
        """A camera with its block of parameters applied."""
        if self.lens_at:
            camera = camera.turned(matrix_from_rodrigues(block[:3]), block[3:6])
        if self.block == self.lens_at:
            return camera
        lens = block[self.lens_at :]
        matrix = camera.matrix.copy()
        matrix[[0, 1], [0, 1]] *= np.exp(lens[:2])
        matrix[:2, 2] += lens[2:4] * np.array(camera.size)
        return replace(
            camera,
            matrix=matrix,
            distortion=camera.distortion + lens[4 : 4 + len(camera.distortion)],
        )

    def reprojection(self, parameters: FloatArray) -> FloatArray:
        """Observed minus reprojected corners, (N, 2) px."""
        scene, observations = self.scene(parameters), self.observations
        world = (
            np.einsum("nij,nj->ni", scene.rotations[observations.board], observations.points_m)
            + scene.translations[observations.board]
        )
        reprojected = np.empty_like(observations.pixels)
        for index, camera in enumerate(scene.cameras):
            rows = observations.camera == index
            points_camera = world[rows] @ camera.rotation.T + camera.translation
            reprojected[rows] = (
                camera.lens.distort_unbounded(points_camera[:, :2] / points_camera[:, 2:])
                @ camera.matrix[:2, :2].T
                + camera.matrix[:2, 2]
            )
        return observations.pixels - reprojected

    def residuals(self, parameters: FloatArray) -> FloatArray:
        """All residuals, flat: corners, then the prior of the distortion terms."""
        return np.concatenate([self.reprojection(parameters).ravel(), self._prior(parameters)])

    def _prior(self, parameters: FloatArray) -> FloatArray:
        """Distortion terms divided by their scales, one per camera and term: a term of its scale
        costs as much as one corner with an error of a pixel.
        """
        if self.block == self.lens_at or not self.term_count:
            return np.zeros(0)
        start = np.array(
            [
                np.pad(camera.distortion, (0, self.term_count - len(camera.distortion)))
                for camera in self.start.cameras
            ]
        )
        scales = np.ones((len(start), self.term_count))
        for row, camera in zip(scales, self.start.cameras, strict=True):
            if not camera.fisheye:
                row[2:4] = BOARDS.tangential_sigma
        blocks = parameters[: self.boards_at].reshape(len(start), self.block)
        return ((start + blocks[:, self.lens_at + 4 :]) / scales).ravel()

    def jacobian(self, parameters: FloatArray) -> sparse.csr_matrix:
        """Forward differences by the free ones among the parameters.

        A corner depends on one camera and one board only, so all blocks are stepped at once.
        """
        observations, count = self.observations, len(self.observations.pixels)
        current = self.residuals(parameters)
        rows, columns, values, step = [], [], [], 1e-6
        row = np.arange(2 * count)
        for offset, width, end, owners in (
            (0, self.block, self.boards_at, observations.camera),
            (self.boards_at, 6, self.size, observations.board),
        ):
            owners = np.repeat(owners, 2)
            for column in range(width):
                stepped = parameters.copy()
                stepped[offset + column : end : width] += step
                change = (self.residuals(stepped) - current) / step
                rows.append(row)
                columns.append(offset + column + width * owners)
                values.append(change[: 2 * count])
                changed = np.flatnonzero(change[2 * count :])
                rows.append(2 * count + changed)
                columns.append(column + width * (changed // max(self.term_count, 1)))
                values.append(change[2 * count + changed])
        shape = (len(current), self.size)
        whole = sparse.csc_matrix(
            (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape
        )
        return whole[:, self.moving].tocsr()


def _covariances(
    jacobian: sparse.csr_matrix, residuals: FloatArray, problem: _Problem
) -> tuple[FloatArray, ...]:
    """Each camera's block of the covariance; very large in undetermined directions.

    Errors of one board have causes in common: how it is lit, bent or blurred. So the covariance is
    that of the boards' pulls on the cameras (a sandwich, clustered by board), and no less than that
    of independent errors. Few boards do not tell every direction: their covariance shrinks toward
    the same in all.

    Source: Liang and Zeger, Longitudinal data analysis using generalized linear models, 1986.
    """
    if not problem.block:
        return ()
    # Standard deviation estimated from the median absolute deviation, which resists outliers.
    sigma = 1.4826 * float(np.median(np.abs(residuals)))
    flat = residuals.ravel()
    flat = flat / np.hypot(1, flat / BOARDS.robust_px)
    ours = np.flatnonzero(problem.moving < problem.boards_at)
    columns = jacobian.tocsc()
    by_camera = columns[:, ours].tocsr()
    inner, pulls = (by_camera.T @ by_camera).toarray(), []
    scale = np.sqrt(np.maximum(np.diag(inner), 1e-300))
    # Boards are eliminated one by one (Schur complement): no residual depends on two of them.
    for first in range(problem.boards_at, problem.size, 6):
        board = np.flatnonzero((problem.moving >= first) & (problem.moving < first + 6))
        if len(board):
            by_board = columns[:, board]
            rows = np.unique(by_board.indices)
            camera_rows, pose = by_camera[rows].toarray(), by_board.tocsr()[rows].toarray()
            along = pose @ np.linalg.lstsq(pose, camera_rows, rcond=None)[0]
            inner -= along.T @ along
            pulls.append((camera_rows - along).T @ flat[rows])
    level, axes = np.linalg.eigh(inner / np.outer(scale, scale))
    with np.errstate(divide="ignore"):
        inverse = np.where(level > 1e-12, 1 / np.maximum(level, 1e-12), 1e12)
    root = axes * np.sqrt(inverse) / scale[:, None]
    whole = np.zeros((problem.boards_at, problem.boards_at))
    whole[np.ix_(problem.moving[ours], problem.moving[ours])] = (
        root @ _spread(np.reshape(pulls, (-1, len(ours))) @ root, sigma) @ root.T
    )
    return tuple(
        whole[first : first + problem.block, first : first + problem.block]
        for first in range(0, problem.boards_at, problem.block)
    )


def _spread(pulls: FloatArray, sigma: float) -> FloatArray:
    """Covariance (p, p) of pulls (boards, p), of which independent errors of a standard deviation
    sigma give sigma squared in every direction.
    """
    count, size = pulls.shape
    spread = pulls.T @ pulls * count / max(count - 1, 1)
    same = max(np.trace(spread) / max(size, 1), sigma**2)
    level, axes = np.linalg.eigh((count * spread + size * same * np.eye(size)) / (count + size))
    return (axes * np.maximum(level, sigma**2)) @ axes.T


def rms_px(residuals_px: FloatArray) -> float:
    """Root mean square length of (N, 2) residuals."""
    return float(np.sqrt((residuals_px**2).sum(axis=1).mean()))
