"""Synthetic cameras and boards: exact corners with noise, or rendered pictures. Needs no data."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from calib.board import Board, BoardView
from calib.camera import Camera, Rig
from calib.rotation import matrix_from_rodrigues, nearest_rotation

CHECKERBOARD = Board(8, 5, 0.06)
FACE_UP = np.diag([1.0, -1, -1])  # a board on the floor: its z points down
Pose = tuple[NDArray[np.float64], NDArray[np.float64]]

_TEXTURE_PX = 40  # per square
_BORDER_PX = 60  # beyond the picture's edges, from where distortion may move content into it
_OVERSAMPLING = 2


def board_picture(board: Board, square_px: int) -> NDArray[np.uint8]:
    """Draws a board (H, W) uint8, black on white, with a margin of one square."""
    size = ((board.columns + 1) * square_px, (board.rows + 1) * square_px)
    if board.marker_m is None:
        row, column = np.indices((board.rows + 1, board.columns + 1))
        # The first inner square is dark, as `Board.find` expects.
        squares = np.where((row + column) % 2 == 0, 0, 255).astype(np.uint8)
        picture = np.kron(squares, np.ones((square_px, square_px), dtype=np.uint8))
    else:
        picture = np.asarray(board.charuco.generateImage(size), dtype=np.uint8)
    return np.pad(picture, square_px, constant_values=255)


def align_rigs(rig: Rig, reference: Rig) -> Rig:
    """Aligns a rig with a reference by a rigid motion, from the axes and centres of the cameras."""
    rotation = nearest_rotation(
        sum(reference[name].rotation.T @ rig[name].rotation for name in rig.names)
    )
    apart = [reference[one.name].center_m - rotation @ one.center_m for one in rig]
    shift, moved = np.mean(apart, axis=0), []
    for camera in rig:
        turned, center = camera.rotation @ rotation.T, rotation @ camera.center_m + shift
        moved.append(replace(camera, rotation=turned, translation=-turned @ center))
    return Rig(tuple(moved))


def random_poses(
    count: int, seed: int = 0, centre=(0.0, 0.0, 1.2), sigma_m: float = 0.8
) -> list[Pose]:
    """Random rotations (3, 3), world from board, and positions of a board's middle (3,), m."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        rotation = matrix_from_rodrigues(rng.normal(size=3) * [0.5, 0.5, 1.0])
        poses.append((rotation, np.asarray(centre) + rng.uniform(-sigma_m, sigma_m, 3)))
    return poses


def held_poses(
    count: int, seed: int = 0, distance_m: tuple[float, float] = (0.5, 1.2)
) -> list[Pose]:
    """Random poses of a board in front of a camera, in the camera's frame."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        rotation = matrix_from_rodrigues(rng.uniform(-0.7, 0.7, 3))
        poses.append(
            (
                rotation,
                np.array([rng.uniform(-0.4, 0.4), rng.uniform(-0.3, 0.3), 1.0])
                * rng.uniform(*distance_m),
            )
        )
    return poses


def carried(rig: Rig, seconds: float, seed: int = 0) -> Callable[[float], Pose]:
    """Pose by time, s, of a board that is carried about the middle of a room, facing the cameras
    from the first to the last, now faster and now slower.
    """
    rng = np.random.default_rng(seed)
    knots = np.arange(0, seconds + 4, 1.2)
    places = rng.uniform([-0.6, -0.6, 0.7], [0.6, 0.6, 1.5], (len(knots), 3))
    turns = []
    for along in np.linspace(0, len(rig) - 1, len(knots)):
        near = (
            rig.cameras[int(along)].center_m,
            rig.cameras[min(int(along) + 1, len(rig) - 1)].center_m,
        )
        away = -((1 - along % 1) * near[0] + along % 1 * near[1]) * [1, 1, 0.3]
        across = np.cross(away, [0, 0, 1.0])
        axes = [across, np.cross(away, across), away]
        facing = np.column_stack([axis / np.linalg.norm(axis) for axis in axes])
        turns.append(facing @ matrix_from_rodrigues(rng.normal(0, 0.3, 3)))
    place = CubicSpline(knots, places)
    turn = RotationSpline(knots, Rotation.from_matrix(turns))
    return lambda time_s: (turn(time_s).as_matrix(), place(time_s))


def seen(
    camera: Camera, board: Board, pose: Pose, noise_px: float, rng: np.random.Generator
) -> BoardView | None:
    """View of a board, or None unless its face and all its corners are visible."""
    points = (board.points_m - board.points_m.mean(axis=0)) @ pose[0].T + pose[1]
    facing = (points[0] - camera.center_m) @ pose[0][:, 2] > 0.15 * np.linalg.norm(
        points[0] - camera.center_m
    )
    pixels, _ = camera.project(points)
    inside = (
        np.isfinite(pixels).all()
        and (pixels > 0).all()
        and (pixels < np.array(camera.size) - 1).all()
    )
    if not (facing and inside):
        return None
    return BoardView(
        np.arange(len(points)), pixels + rng.normal(0, noise_px, pixels.shape), camera.size
    )


def lens_views(
    camera: Camera, count: int, noise_px: float, board: Board = CHECKERBOARD, seed: int = 0
) -> dict[str, BoardView]:
    """`count` views of a board in front of a camera at the origin that looks along z."""
    rng = np.random.default_rng(seed)
    views = [seen(camera, board, pose, noise_px, rng) for pose in held_poses(20 * count, seed)]
    return {
        f"picture_{number:02d}": view
        for number, view in enumerate([view for view in views if view][:count])
    }


def turned_to(rig: Rig, poses: Sequence[Pose]) -> list[Pose]:
    """Boards rotated so that they face the cameras in turn."""
    return [
        (rig.cameras[index % len(rig)].rotation.T @ rotation, position)
        for index, (rotation, position) in enumerate(poses)
    ]


def board_views(
    rig: Rig, board: Board, count: int, noise_px: float, seed: int = 0
) -> dict[str, dict[str, BoardView]]:
    """Views of a board at random poses in the middle of a room, by moment and camera."""
    rng = np.random.default_rng(seed)
    views = {}
    for index, pose in enumerate(turned_to(rig, random_poses(count, seed))):
        result = {camera.name: seen(camera, board, pose, noise_px, rng) for camera in rig}
        views[f"moment_{index}"] = {name: view for name, view in result.items() if view is not None}
    return views


def looking_at(
    name: str,
    position: np.ndarray,
    target: np.ndarray,
    matrix: np.ndarray,
    size=(1280, 720),
    distortion=(),
) -> Camera:
    """Upright camera at a position that looks at a target."""
    forward = (target - position) / np.linalg.norm(target - position)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(forward, right), forward])
    return Camera(
        name, size, matrix, np.array(distortion, dtype=float), rotation, -rotation @ position
    )


def room(
    count: int = 4,
    radius_m: float = 4.0,
    seed: int = 0,
    size: tuple[int, int] = (1280, 720),
    arc_deg: float = 180,
) -> Rig:
    """Cameras on an arc about the middle of a room, at different heights."""
    rng = np.random.default_rng(seed)
    cameras = []
    for index, angle in enumerate(np.linspace(0, np.radians(arc_deg), count)):
        position = np.array(
            [radius_m * np.cos(angle), radius_m * np.sin(angle), rng.uniform(1.0, 2.2)]
        )
        focal = rng.uniform(850, 950) * size[0] / 1280
        matrix = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]])
        cameras.append(
            looking_at(
                f"cam_{index}",
                position,
                np.array([0, 0, 1.0]),
                matrix,
                size,
                (-0.1, 0.05, 0.001, 0.0),
            )
        )
    return Rig(tuple(cameras))


def without_poses(rig: Rig) -> Rig:
    """The rig with all cameras at the origin."""
    return Rig(
        tuple(replace(camera, rotation=np.eye(3), translation=np.zeros(3)) for camera in rig)
    )


class BoardCamera:
    """Renders the pictures that a camera takes of a board."""

    def __init__(self, camera: Camera, board: Board, seed: int = 0) -> None:
        """Prepares the parts that all pictures share."""
        self.camera, self.board = camera, board
        self.rng = np.random.default_rng(seed)
        width, height = camera.size
        # Rendered without distortion in a larger picture, then distorted.
        pinhole = camera.pinhole(_OVERSAMPLING)
        border_px = _BORDER_PX * _OVERSAMPLING
        shifted = pinhole.matrix + np.array([[0, 0, border_px], [0, 0, border_px], [0, 0, 0]])
        self.fine = replace(
            pinhole,
            matrix=shifted,
            size=(pinhole.size[0] + 2 * border_px, pinhole.size[1] + 2 * border_px),
        )
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        ideal = (
            (camera.undistort(np.column_stack([x.ravel(), y.ravel()])) + 0.5) * _OVERSAMPLING
            - 0.5
            + border_px
        )
        self.maps = cv2.resize(
            ideal.astype(np.float32).reshape(height, width, 2),
            pinhole.size,
            interpolation=cv2.INTER_LINEAR,
        )
        self.texture = 25 + 0.8 * board_picture(board, _TEXTURE_PX).astype(np.float32)
        rough = self.rng.normal(120, 20, (height // 40 + 2, width // 40 + 2)).astype(np.float32)
        self.wall = cv2.resize(rough, self.fine.size, interpolation=cv2.INTER_CUBIC)

    def picture(self, pose: Pose) -> NDArray[np.uint8]:
        """Picture (H, W, 3) uint8 of a board in front of a blurred wall, with sensor noise.

        Args:
            pose: Rotation, world from board, and position of the board's middle.
        """
        rotation = self.camera.rotation @ pose[0]
        middle = self.camera.rotation @ pose[1] + self.camera.translation
        fine = self.wall.copy()
        corner = middle - rotation @ self.board.points_m.mean(axis=0)
        if middle @ rotation[:, 2] > 0 and middle[2] > 0:  # its face is visible
            side = self.board.square_m / _TEXTURE_PX
            from_texture = np.array(
                [
                    [side, 0, 0.5 * side - 2 * self.board.square_m],
                    [0, side, 0.5 * side - 2 * self.board.square_m],
                    [0, 0, 1],
                ]
            )
            homography = (
                self.fine.matrix
                @ np.column_stack([rotation[:, 0], rotation[:, 1], corner])
                @ from_texture
            )
            cv2.warpPerspective(
                self.texture,
                homography,
                self.fine.size,
                fine,
                cv2.INTER_AREA,
                cv2.BORDER_TRANSPARENT,
            )
        fine = cv2.remap(fine, self.maps, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        grey = cv2.GaussianBlur(
            cv2.resize(fine, self.camera.size, interpolation=cv2.INTER_AREA), (0, 0), 0.6
        )
        grey += self.rng.normal(0, 2, grey.shape).astype(np.float32)
        return cv2.cvtColor(np.clip(np.round(grey), 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)
