"""What lies inside the outline: where the person has the colours of the head, and shading.

The proposal finds the head without colours, pictures then tell which colours it has, and what else
has them tells where bare arms and hands lie before the body. How bright each place is, relative to
others of its colour, tells which way it faces. Beyond paper A, which names the inside of the
outline as further work (section 7).
"""

from collections.abc import Sequence

import cv2
import numpy as np

from calib.camera import Camera
from calib.checks import BoolArray, Float32Array, FloatArray
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.image.head_colours import ColourCrop, HeadColours
from silhouette_core.image.shading import ColourBrightness, relative_shading
from silhouette_core.monocular.person import Person
from silhouette_core.monocular.proposal.silhouette_features import (
    FULL,
    GRID,
    InsideGrids,
    counted,
    shading_grid,
)
from silhouette_core.monocular.tuning import HEAD
from silhouette_core.monocular.window import Window

_NECK, _TOP = LANDMARK_NAMES.index("neck"), LANDMARK_NAMES.index("head_top")


class ColourEvidence:
    """Colours of the head, and where they are in a window.

    Args:
        camera: pinhole camera without distortion.
    """

    def __init__(self, camera: Camera):
        self.camera = camera
        self._colours = HeadColours()
        self._likelihood: Float32Array | None = None
        self._brightness = ColourBrightness()
        self._mean = self._brightness.mean()

    def learn(self, people: Sequence[Person], joints_m: Sequence[FloatArray]) -> bool:
        """Learns the colours from frames; returns whether they are known now.

        Args:
            people: n silhouettes with colours, or without, which are passed over.
            joints_m: n poses' joints (15, 3) in the world.
        """
        for person, joints in zip(people, joints_m, strict=True):
            if person.colours is not None:
                head = self._head(joints, person.colours)
                crop, inside = person.colours, person.colours.part(person.mask)
                self._colours.add(crop.bins, head, inside)
                self._brightness.add(crop.chromaticity[inside], crop.grey[inside])
        self._likelihood = self._colours.likelihood()
        self._mean = self._brightness.mean()
        return self._likelihood is not None

    def inside(self, window: Window, person: Person) -> InsideGrids | None:
        """Grids (60, 80) of what lies inside the silhouette in a window.

        Returns:
            The grids, or None if the colours are not known.
        """
        if self._likelihood is None or person.colours is None:
            return None
        crop = person.colours
        mask = crop.part(person.mask)
        view = _half_size(window)
        skin = self._warped(self._likelihood[crop.bins] * mask, crop.corner, *view)
        relative = relative_shading(crop.chromaticity, crop.grey, self._mean, mask)
        return InsideGrids(
            np.clip(np.rint(counted(skin)), 0, FULL).astype(np.uint8),
            shading_grid(counted(self._warped(relative, crop.corner, *view))),
        )

    def _warped(
        self,
        image: Float32Array,
        corner: tuple[int, int],
        matrix: FloatArray,
        rotation: FloatArray,
        shape: tuple[int, ...],
    ) -> Float32Array:
        """Part (h, w) of the picture, whose first pixel is at a corner, as a virtual camera sees
        it: its matrix, rotation from the world, and height and width.
        """
        left, top = corner
        camera_from_virtual = (
            np.array([[1, 0, -left], [0, 1, -top], [0, 0, 1]])
            @ self.camera.matrix
            @ self.camera.rotation
            @ rotation.T
            @ np.linalg.inv(matrix)
        )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        size = shape[1], shape[0]
        return np.asarray(
            cv2.warpPerspective(image, camera_from_virtual, size, flags=flags), np.float32
        )

    def _head(self, joints_m: FloatArray, crop: ColourCrop) -> BoolArray:
        """Pixels (h, w) bool of the head in a crop."""
        neck, top = joints_m[_NECK], joints_m[_TOP]
        ends, depth = self.camera.project(np.stack([neck + HEAD.from_neck * (top - neck), top]))
        head = np.zeros(crop.bins.shape, np.uint8)
        if not np.isfinite(ends).all():  # behind the camera
            return head.astype(bool)
        length = float(np.linalg.norm(top - neck))
        radius = HEAD.radius * length * self.camera.matrix[0, 0] / max(float(depth[0]), 0.1)
        one, other = (tuple(int(v) for v in np.round(end - crop.corner)) for end in ends)
        cv2.line(head, one, other, 1, max(1, round(2 * radius)))
        return head.astype(bool)


def _half_size(window: Window) -> tuple[FloatArray, FloatArray, tuple[int, int]]:
    """Matrix, rotation from the world, height and width of a window's camera at half the size."""
    rows, columns = 2 * GRID[0], 2 * GRID[1]
    focal = window.focal_px / 2
    matrix = np.array([[focal, 0, (columns - 1) / 2], [0, focal, (rows - 1) / 2], [0, 0, 1]])
    return matrix, window.world_from_virtual.T, (rows, columns)
