"""The fitted body over a camera's picture: tinted sides, outline, skeleton."""

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.joints import LANDMARK_NAMES, PART_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.image.raster import render_parts
from silhouette_core.motion import kinematics
from voxelpose.view.images import canvas

_SIDES: tuple[canvas.Colour, ...] = (canvas.MIDDLE, canvas.LEFT, canvas.RIGHT)
PartPoses = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Rotations (P, 3, 3), world from part, and joints (P, 3) m in the world."""
_LIMBS = "neck upper_arm forearm hand fingers", "pelvis thigh shin foot toes"


def skeleton_bones(model: BodyModel) -> list[tuple[int, int, canvas.Colour]]:
    """Lines of the skeleton: joints at both ends, as rows of `skeleton_joints`, and the colour."""
    if model.names != PART_NAMES:
        marks, first = model.tree.landmark_names, len(model.names)
        bones = model.tree.landmark_bones.tolist()
        return [(first + start, first + end, canvas.colour_of(marks[end])) for start, end in bones]
    joints = (*PART_NAMES, "head_top")
    chains = ["pelvis lumbar upper_thorax neck head head_top".split()]
    for side in ("left_", "right_"):
        chains += [
            [names[0], *(side + name for name in names[1:])]
            for names in (limb.split() for limb in _LIMBS)
        ]
    return [
        (joints.index(start), joints.index(end), canvas.colour_of(end))
        for chain in chains
        for start, end in pairwise(chain)
    ]


def bone_ends(bones: list[tuple[int, int, canvas.Colour]]) -> NDArray[np.int64]:
    """Joints (B, 2) int64 at both ends of the lines of `skeleton_bones`; a body may have none."""
    return np.array([bone[:2] for bone in bones], np.int64).reshape(-1, 2)


def skeleton_joints(
    model: BodyModel, rotation: NDArray[np.float64], origin: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Joints of the skeleton's lines in the world, of parts rotated by (P, 3, 3) world from part,
    with joints (P, 3) m.

    Returns:
        (28, 3) metres: the parts' joints and the vertex of the head; of a body that is no person's
            (P + L, 3), the parts' joints and the landmarks.
    """
    marks = kinematics.landmarks(model, rotation[None], origin[None])[0]
    if model.names != PART_NAMES:
        return np.vstack([origin, marks])
    return np.vstack([origin, marks[LANDMARK_NAMES.index("head_top")]])


def body_parts(
    model: BodyModel, vertices_m: NDArray[np.float64], camera: Camera, cull_back: bool = False
) -> NDArray[np.integer]:
    """Part numbers (h, w), 0 beside it, else part + 1, of vertices (V, 3) m by a pinhole."""
    in_camera = vertices_m @ camera.rotation.T + camera.translation
    faces, face_part = model.faces, model.face_part
    return render_parts(in_camera, faces, face_part, camera.matrix, camera.size, cull_back)[0]


class FigurePainter:
    """Draws one body into the pictures of one camera, which stay as recorded: with the lens's
    distortion.
    """

    def __init__(
        self,
        model: BodyModel,
        camera: Camera,
        scale: float = 1.0,
        unknown: NDArray[np.bool_] | None = None,
        colour: canvas.Colour | None = None,
    ) -> None:
        """Prepares for a body and a camera; `unknown`, (H, W) bool, is hatched. `colour` is the
        body's; None: its sides differ.
        """
        self.model, self.camera, self.scale = model, camera, scale
        self._unknown = unknown
        self.ideal = camera.pinhole(scale)  # of the working picture, `scale` times the recorded
        self.size = self.ideal.size  # width and height
        self._side = np.array([-1] + [_SIDES.index(canvas.colour_of(name)) for name in model.names])
        self._colours = _SIDES
        if colour is not None:
            self._side, self._colours = np.minimum(self._side, 0), (colour,)
        self._bones = skeleton_bones(model)
        self._ends = bone_ends(self._bones)

    def resized(self, frame: canvas.Image) -> canvas.Image:
        """Copy of a recorded frame at the working size."""
        if self._unknown is not None:
            frame = canvas.hatched(frame, self._unknown)
        if self.scale == 1.0:
            return frame.copy()
        method = cv2.INTER_AREA if self.scale < 1.0 else cv2.INTER_CUBIC
        return np.asarray(cv2.resize(frame, self.size, interpolation=method), np.uint8)

    def paint(
        self, image: canvas.Image, rotation: NDArray[np.float64], origin: NDArray[np.float64]
    ) -> canvas.Image:
        """Draws one pose, rotations (P, 3, 3) world from part and joints (P, 3) m in the world,
        into an image (h, w, 3) uint8 BGR at the working size (see `resized`), in place; returns it.
        """
        parts = body_parts(self.model, kinematics.skin(self.model, rotation, origin), self.ideal)
        left, top, width, height = cv2.boundingRect((parts > 0).view(np.uint8))
        if not width:
            return image
        parts = parts[top : top + height, left : left + width]
        line = max(1, round((height - 1) / 300))
        for side, colour in enumerate(self._colours):
            outlines = self._outlines(self._side[parts] == side, (left, top))
            canvas.tint(image, outlines, colour, 0.33)
            for outline in outlines:
                canvas.stroke(image, outline, colour, line, closed=True)
        for outline in self._outlines(parts > 0, (left, top)):
            canvas.stroke(image, outline, canvas.INK, line, closed=True)
        self._skeleton(image, rotation, origin, line)
        return image

    def pixels(self, points_world: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels (N, 2) of points (N, 3), metres, in the working picture; NaN where not visible."""
        recorded, _ = self.camera.project(points_world)
        return (recorded + 0.5) * self.scale - 0.5

    def _skeleton(
        self,
        image: canvas.Image,
        rotation: NDArray[np.float64],
        origin: NDArray[np.float64],
        line: int,
    ) -> None:
        joints = self.pixels(skeleton_joints(self.model, rotation, origin))
        ends = joints[self._ends]
        canvas.segments(image, ends, canvas.PAPER, line + 3)
        for colour in _SIDES:
            bones = ends[[bone[2] == colour for bone in self._bones]]
            drawn = canvas.dashed(bones) if colour == canvas.RIGHT else bones
            canvas.segments(image, drawn, colour, line + 1)
        marked = joints[np.unique(self._ends)]
        canvas.dots(image, marked, line + 1.3, canvas.PAPER)
        canvas.dots(image, marked, line + 0.3, canvas.INK)

    def _outlines(
        self, mask: NDArray[np.bool_], corner: tuple[int, int]
    ) -> list[NDArray[np.float64]]:
        """Closed borders (N, 2) of a mask whose first pixel is the pinhole picture's `corner`, in
        px of the working picture.
        """
        contours, _ = cv2.findContours(
            mask.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_NONE, offset=corner
        )
        outlines = [np.asarray(outline, float)[:, 0] for outline in contours if len(outline) > 4]
        if self.camera.is_pinhole:
            return outlines
        rays = (self.ideal.rays(outline) for outline in outlines)
        return [self.pixels(origin + directions) for origin, directions in rays]


class PeoplePainter:
    """Draws several people's bodies into the pictures of one camera, each in a colour of its own;
    one person's as `FigurePainter` does.
    """

    def __init__(
        self,
        models: Sequence[BodyModel],
        camera: Camera,
        scale: float = 1.0,
        unknown: NDArray[np.bool_] | None = None,
    ) -> None:
        """Prepares for some bodies and a camera; `unknown`, (H, W) bool, is hatched."""
        colours = [None] if len(models) == 1 else canvas.PEOPLE
        self.camera = camera
        self._painters = [
            FigurePainter(model, camera, scale, unknown, colours[k % len(colours)])
            for k, model in enumerate(models)
        ]
        self.size = self._painters[0].size
        self.resized = self._painters[0].resized

    def paint(self, image: canvas.Image, poses: Sequence[PartPoses | None]) -> None:
        """Draws everybody's pose, as of `FigurePainter.paint`, in place, the farthest first."""
        posed = [(pose, k) for k, pose in enumerate(poses) if pose is not None]
        posed.sort(key=lambda person: -np.linalg.norm(person[0][1][0] - self.camera.center_m))
        for (rotation, origin), k in posed:
            self._painters[k].paint(image, rotation, origin)
