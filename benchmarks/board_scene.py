"""Made-up cameras that film a made-up board: exact corners with noise, or rendered pictures. Needs
no data.
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.board import Board, BoardView
from calib.board_sheet import board_picture
from calib.camera import Camera, Rig
from calib.rotation import matrix_from_rodrigues

CHECKERBOARD = Board(8, 5, 0.06)
FACE_UP = np.diag([1.0, -1, -1])  # a board on the floor: its z points down
Pose = tuple[NDArray[np.float64], NDArray[np.float64]]

_TEXTURE_PX = 40  # per square
_ROOM = 60  # px beyond the picture's edges, from where a lens may bend into it
_FINER = 2  # rendered so many times finer, then averaged


def random_poses(
    count: int, seed: int = 0, centre=(0.0, 0.0, 1.2), sigma_m: float = 0.8
) -> list[Pose]:
    """Returns world-from-board rotations (3, 3) and places of a board's middle (3,), m."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        rotation = matrix_from_rodrigues(rng.normal(size=3) * [0.5, 0.5, 1.0])
        poses.append((rotation, np.asarray(centre) + rng.uniform(-sigma_m, sigma_m, 3)))
    return poses


def held_poses(
    count: int, seed: int = 0, distance_m: tuple[float, float] = (0.5, 1.2)
) -> list[Pose]:
    """Returns places of a board that is held before a camera, in the camera's frame."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        turn = matrix_from_rodrigues(rng.uniform(-0.7, 0.7, 3))
        poses.append(
            (
                turn,
                np.array([rng.uniform(-0.4, 0.4), rng.uniform(-0.3, 0.3), 1.0])
                * rng.uniform(*distance_m),
            )
        )
    return poses


def seen(
    camera: Camera, board: Board, pose: Pose, noise_px: float, rng: np.random.Generator
) -> BoardView | None:
    """Returns the view of a board placed in the world, or None if it does not show its face or all
    its corners.
    """
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
    """Returns `count` views of a board held before a camera that stands at the origin and looks
    along z.
    """
    rng = np.random.default_rng(seed)
    found = [seen(camera, board, pose, noise_px, rng) for pose in held_poses(20 * count, seed)]
    return {
        f"picture_{number:02d}": view
        for number, view in enumerate([view for view in found if view][:count])
    }


def turned_to(rig: Rig, poses: Sequence[Pose]) -> list[Pose]:
    """Turns boards so that they face the cameras, one after the other."""
    return [
        (rig.cameras[index % len(rig)].rotation.T @ turn, place)
        for index, (turn, place) in enumerate(poses)
    ]


def board_views(
    rig: Rig, board: Board, count: int, noise_px: float, seed: int = 0
) -> dict[str, dict[str, BoardView]]:
    """Waves a board about in the middle of the room; each camera sees those that face it."""
    rng = np.random.default_rng(seed)
    views = {}
    for index, pose in enumerate(turned_to(rig, random_poses(count, seed))):
        found = {camera.name: seen(camera, board, pose, noise_px, rng) for camera in rig}
        views[f"moment_{index}"] = {name: view for name, view in found.items() if view is not None}
    return views


def looking_at(
    name: str,
    place: np.ndarray,
    target: np.ndarray,
    matrix: np.ndarray,
    size=(1280, 720),
    distortion=(),
) -> Camera:
    """Returns a camera that looks from one place to another, upright."""
    forward = (target - place) / np.linalg.norm(target - place)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(forward, right), forward])
    return Camera(
        name, size, matrix, np.array(distortion, dtype=float), rotation, -rotation @ place
    )


def room(
    count: int = 4,
    radius_m: float = 4.0,
    seed: int = 0,
    size: tuple[int, int] = (1280, 720),
    arc_deg: float = 180,
) -> Rig:
    """Returns cameras on part of a circle about the middle of a room, of different heights."""
    rng = np.random.default_rng(seed)
    cameras = []
    for index, angle in enumerate(np.linspace(0, np.radians(arc_deg), count)):
        place = np.array(
            [radius_m * np.cos(angle), radius_m * np.sin(angle), rng.uniform(1.0, 2.2)]
        )
        focal = rng.uniform(850, 950) * size[0] / 1280
        matrix = np.array([[focal, 0, size[0] / 2], [0, focal, size[1] / 2], [0, 0, 1]])
        cameras.append(
            looking_at(
                f"cam_{index}", place, np.array([0, 0, 1.0]), matrix, size, (-0.1, 0.05, 0.001, 0.0)
            )
        )
    return Rig(tuple(cameras))


def without_poses(rig: Rig) -> Rig:
    """Forgets where cameras stand."""
    return Rig(
        tuple(replace(camera, rotation=np.eye(3), translation=np.zeros(3)) for camera in rig)
    )


class BoardCamera:
    """Pictures that a camera takes of a board."""

    def __init__(self, camera: Camera, board: Board, seed: int = 0) -> None:
        """Prepares what is the same in every picture."""
        self.camera, self.board = camera, board
        self.rng = np.random.default_rng(seed)
        width, height = camera.size
        # Straight lines first, in a picture with room around it, then bent by the lens.
        straight = camera.pinhole(_FINER)
        room_px = _ROOM * _FINER
        shifted = straight.matrix + np.array([[0, 0, room_px], [0, 0, room_px], [0, 0, 0]])
        self.fine = replace(
            straight,
            matrix=shifted,
            size=(straight.size[0] + 2 * room_px, straight.size[1] + 2 * room_px),
        )
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        ideal = (
            (camera.undistort(np.column_stack([x.ravel(), y.ravel()])) + 0.5) * _FINER
            - 0.5
            + room_px
        )
        self.maps = cv2.resize(
            ideal.astype(np.float32).reshape(height, width, 2),
            straight.size,
            interpolation=cv2.INTER_LINEAR,
        )
        self.texture = 25 + 0.8 * board_picture(board, _TEXTURE_PX).astype(np.float32)
        rough = self.rng.normal(120, 20, (height // 40 + 2, width // 40 + 2)).astype(np.float32)
        self.wall = cv2.resize(rough, self.fine.size, interpolation=cv2.INTER_CUBIC)

    def picture(self, pose: Pose) -> NDArray[np.uint8]:
        """Returns (H, W, 3) uint8 of a board whose middle is at a pose in the world, before a
        blurred wall, with sensor noise.
        """
        turn = self.camera.rotation @ pose[0]
        middle = self.camera.rotation @ pose[1] + self.camera.translation
        fine = self.wall.copy()
        corner = middle - turn @ self.board.points_m.mean(axis=0)
        if middle @ turn[:, 2] > 0 and middle[2] > 0:  # its face is seen
            side = self.board.square_m / _TEXTURE_PX
            from_texture = np.array(
                [
                    [side, 0, 0.5 * side - 2 * self.board.square_m],
                    [0, side, 0.5 * side - 2 * self.board.square_m],
                    [0, 0, 1],
                ]
            )
            homography = (
                self.fine.matrix @ np.column_stack([turn[:, 0], turn[:, 1], corner]) @ from_texture
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
