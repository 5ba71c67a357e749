"""Synthetic boards: what cameras see of a board that is waved about."""

import cv2
import numpy as np

from calib.board import Board, View
from calib.camera import Camera, Rig
from calib.rotation import matrix_from_rodrigues

CHECKERBOARD = Board(8, 5, 0.06)


def waved_poses(count: int, seed: int = 0, centre=(0.0, 0.0, 1.2), spread_m: float = 0.8) -> list[tuple[np.ndarray, np.ndarray]]:
    """Returns world-from-board rotations (3, 3) and translations (3,), m."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        rotation = matrix_from_rodrigues(rng.normal(size=3) * [0.5, 0.5, 1.0])
        poses.append((rotation, np.asarray(centre) + rng.uniform(-spread_m, spread_m, 3)))
    return poses


def seen(
    camera: Camera, board: Board, rotation: np.ndarray, translation: np.ndarray, noise_px: float, rng: np.random.Generator
) -> View | None:
    """Returns the view of a board placed in the world, or None if it does not show its face or all its corners."""
    points = (board.points_m - board.points_m.mean(axis=0)) @ rotation.T + translation
    facing = (points[0] - camera.center_m) @ rotation[:, 2] > 0.15 * np.linalg.norm(points[0] - camera.center_m)
    pixels, _ = camera.project(points)
    inside = np.isfinite(pixels).all() and (pixels > 0).all() and (pixels < np.array(camera.size) - 1).all()
    if not (facing and inside):
        return None
    return View(np.arange(len(points)), pixels + rng.normal(0, noise_px, pixels.shape), camera.size)


def lens_views(camera: Camera, count: int, noise_px: float, board: Board = CHECKERBOARD, seed: int = 0) -> dict[str, View]:
    """Returns `count` views of a board held before a camera that stands at the origin and looks along z."""
    rng = np.random.default_rng(seed)
    views: dict[str, View] = {}
    while len(views) < count:
        turn = matrix_from_rodrigues(rng.uniform(-0.7, 0.7, 3))
        place = np.array([rng.uniform(-0.4, 0.4), rng.uniform(-0.3, 0.3), 1.0]) * rng.uniform(0.5, 1.2)
        view = seen(camera, board, turn, place, noise_px, rng)
        if view is not None:
            views[f"picture_{len(views):02d}"] = view
    return views


def looking_at(name: str, place: np.ndarray, target: np.ndarray, matrix: np.ndarray, size=(1280, 720), distortion=()) -> Camera:
    """Returns a camera that looks from one place to another, upright."""
    forward = (target - place) / np.linalg.norm(target - place)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    rotation = np.array([right, np.cross(forward, right), forward])
    return Camera(name, size, matrix, np.array(distortion, dtype=float), rotation, -rotation @ place)


def room(count: int = 4, radius_m: float = 4.0, seed: int = 0) -> Rig:
    """Returns cameras on a half circle about the middle of a room, of different heights."""
    rng = np.random.default_rng(seed)
    cameras = []
    for index, angle in enumerate(np.linspace(0, np.pi, count)):
        place = np.array([radius_m * np.cos(angle), radius_m * np.sin(angle), rng.uniform(1.0, 2.2)])
        focal = rng.uniform(850, 950)
        matrix = np.array([[focal, 0, 640], [0, focal, 360], [0, 0, 1]])
        cameras.append(looking_at(f"cam_{index}", place, np.array([0, 0, 1.0]), matrix, distortion=(-0.1, 0.05, 0.001, 0.0)))
    return Rig(tuple(cameras))


def drawn(board: Board, square_px: int = 60, margin_px: int = 80) -> np.ndarray:
    """Draws a plain checkerboard, grey on white, seen straight on."""
    row, column = np.indices((board.rows + 1, board.columns + 1))
    squares = np.where((row + column) % 2 == 0, 30, 220).astype(np.uint8)
    picture = cv2.copyMakeBorder(
        np.kron(squares, np.ones((square_px, square_px), np.uint8)), *[margin_px] * 4, cv2.BORDER_CONSTANT, value=220
    )
    return picture
