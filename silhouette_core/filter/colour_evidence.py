"""What lies inside the outline: where the person has the colours of the head.

The proposal finds the head without colours, pictures then tell which colours it has, and what else
has them tells where bare arms and hands lie before the body. Beyond paper A, which names the inside
of the outline as further work (section 7).
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.camera import Camera
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.filter.person import Person
from silhouette_core.filter.window import Window
from silhouette_core.image.head_colours import ColourCrop, HeadColours
from silhouette_core.proposal.silhouette_features import FULL, GRID, counted

_NECK, _TOP = LANDMARK_NAMES.index("neck"), LANDMARK_NAMES.index("head_top")
_LOWEST = 0.35  # of the way from the neck to the top of the head: above it is the head
_RADIUS = 0.15  # of the head, relative to that way


class ColourEvidence:
    """Colours of the head, and where they are in a window.

    Args:
        camera: pinhole camera without distortion.
    """

    def __init__(self, camera: Camera):
        """Knows no colours yet."""
        self.camera = camera
        self._colours = HeadColours()
        self._likelihood: NDArray[np.float32] | None = None

    def learn(
        self, people: Sequence[Person], joints_m: Sequence[NDArray[np.float64]], memory: float
    ) -> bool:
        """Learns the colours from frames; returns whether they are known now.

        Args:
            people: n silhouettes with colours, or without, which are passed over.
            joints_m: n poses' joints (15, 3) in the world.
            memory: weight of all earlier frames.
        """
        self._colours.fade(memory)
        for person, joints in zip(people, joints_m, strict=True):
            if person.colours is not None:
                head = self._head(joints, person.colours)
                self._colours.add(person.colours.bins, head, person.colours.part(person.mask))
        self._likelihood = self._colours.likelihood()
        return self._likelihood is not None

    def skin(self, window: Window, person: Person) -> NDArray[np.uint8] | None:
        """Grid (60, 80) uint8, 0 to 4, of what has the colours of the head in a window.

        Args:
            window: about the silhouette.
            person: silhouette and colours.

        Returns:
            The grid, or None if the colours are not known.
        """
        if self._likelihood is None or person.colours is None:
            return None
        crop = person.colours
        likelihood = self._likelihood[crop.bins] * crop.part(person.mask)
        left, top = crop.corner
        rows, columns = 2 * GRID[0], 2 * GRID[1]
        focal = window.focal_px / 2
        from_window = np.array(
            [[focal, 0, (columns - 1) / 2], [0, focal, (rows - 1) / 2], [0, 0, 1]]
        )
        camera_from_window = (
            np.array([[1, 0, -left], [0, 1, -top], [0, 0, 1]])
            @ self.camera.matrix
            @ self.camera.rotation
            @ window.world_from_virtual
            @ np.linalg.inv(from_window)
        )
        seen = cv2.warpPerspective(
            likelihood,
            camera_from_window,
            (columns, rows),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        )
        return np.clip(np.rint(counted(seen)), 0, FULL).astype(np.uint8)

    def _head(self, joints_m: NDArray[np.float64], crop: ColourCrop) -> NDArray[np.bool_]:
        """Pixels (h, w) bool of the head in a crop."""
        neck, top = joints_m[_NECK], joints_m[_TOP]
        ends, depth = self.camera.project(np.stack([neck + _LOWEST * (top - neck), top]))
        head = np.zeros(crop.bins.shape, np.uint8)
        if not np.isfinite(ends).all():  # behind the camera
            return head.astype(bool)
        length = float(np.linalg.norm(top - neck))
        radius = _RADIUS * length * self.camera.matrix[0, 0] / max(float(depth[0]), 0.1)
        one, other = (tuple(int(v) for v in np.round(end - crop.corner)) for end in ends)
        cv2.line(head, one, other, 1, max(1, round(2 * radius)))
        return head.astype(bool)
