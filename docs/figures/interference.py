"""Reproduces Fig. 2 of Iiyama, Kameda and Minoh: docs/images/interference.png.

`python -m docs.figures.interference` writes it. A person stands with the left leg crossed in front
of the right one. Matched part by part, the left shin is placed in the right shin's voxels, which
explain it just as well; matched jointly, each shin has its own. The voxels are the visual hull of
the demo's mannequin, which shares nothing with the body that is matched. As in the paper the root
part is given, and no part is scored by the parts attached to it.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from calib.camera import Camera, Rig
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.image.raster import render_parts
from silhouette_core.motion.dynamics import RELAXED_RAD
from silhouette_core.motion.kinematics import forward, landmarks, quaternions
from silhouette_core.motion.pose import Pose
from silhouette_core.scoring.silhouette_error import posed_mesh
from voxelpose.demo.mannequin import STATURE_M, Mannequin
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.matching.body_volume import BodyVolume
from voxelpose.multiview.matching.matcher import Match, MatchSettings, match
from voxelpose.view.images.canvas import colour_of, text_width, write_text

PICTURE = Path(__file__).parents[1] / "images" / "interference.png"
VOXEL_M = 0.02
# Degrees: a turn of the thigh forward and toward the other side, of the knee backward.
CROSSED = {"left": (20, 14, 14), "right": (-5, 12, 14)}

_PANEL, _FINE = (440, 700), 2  # width and height of a panel; rendered this many times larger
_AZIMUTH, _ELEVATION = np.radians(-68), np.radians(9)
_FOCAL, _DISTANCE_M = 5.0, 9.9  # focal length in panel heights
_BACKGROUND, _TEXT, _QUIET = (247, 244, 240), (52, 44, 40), (128, 118, 110)
_LIMBS = ("upper_arm", "forearm", "hand", "thumb", "fingers", "thigh", "shin", "foot", "toes")
_VOXEL, _TRUNK = np.array([182.0, 204.0, 222.0]), (205, 208, 210)


@dataclass(frozen=True, eq=False)
class Example:
    """Voxels of one body, and another body that is matched to them.

    Attributes:
        grid: position and size of the voxels.
        occupancy: (nx, ny, nz) bool.
        joints_m: (15, 3) true joints, in the order of LANDMARK_NAMES.
        body_volume: the body that is matched.
        root: its root part placed, with relaxed joints.
    """

    grid: VoxelGrid
    occupancy: NDArray[np.bool_]
    joints_m: NDArray[np.float64]
    body_volume: BodyVolume
    root: Pose


def make_example() -> Example:
    """Visual hull of the posed mannequin, seen from all sides."""
    turns = {}
    for side, sign in (("left", 1), ("right", -1)):
        hip, inward, knee = CROSSED[side]
        turns[f"{side}_thigh"] = _turn(-hip, sign * inward)
        turns[f"{side}_shin"] = _turn(knee)
        turns[f"{side}_foot"] = _turn(hip - knee)
        turns[f"{side}_upper_arm"] = _turn(0, -sign * 8)
        turns[f"{side}_forearm"] = _turn(-10)
    actor = Mannequin.build()
    vertices, joints = actor.pose(np.zeros(2), turns)
    rig = _cameras()
    part = np.zeros(len(actor.faces), np.int32)
    masks = [
        render_parts(vertices @ c.rotation.T + c.translation, actor.faces, part, c.matrix, c.size)[
            0
        ]
        > 0
        for c in rig
    ]
    grid = VoxelGrid.from_bounds(vertices.min(0) - 0.1, vertices.max(0) + 0.1, VOXEL_M)
    model = BodyModel.from_sizes(BodySizes(STATURE_M, sex="male"))
    hips = [LANDMARK_NAMES.index(name) for name in ("left_hip", "right_hip")]
    true = np.stack([joints[name] for name in LANDMARK_NAMES])
    root = true[hips].mean(0) - model.landmarks_m[hips].mean(0) + model.joints_m[0]
    return Example(
        grid,
        carve(rig, masks, grid),
        true,
        BodyVolume.from_model(model, VOXEL_M, "cpu"),
        Pose(root, np.eye(3), RELAXED_RAD.copy()),
    )


def match_example(
    example: Example, interference: bool, step_rad: float = MatchSettings.step_rad
) -> Match:
    """Posture by the paper's matcher, with or without interference."""
    settings = MatchSettings(step_rad=step_rad, interference=interference)
    return match(example.body_volume, example.grid, example.occupancy, example.root, settings)


def matched_joints(example: Example, result: Match) -> dict[str, NDArray[np.float64]]:
    """Position (3,) m of each joint in a matched pose."""
    model, pose = example.body_volume.model, result.pose
    placed = landmarks(
        model,
        *forward(
            model, pose.root_m[None], quaternions(pose.root_rotation[None]), pose.angles_rad[None]
        ),
    )
    return dict(zip(LANDMARK_NAMES, placed[0], strict=True))


def errors_m(example: Example, result: Match) -> dict[str, float]:
    """Distance of each joint from the truth, metres."""
    joints = matched_joints(example, result)
    return {
        name: float(np.linalg.norm(joints[name] - example.joints_m[k]))
        for k, name in enumerate(LANDMARK_NAMES)
    }


def draw(example: Example, plain: Match, joint: Match) -> NDArray[np.uint8]:
    """Three panels: voxels, parts one by one, parts jointly; (h, w, 3) uint8, BGR."""
    vertices, faces, tone = _cubes(example.grid, example.occupancy)
    numbers, depth = _render(_to_viewer(vertices), faces, tone)
    # Six directions, brightest above; every other voxel a little darker, so that each can be seen.
    light = np.repeat([0.94, 0.80, 0.86, 1.0, 1.1, 0.7], 2) * np.tile([1.0, 0.93], 6)
    voxels = _ground(vertices)
    inside = numbers > 0
    weight = cv2.GaussianBlur(inside.astype(np.float32), (0, 0), 6.0 * _FINE)
    rounded = cv2.GaussianBlur(np.where(inside, depth, 0), (0, 0), 6.0 * _FINE) / np.maximum(
        weight, 1e-6
    ) + (weight < 1e-6)
    voxels[inside] = (light[numbers[inside].astype(int) - 1] * _light(rounded)[inside])[
        :, None
    ] * _VOXEL
    contours, _ = cv2.findContours(inside.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE)
    outline = [np.asarray(contour, np.int32) for contour in contours]
    worst = [
        max(errors_m(example, result).items(), key=lambda item: item[1])
        for result in (plain, joint)
    ]
    panels = (
        (voxels, "(a) voxels", "of a body of another shape"),
        (
            _body(example, plain, outline),
            "(b) part by part",
            f"{worst[0][0].replace('_', ' ')} {100 * worst[0][1]:.0f} cm off",
        ),
        (
            _body(example, joint, outline),
            "(c) interfering parts at once",
            f"no joint more than {100 * worst[1][1]:.0f} cm off",
        ),
    )
    return np.concatenate([_captioned(*panel) for panel in panels], axis=1)


def main() -> None:
    """Writes the figure."""
    parser = argparse.ArgumentParser(description="Reproduces Fig. 2 of Iiyama, Kameda and Minoh.")
    parser.add_argument(
        "file",
        nargs="?",
        type=Path,
        default=PICTURE,
        help="where to write (default: the figure of the docs)",
    )
    file = parser.parse_args().file
    example = make_example()
    image = draw(example, match_example(example, False), match_example(example, True))
    file.parent.mkdir(parents=True, exist_ok=True)
    if not cv2.imwrite(str(file), image, [cv2.IMWRITE_PNG_COMPRESSION, 9]):
        raise SystemExit(f"{file} cannot be written")


def _turn(about_x: float = 0.0, about_y: float = 0.0) -> Rotation:
    return Rotation.from_euler("YX", [about_y, about_x], degrees=True)


def _cameras(count: int = 8) -> Rig:
    """Cameras all around at 3.5 m, alternately low and high."""
    cameras = []
    for k in range(count):
        angle = 2 * np.pi * (k + 0.3) / count
        centre = np.array([3.5 * np.sin(angle), -3.5 * np.cos(angle), (1.0, 2.4)[k % 2]])
        rotation = _facing(np.array([0, 0, 0.9]) - centre)
        matrix = np.array([[300, 0, 159.5], [0, 300, 159.5], [0, 0, 1.0]])
        cameras.append(
            Camera(f"cam_{k + 1}", (320, 320), matrix, np.zeros(0), rotation, -rotation @ centre)
        )
    return Rig(tuple(cameras))


def _facing(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3), camera from world, of an upright camera that faces a direction."""
    ahead = direction / np.linalg.norm(direction)
    right = np.cross(ahead, [0, 0, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(ahead, right), ahead])


def _cubes(
    grid: VoxelGrid, occupancy: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int32], NDArray[np.int32]]:
    """Visible sides of the voxels as triangles.

    Returns:
        Vertices, faces, and for each face twice the side's direction plus the voxel's parity.
    """
    padded = np.pad(occupancy, 1)
    corners, tones = [], []
    for direction in range(6):
        axis, sign = direction // 2, 1 - 2 * (direction % 2)
        voxels = np.argwhere(padded & ~np.roll(padded, -sign, axis)) - 1
        square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        offset = np.insert(square, axis, sign > 0, axis=1)
        corners.append((grid.lattice + voxels[:, None] + offset) * grid.voxel_size_m)
        tones.append(2 * direction + voxels.sum(1) % 2)
    vertices = np.concatenate(corners).reshape(-1, 3)
    first = 4 * np.arange(len(vertices) // 4)[:, None]
    faces = np.concatenate([first + np.array(half) for half in ((0, 1, 2), (0, 2, 3))]).astype(
        np.int32
    )
    return vertices, faces, np.tile(np.concatenate(tones), 2).astype(np.int32)


def _to_viewer(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """World points (N, 3) in the viewer's frame."""
    toward = np.array(
        [
            np.cos(_AZIMUTH) * np.cos(_ELEVATION),
            np.sin(_AZIMUTH) * np.cos(_ELEVATION),
            np.sin(_ELEVATION),
        ]
    )
    rotation = _facing(-toward)
    return (points - (0, 0, 0.83) - _DISTANCE_M * toward) @ rotation.T


def _render(
    seen: NDArray[np.float64], faces: NDArray[np.int32], number: NDArray[np.int32]
) -> tuple[NDArray, NDArray]:
    width, height = (_FINE * side for side in _PANEL)
    focal = _FOCAL * height
    matrix = np.array([[focal, 0, (width - 1) / 2], [0, focal, (height - 1) / 2], [0, 0, 1]])
    return render_parts(seen, faces, number, matrix, (width, height))


def _ground(vertices: NDArray[np.float64]) -> NDArray[np.float64]:
    """Empty panel with a soft shadow under the feet."""
    width, height = (_FINE * side for side in _PANEL)
    panel = np.full((height, width, 3), _BACKGROUND, float)
    feet = _to_viewer(vertices[vertices[:, 2] < 0.25] * (1, 1, 0))
    focal = _FOCAL * height
    pixels = np.rint(
        feet[:, :2] / feet[:, 2:] * focal + ((width - 1) / 2, (height - 1) / 2)
    ).astype(np.int32)
    shadow = np.zeros((height, width), np.float32)
    cv2.fillConvexPoly(shadow, cv2.convexHull(pixels), 1.0)
    shadow = cv2.GaussianBlur(shadow, (0, 0), 9 * _FINE)
    return np.asarray(panel * (1 - 0.22 * shadow[..., None]), np.float64)


def _body(
    example: Example, result: Match, outline: Sequence[NDArray[np.int32]]
) -> NDArray[np.float64]:
    """Panel of a matched body over the outline of the voxels."""
    model = example.body_volume.model
    vertices = posed_mesh(model, result.pose)
    parts, depth = _render(_to_viewer(vertices), model.faces, model.face_part)
    sides = np.array(
        [colour_of(name) if name.partition("_")[2] in _LIMBS else _TRUNK for name in model.names],
        float,
    )
    panel = _ground(vertices)
    cv2.drawContours(panel, outline, -1, (222, 214, 206), cv2.FILLED)
    cv2.drawContours(panel, outline, -1, (176, 166, 156), _FINE)
    inside = parts > 0
    colour = cv2.GaussianBlur(sides[np.maximum(parts, 1).astype(int) - 1], (0, 0), 1.5 * _FINE)
    panel[inside] = (_light(_without_ripples(depth, inside))[..., None] * colour)[inside]
    return panel


def _without_ripples(depth: NDArray[np.float32], inside: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Depth image smoothed where it does not jump."""
    filled = np.where(inside, depth, depth[inside].max()).astype(np.float32)
    return np.asarray(cv2.bilateralFilter(filled, 8 * _FINE - 1, 0.02, 3.0 * _FINE), np.float32)


def _light(depth: NDArray[np.floating]) -> NDArray[np.float64]:
    """Brightness of a smooth depth image by the slope of its surface."""
    focal = _FOCAL * _FINE * _PANEL[1]
    slope_y, slope_x = (np.gradient(depth, axis=axis) * focal / depth for axis in (0, 1))
    normal = np.stack([slope_x, slope_y, -np.ones_like(depth)], -1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    light = np.array([-0.45, -0.6, -0.66])
    return 0.50 + 0.58 * np.clip(normal @ (light / np.linalg.norm(light)), 0, 1)


def _captioned(panel: NDArray[np.float64], title: str, note: str) -> NDArray[np.uint8]:
    """Panel reduced to its final size, with a caption."""
    width, height = _PANEL
    small = cv2.resize(
        np.clip(panel, 0, 255).astype(np.uint8), (width, height), interpolation=cv2.INTER_AREA
    )
    foot = np.full((70, width, 3), _BACKGROUND, np.uint8)
    write_text(foot, title, (width - text_width(title, 20, True)) // 2, 22, 20, _TEXT, True)
    write_text(foot, note, (width - text_width(note, 16)) // 2, 50, 16, _QUIET)
    return np.asarray(np.concatenate([small, foot]), np.uint8)


if __name__ == "__main__":
    main()
