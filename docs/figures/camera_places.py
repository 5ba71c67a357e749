"""Draws the plan of camera places: `python -m docs.figures.camera_places` writes
docs/images/camera_places.png and prints how tightly other arrangements enclose the body.

The number under a plan is the volume of the visual hull over that of the body, the mean over poses
of the demo's actor, whose silhouettes are exact here: the smaller, the more the cameras say.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera, Rig
from docs.figures.drawing import INK, POSITIVE, QUIET, blank, centred, save
from silhouette_core.image.raster import render_parts
from voxelpose.demo.choreography import performances
from voxelpose.demo.mannequin import Mannequin
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.view.images.canvas import LEFT, Image, dots, stroke, tint

VOLUME_RADIUS_M, REACH_M = 1.0, 2.2  # of the floor that is used; of raised hands
LOW_M, HIGH_M = 1.2, 2.2
DISTANCE_M = 4.0
VERTICAL_VIEW_DEG = 45.0

# Azimuth from the front, degrees, and height, m.
PLACES: dict[int, tuple[tuple[float, float], ...]] = {
    3: ((-60, LOW_M), (0, HIGH_M), (60, LOW_M)),
    4: ((-67.5, LOW_M), (-22.5, HIGH_M), (22.5, LOW_M), (67.5, HIGH_M)),
    # 30 degrees apart on a half circle, with every other one on the opposite side.
    6: tuple(
        (azimuth, (LOW_M, HIGH_M)[k % 2])
        for k, azimuth in enumerate((-165, -105, -75, -15, 45, 135))
    ),
}
OTHERS: dict[str, tuple[tuple[float, float], ...]] = {
    "2, 90 degrees apart": ((-45, LOW_M), (45, LOW_M)),
    "2, face to face": ((-90, LOW_M), (90, LOW_M)),
    "3, 120 degrees apart": ((-120, LOW_M), (0, HIGH_M), (120, LOW_M)),
    "3, 30 degrees apart": ((-30, LOW_M), (0, HIGH_M), (30, LOW_M)),
    "4, in the corners, one height": tuple((45 + 90 * k, LOW_M) for k in range(4)),
    "4, in the corners, two heights": tuple(
        (45 + 90 * k, (LOW_M, HIGH_M)[k // 2]) for k in range(4)
    ),
    "6, half a circle": tuple((30 * k - 75, (LOW_M, HIGH_M)[k % 2]) for k in range(6)),
    "6, 60 degrees apart, two heights": tuple((60 * k, (LOW_M, HIGH_M)[k % 2]) for k in range(6)),
    "6, 60 degrees apart, one height": tuple((60 * k, LOW_M) for k in range(6)),
}
_PANEL, _PX_PER_M = (380, 430), 40.0
_SIZE = (960, 540)


def rig_of(places: tuple[tuple[float, float], ...]) -> Rig:
    """Cameras at places, turned to the middle of the volume."""
    focal = _SIZE[1] / 2 / np.tan(np.radians(VERTICAL_VIEW_DEG / 2))
    matrix = np.array([[focal, 0, (_SIZE[0] - 1) / 2], [0, focal, (_SIZE[1] - 1) / 2], [0, 0, 1]])
    cameras = []
    for k, (azimuth, height) in enumerate(places):
        angle = np.radians(azimuth)
        centre = np.array([DISTANCE_M * np.sin(angle), -DISTANCE_M * np.cos(angle), height])
        ahead = np.array([0, 0, REACH_M / 2]) - centre
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0, 0, 1.0])
        right /= np.linalg.norm(right)
        rotation = np.stack([right, np.cross(ahead, right), ahead])
        cameras.append(
            Camera(f"cam_{k + 1}", _SIZE, matrix, np.zeros(0), rotation, -rotation @ centre)
        )
    return Rig(tuple(cameras))


def hull_excess(places: tuple[tuple[float, float], ...]) -> float:
    """Volume of the visual hull over that of the body, mean over some poses."""
    actor, played = Mannequin.build(), performances()["three_seconds"]
    every = rig_of(tuple((15.0 * k, (LOW_M, HIGH_M)[k % 2]) for k in range(24)))
    ratios = []
    for time_s in np.linspace(0, 2.9, 6):
        vertices, _ = actor.pose(*played.pose_at(float(time_s)))
        grid = VoxelGrid.from_bounds(vertices.min(0) - 0.6, vertices.max(0) + 0.6, 0.02)
        volumes = [
            int(carve(rig, _masks(rig, vertices, actor.faces), grid).sum())
            for rig in (rig_of(places), every)
        ]
        ratios.append(volumes[0] / volumes[1])
    return float(np.mean(ratios))


def plan(count: int) -> Image:
    """Plan of the places of 3, 4 or 6 cameras."""
    width, height = _PANEL
    panel = blank(width, height)
    middle = np.array([width / 2, 218.0])
    circle = np.column_stack([f(np.linspace(0, 2 * np.pi, 90)) for f in (np.cos, np.sin)])
    centred(panel, f"{count} cameras", width / 2, 30, 20, INK, bold=True)
    stroke(panel, middle + circle * DISTANCE_M * _PX_PER_M, (216, 210, 204), 1, closed=True)
    for azimuth, _ in PLACES[count]:  # what each camera sees
        _view(panel, middle, azimuth)
    tint(panel, [middle + circle * VOLUME_RADIUS_M * _PX_PER_M], LEFT, 0.25)
    _person(panel, middle)
    for azimuth, camera_height in PLACES[count]:
        angle = np.radians(azimuth)
        out = np.array([np.sin(angle), np.cos(angle)])
        at = middle + out * DISTANCE_M * _PX_PER_M
        dots(panel, at[None], 7, POSITIVE if camera_height == HIGH_M else INK)
        label = at + np.array([0, 22 if out[1] > 0 else -14])
        centred(panel, f"{camera_height:g} m", label[0], label[1], 15)
    excess = hull_excess(PLACES[count])
    centred(panel, f"hull {excess:.2f} × the body", width / 2, height - 12, 15, QUIET)
    print(f"{count}: {excess:.2f}")
    return panel


def main() -> None:
    """Writes the picture and prints the other arrangements."""
    plans = np.concatenate([plan(count) for count in PLACES], axis=1)
    foot = blank(plans.shape[1], 62)
    centred(
        foot,
        f"Plan, {DISTANCE_M:g} m from the middle; blue: floor of the movement,"
        f" {2 * VOLUME_RADIUS_M:g} m"
        " across; the person looks down the page.",
        foot.shape[1] / 2,
        20,
        15,
    )
    centred(
        foot,
        f"Heights of the lenses: black {LOW_M:g} m, red {HIGH_M:g} m, all turned to the middle at"
        f" {REACH_M / 2:g} m.",
        foot.shape[1] / 2,
        44,
        15,
    )
    save(np.concatenate([plans, foot]), "camera_places.png")
    for name, places in OTHERS.items():
        print(f"{name}: {hull_excess(places):.2f}")


def _masks(
    rig: Rig, vertices: NDArray[np.float64], faces: NDArray[np.int32]
) -> list[NDArray[np.bool_]]:
    one = np.zeros(len(faces), np.int32)
    return [
        render_parts(vertices @ c.rotation.T + c.translation, faces, one, c.matrix, c.size)[0] > 0
        for c in rig
    ]


def _view(panel: Image, middle: NDArray[np.float64], azimuth_deg: float) -> None:
    """Shades the part of the floor that a camera sees."""
    half = np.arctan(np.tan(np.radians(VERTICAL_VIEW_DEG / 2)) * _SIZE[0] / _SIZE[1])
    angle = np.radians(azimuth_deg)
    at = middle + np.array([np.sin(angle), np.cos(angle)]) * DISTANCE_M * _PX_PER_M
    sides = [
        at - np.array([np.sin(angle + turn), np.cos(angle + turn)]) * 5.0 * _PX_PER_M
        for turn in (-half, half)
    ]
    tint(panel, [np.stack([at, *sides])], (196, 214, 110), 0.13)


def _person(panel: Image, middle: NDArray[np.float64]) -> None:
    """Draws a person from above who looks down the page."""
    x, y = (int(v) for v in middle)
    cv2.ellipse(panel, (x, y), (10, 5), 0, 0, 360, QUIET, cv2.FILLED, cv2.LINE_AA)
    cv2.circle(panel, (x, y), 5, INK, cv2.FILLED, cv2.LINE_AA)
    stroke(panel, middle + np.array([(-4.0, 5.0), (0.0, 12.0), (4.0, 5.0)]), INK, 2)


if __name__ == "__main__":
    main()
