"""Bundle adjustment: lenses, camera places and board places, moved together until what was seen is
where it should be.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from calib.camera import Camera
from calib.lens import FisheyeLens, RationalLens
from calib.rotation import matrix_from_rodrigues

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Free = Literal["lenses", "places", "both"]
Fixed = Literal["camera", "board"]

_ROBUST_PX = 3.0  # errors beyond this count less and less
_STEP = 1e-6
_ENOUGH = 1e-6  # relative gain of a step after which no other is taken
_DISTORTION_SCALE = 1.0  # a distortion term of one costs as much as one corner that is a pixel off:
_TANGENTIAL_SCALE = (
    0.05  # nothing beside thousands of corners, but it decides between terms that cancel each other
)


@dataclass(frozen=True, eq=False)
class Observations:
    """Corners seen: camera (N,) and board (N,) numbers, the corner in the board's frame (N, 3) m,
    and where it was seen (N, 2) px.
    """

    camera: IntArray
    board: IntArray
    points_m: FloatArray
    pixels: FloatArray


@dataclass(frozen=True, eq=False)
class BundleScene:
    """Cameras, and the boards' places: rotations (B, 3, 3), world from board, and translations (B,
    3), m.
    """

    cameras: tuple[Camera, ...]
    rotations: FloatArray
    translations: FloatArray


@dataclass(frozen=True, eq=False)
class Adjusted:
    """A scene after adjustment.

    Attributes: scene: The scene. residuals_px: (N, 2) float64, seen less reprojected. covariances:
        One (p, p) float64 per camera of its free numbers: rotation (rad, about camera axes) and
        translation (m), then focal
            lengths (as logarithms), centre and distortion, or one of these; zeros for what is held
            fixed.
    """

    scene: BundleScene
    residuals_px: FloatArray
    covariances: tuple[FloatArray, ...]


def adjust(scene: BundleScene, seen: Observations, free: Free, fixed: Fixed = "camera") -> Adjusted:
    """Finds the nearest scene that explains the observations best.

    Args: scene: Where to start. seen: The observations. free: "places": the boards and the cameras
        move. "lenses": the boards move, cameras stay and their lenses change. "both". fixed: What
        does not move where cameras do: the first camera, or the first board.

    Returns:
        The adjusted scene; covariances assume independent errors of the size of the residuals.

    Source: Triggs et al., Bundle Adjustment - A Modern Synthesis, 1999, 3.4, 4 and 10.
    """
    problem = _Problem(scene, seen, free, fixed)
    from_step = _decoupled(problem)
    # Sparse; errors beyond a few px count linearly.
    step = least_squares(
        lambda step: problem.residuals(from_step @ step),
        np.zeros(len(problem.moving)),
        jac=lambda step: problem.jacobian(from_step @ step) @ from_step,  # pyright: ignore[reportArgumentType]  # stubs know dense ones only
        loss="soft_l1",
        f_scale=_ROBUST_PX,
        tr_solver="lsmr",
        ftol=_ENOUGH,
    ).x
    x = from_step @ step
    residuals = problem.reprojection(x)
    # The median resists the outliers that the loss has put aside; 1.4826 makes it a standard
    # deviation.
    sigma = 1.4826 * float(np.median(np.abs(residuals)))
    return Adjusted(problem.scene(x), residuals, _covariances(problem.jacobian(x), sigma, problem))


def _decoupled(problem: "_Problem") -> sparse.csr_matrix:
    """Returns a change of variables in which no two numbers of one camera or one board do the same:
    the iterations inside need few steps.

    (Block Jacobi preconditioning. Focal length and distance, for one, are almost the same to a
    small board.)
    """
    jacobian = problem.jacobian(np.zeros(len(problem.moving))).tocsc()
    starts = [
        *range(0, problem.boards_at, problem.block or 1),
        *range(problem.boards_at, problem.size, 6),
    ]
    edges = np.searchsorted(problem.moving, [*starts, problem.size])
    blocks = []
    for first, last in pairwise(edges):
        if last > first:
            own = jacobian[:, first:last]
            level, axes = np.linalg.eigh((own.T @ own).toarray())
            # What changes nothing moves nothing.
            blocks.append(axes / np.sqrt(np.maximum(level, 1e-12 * max(level.max(), 1e-12))))
    return sparse.csr_matrix(sparse.block_diag(blocks))


def plane_poses(
    points_m: FloatArray, normalised: FloatArray, refine: bool = True
) -> list[tuple[FloatArray, FloatArray, float]]:
    """Places a flat board before a camera.

    Args:
        points_m: (N, 3), m, with z = 0.
        normalised: (N, 2), ideal coordinates (x / z, y / z), where each point was seen.
        refine: Whether to go on from the closed form to the least squares.

    Returns: Up to two poses, better first: rotation (3, 3) and translation (3,), camera from board,
        and the rms error in ideal coordinates. (A small flat board looks almost the same tilted one
        way and the other.)

    Source: Collins and Bartoli, Infinitesimal Plane-Based Pose Estimation, 2014 (OpenCV's
    SOLVEPNP_IPPE).
    """
    if len(points_m) < 4 or not np.isfinite(normalised).all():
        return []
    found, turns, shifts, _ = cv2.solvePnPGeneric(
        points_m, normalised, np.eye(3), np.zeros(4), flags=cv2.SOLVEPNP_IPPE
    )
    poses = []
    for index in range(int(found)):
        turn, shift = turns[index].copy(), shifts[index].copy()
        if refine:
            turn, shift = cv2.solvePnPRefineLM(
                points_m, normalised, np.eye(3), np.zeros(4), turn, shift
            )
        rotation, translation = (
            matrix_from_rodrigues(turn),
            np.asarray(shift, dtype=np.float64).ravel(),
        )
        placed = points_m @ rotation.T + translation
        if (placed[:, 2] > 0).all():
            error = np.linalg.norm(placed[:, :2] / placed[:, 2:] - normalised, axis=1)
            poses.append((rotation, translation, float(np.sqrt((error**2).mean()))))
    return sorted(poses, key=lambda pose: pose[2])


class _Problem:
    """The numbers that move, and what they do to the residuals.

    All numbers are a block per camera (6 of its place, then those of its lens, or one of the two),
    then 6 per board: a rotation vector put in front of the start's rotation, and a translation
    added to the start's. The vector holds those of them that move.
    """

    def __init__(self, scene: BundleScene, seen: Observations, free: Free, fixed: Fixed) -> None:
        """Counts the numbers."""
        self.start, self.seen, self.free = scene, seen, free
        self.terms = max((len(camera.distortion) for camera in scene.cameras), default=0)
        self.lens_at = 0 if free == "lenses" else 6
        self.block = self.lens_at + (0 if free == "places" else 4 + self.terms)
        self.boards_at = self.block * len(scene.cameras)
        self.size = self.boards_at + 6 * len(scene.translations)
        still = 0 if fixed == "camera" else self.boards_at
        self.moving = (
            np.arange(self.size)
            if free == "lenses"
            else np.delete(np.arange(self.size), np.s_[still : still + 6])
        )

    def _all(self, x: FloatArray) -> FloatArray:
        """Returns all numbers, those that do not move being zero."""
        numbers = np.zeros(self.size)
        numbers[self.moving] = x
        return numbers

    def scene(self, x: FloatArray) -> BundleScene:
        """Returns the scene of a vector."""
        return self._scene(self._all(x))

    def _scene(self, numbers: FloatArray) -> BundleScene:
        boards = numbers[self.boards_at :].reshape(-1, 6)
        turned = Rotation.from_rotvec(boards[:, :3]).as_matrix() @ self.start.rotations
        blocks = numbers[: self.boards_at].reshape(-1, self.block)
        cameras = tuple(
            self._moved(camera, block)
            for camera, block in zip(self.start.cameras, blocks, strict=True)
        )
        return BundleScene(cameras, turned, self.start.translations + boards[:, 3:])

    def _moved(self, camera: Camera, block: FloatArray) -> Camera:
        """Returns a camera with its block's numbers applied."""
        if self.free != "lenses":
            rotation = matrix_from_rodrigues(block[:3])
            camera = replace(
                camera,
                rotation=rotation @ camera.rotation,
                translation=rotation @ camera.translation + block[3:6],
            )
        if self.free == "places":
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

    def reprojection(self, x: FloatArray) -> FloatArray:
        """Returns seen less reprojected, (N, 2) px."""
        return self._reprojection(self._all(x))

    def _reprojection(self, numbers: FloatArray) -> FloatArray:
        scene, seen = self._scene(numbers), self.seen
        world = (
            np.einsum("nij,nj->ni", scene.rotations[seen.board], seen.points_m)
            + scene.translations[seen.board]
        )
        again = np.empty_like(seen.pixels)
        for index, camera in enumerate(scene.cameras):
            rows = seen.camera == index
            placed = world[rows] @ camera.rotation.T + camera.translation
            lens = (
                FisheyeLens(camera.distortion)
                if camera.fisheye
                else RationalLens(camera.distortion)
            )
            again[rows] = (
                lens.distort_unbounded(placed[:, :2] / placed[:, 2:]) @ camera.matrix[:2, :2].T
                + camera.matrix[:2, 2]
            )
        return seen.pixels - again

    def residuals(self, x: FloatArray) -> FloatArray:
        """Returns all residuals, flat: corners, then the pull of distortion terms toward zero."""
        return self._residuals(self._all(x))

    def _residuals(self, numbers: FloatArray) -> FloatArray:
        return np.concatenate([self._reprojection(numbers).ravel(), self._pull(numbers)])

    def _pull(self, numbers: FloatArray) -> FloatArray:
        """Returns the distortion terms over their scales, one per camera and term."""
        if self.free == "places" or not self.terms:
            return np.zeros(0)
        start = np.array(
            [
                np.pad(camera.distortion, (0, self.terms - len(camera.distortion)))
                for camera in self.start.cameras
            ]
        )
        scales = np.full((len(start), self.terms), _DISTORTION_SCALE)
        for row, camera in zip(scales, self.start.cameras, strict=True):
            if not camera.fisheye:
                row[2:4] = _TANGENTIAL_SCALE
        blocks = numbers[: self.boards_at].reshape(len(start), self.block)
        return ((start + blocks[:, self.lens_at + 4 :]) / scales).ravel()

    def jacobian(self, x: FloatArray) -> sparse.csr_matrix:
        """Differentiates: a corner depends on one camera and one board only, so all blocks are
        stepped at once.
        """
        seen, count = self.seen, len(self.seen.pixels)
        numbers = self._all(x)
        here = self._residuals(numbers)
        rows, columns, values = [], [], []
        row = np.arange(2 * count)
        for offset, width, end, owner in (
            (0, self.block, self.boards_at, seen.camera),
            (self.boards_at, 6, self.size, seen.board),
        ):
            owner = np.repeat(owner, 2)
            for number in range(width):
                stepped = numbers.copy()
                stepped[offset + number : end : width] += _STEP
                change = (self._residuals(stepped) - here) / _STEP
                rows.append(row)
                columns.append(offset + number + width * owner)
                values.append(change[: 2 * count])
                pulled = np.flatnonzero(change[2 * count :])
                rows.append(2 * count + pulled)
                columns.append(number + width * (pulled // max(self.terms, 1)))
                values.append(change[2 * count + pulled])
        shape = (len(here), self.size)
        whole = sparse.csc_matrix(
            (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), shape=shape
        )
        return whole[:, self.moving].tocsr()


def _covariances(
    jacobian: sparse.csr_matrix, sigma: float, problem: _Problem
) -> tuple[FloatArray, ...]:
    """Returns each camera's block of the inverse normal matrix; directions that nothing holds come
    out as infinite.
    """
    normal = (jacobian.T @ jacobian).toarray()
    ours = np.flatnonzero(problem.moving < problem.boards_at)
    inner = normal[np.ix_(ours, ours)]
    # Boards are eliminated one by one: they do not see each other.
    for at in range(problem.boards_at, problem.size, 6):
        own = np.flatnonzero((problem.moving >= at) & (problem.moving < at + 6))
        if len(own):
            inner -= (
                normal[np.ix_(ours, own)]
                @ np.linalg.pinv(normal[np.ix_(own, own)])
                @ normal[np.ix_(own, ours)]
            )
    scale = np.sqrt(np.maximum(normal[ours, ours], 1e-300))
    level, axes = np.linalg.eigh(inner / np.outer(scale, scale))
    with np.errstate(divide="ignore"):
        inverse = np.where(level > 1e-12, 1 / np.maximum(level, 1e-12), 1e12)
    whole = np.zeros((problem.boards_at, problem.boards_at))
    whole[np.ix_(problem.moving[ours], problem.moving[ours])] = (
        sigma**2 * (axes * inverse) @ axes.T / np.outer(scale, scale)
    )
    return tuple(
        whole[at : at + problem.block, at : at + problem.block]
        for at in range(0, problem.boards_at, problem.block)
    )


def rms_px(residuals_px: FloatArray) -> float:
    """Returns the root mean square distance of (N, 2) residuals."""
    return float(np.sqrt((residuals_px**2).sum(axis=1).mean()))


def ideal_poses(
    camera: Camera, points_m: FloatArray, pixels: FloatArray, refine: bool = True
) -> list[tuple[FloatArray, FloatArray, float]]:
    """Returns `plane_poses` of a board seen in recorded pixels; corners that no ray belongs to are
    left out.
    """
    normalised = camera.lens.undistort((pixels - camera.matrix[:2, 2]) / np.diag(camera.matrix)[:2])
    kept = np.isfinite(normalised).all(axis=1)
    return plane_poses(points_m[kept], normalised[kept], refine)
