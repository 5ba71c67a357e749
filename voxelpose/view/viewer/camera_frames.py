"""Pictures and silhouettes of single frames of a recording."""

from collections.abc import Mapping
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.errors import InputError
from silhouette_core.estimator import BackgroundKind
from silhouette_core.image.segmenter import load_segmenter
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView, scaled_unknown
from voxelpose.multiview.silhouettes.prepared_silhouettes import LONG_SIDE_PX, unknown_views
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import Frame, read_together
from voxelpose.view.viewer.scene import CameraFrame

_MOST_SKIPPED = 40  # frames that are rather decoded and discarded than reached from the start


class CameraFrames:
    """Reads frames in any order.

    A frame shortly after the last one is reached by reading on: videos are decoded from their
    start.
    """

    def __init__(
        self,
        recording: Recording,
        kind: BackgroundKind,
        views: Mapping[str, UndistortedView],
        segmenter: str | None = None,
    ) -> None:
        """Prepares; nothing is read before the first frame.

        Args:
            recording: the frames.
            kind: of their backgrounds.
            views: undistorted view of every camera by name.
            segmenter: that told where people are; without it where it cannot be used any more.
        """
        self._recording = recording
        self._kind: BackgroundKind = kind
        self._views, self._segmenter = views, segmenter
        self._next, self._frames = 0, None

    @cached_property
    def _silhouettes(self) -> Silhouettes:
        segmenter = self._segmenter
        try:
            if segmenter is not None:
                load_segmenter(segmenter)
        except InputError:
            segmenter = None
        return Silhouettes(self._recording, self._kind, LONG_SIDE_PX, segmenter=segmenter)

    @cached_property
    def unknown(self) -> tuple[NDArray[np.bool_], ...] | None:
        """Where nothing is known, (h, w) bool in every view; None: nowhere."""
        found = scaled_unknown(self._recording, LONG_SIDE_PX)
        return unknown_views(found, list(self._views.values()))

    def read(self, frame: int) -> tuple[CameraFrame, ...]:
        """Undistorted pictures and silhouettes of a frame, one per camera."""
        pictures = self._read(frame)
        masks = self._silhouettes.of(pictures)
        given, unknown = self._recording.silhouettes_given, self.unknown or [None] * len(masks)
        return tuple(
            CameraFrame(
                view.pinhole,
                None if given else _undistorted(pictures[name], view),
                view.undistort(masks[name]),
                hidden,
            )
            for (name, view), hidden in zip(self._views.items(), unknown, strict=True)
        )

    def _read(self, frame: int) -> dict[str, Frame]:
        if self._frames is None or not 0 <= frame - self._next <= _MOST_SKIPPED:
            self.close()
            stop = self._recording.first + self._recording.frame_count
            self._next, self._frames = frame, read_together(self._recording.readers, frame, stop)
        pictures: dict[str, Frame] = {}
        while self._next <= frame:
            pictures = next(self._frames)
            self._next += 1
        return pictures

    def close(self) -> None:
        """Stops reading."""
        if self._frames is not None:
            self._frames.close()  # type: ignore[attr-defined]
        self._frames = None


def _undistorted(picture: Frame, view: UndistortedView) -> NDArray[np.uint8]:
    """Picture (H, W, 3) BGR as the view's pinhole camera sees it, RGB."""
    image = picture
    if picture.shape[1::-1] != view.pinhole.size:
        image = cv2.resize(picture, view.pinhole.size, interpolation=cv2.INTER_AREA)
    if view.maps is not None:
        image = cv2.remap(image, *view.maps, cv2.INTER_LINEAR)
    return np.ascontiguousarray(image[..., ::-1], np.uint8)
