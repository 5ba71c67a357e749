"""Recording of live pictures as a recording folder, complete at every moment."""

import errno
import shutil
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from queue import Full, Queue

import cv2
import numpy as np
import tomlkit
from numpy.typing import NDArray

from calib.camera import Rig
from calib.errors import InputError
from calib.files import write_rig
from calib.storage.atomic import unwritable, writing
from voxelpose.live.camera_source import Shot
from voxelpose.recording.subject import Subject
from voxelpose.recording.timestamps import TIMESTAMPS
from voxelpose.view.images.canvas import encoded

_WAITING = 45  # moments that wait for the disk at most
_LEAST_FREE = 200 << 20  # bytes on the disk, below which recording ends
_CHECKED_EVERY = 30  # frames
_BACKGROUND_PICTURES = 30

Picture = NDArray[np.uint8]
Masks = Mapping[str, NDArray[np.bool_]]


class LiveRecorder:
    """Writes every moment's pictures, or silhouettes alone where `private`, in a thread of its own;
    `failure` says why it ended by itself. InputError where the folder exists, or cannot be made.

    A picture is a file, and its time a line of timestamps.csv, so that a full disk or an
    interruption costs nothing that was written before. `empty` are pictures of the empty view by
    camera name.
    """

    def __init__(
        self,
        folder: Path,
        rig: Rig,
        subject: Subject,
        empty: Mapping[str, Sequence[Picture]],
        private: bool = False,
    ):
        self.folder, self.private = folder, private
        self.written, self.failure = 0, ""
        self._sizes = {camera.name: camera.size for camera in rig}
        if folder.exists():
            raise InputError(f"{folder} exists: give --record another name")
        with writing(folder):
            self._make(rig, subject, {} if private else empty)
            # Unbuffered: what a full disk cut off can be taken back.
            self._times = (folder / TIMESTAMPS).open("wb", buffering=0)
            self._times.write(b"cam_id,frame_time\n")
        self._queue: Queue[tuple[float, Mapping[str, NDArray]] | None] = Queue(_WAITING)
        self._thread = threading.Thread(target=self._run, name="record", daemon=True)
        self._thread.start()

    def put(self, shot: Shot, masks: Masks | None = None) -> None:
        """Hands over a moment of which every camera has a picture, and the silhouettes, which a
        private recording keeps instead; returns at once, leaving it out where the disk is too slow.
        """
        images = masks if self.private else shot.pictures
        if images is not None and not self.failure and set(shot.pictures) == set(self._sizes):
            with suppress(Full):
                self._queue.put_nowait((shot.time_s, images))

    def close(self) -> None:
        """Writes what still waits, and completes the recording."""
        self._queue.put(None)
        self._thread.join()

    def _make(self, rig: Rig, subject: Subject, empty: Mapping[str, Sequence[Picture]]) -> None:
        self.folder.mkdir(parents=True)
        write_rig(rig, self.folder / "calibration.toml")
        known = {
            "stature": subject.stature_m,
            "chest_girth": subject.chest_girth_m,
            "sex": subject.sex,
        }
        text = tomlkit.dumps({key: value for key, value in known.items() if value is not None})
        (self.folder / "subject.toml").write_text(text, encoding="utf-8")
        for name in rig.names:
            self._pictures(name).mkdir(parents=True)
        for name, pictures in empty.items():
            (self.folder / "background" / name).mkdir(parents=True)
            for k, picture in enumerate(pictures[:_BACKGROUND_PICTURES]):
                _write(self.folder / "background" / name / f"{k:04d}.png", picture)

    def _pictures(self, name: str) -> Path:
        return self.folder / "masks" / name if self.private else self.folder / name

    def _run(self) -> None:
        try:
            while (item := self._queue.get()) is not None:
                if not self.failure:
                    self._write_moment(*item)
        finally:
            self._times.close()

    def _write_moment(self, time_s: float, pictures: Mapping[str, NDArray]) -> None:
        if self.written % _CHECKED_EVERY == 0:
            free = shutil.disk_usage(self.folder).free
            if free < _LEAST_FREE:
                self.failure = (
                    f"recording ended: less than {_LEAST_FREE >> 20} MB are left on the disk of"
                    f" {self.folder}"
                )
                return
        complete = self._times.tell()
        suffix = "png" if self.private else "jpg"
        paths = {name: self._pictures(name) / f"{self.written:07d}.{suffix}" for name in pictures}
        try:
            for name, picture in pictures.items():
                _write(paths[name], _image(picture, self._sizes[name]))
            lines = "".join(f"{name},{time_s:.6f}\n" for name in pictures).encode()
            if self._times.write(lines) != len(lines):
                raise OSError(errno.ENOSPC, "the disk is full")
            self.written += 1
        except OSError as error:
            self.failure = f"recording ended: {unwritable(self.folder, error)}"
            self._times.truncate(complete)
            for path in paths.values():  # a moment is there whole or not at all
                path.unlink(missing_ok=True)


def _image(picture: NDArray, size: tuple[int, int]) -> Picture:
    """A picture, or a silhouette in black and white, of the size of the camera's pictures."""
    if picture.dtype != np.bool_:
        return picture
    image = picture.view(np.uint8) * np.uint8(255)
    if image.shape[1::-1] == size:
        return image
    larger = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_LINEAR))
    return np.where(larger > 127, np.uint8(255), np.uint8(0))


def _write(path: Path, picture: Picture) -> None:
    path.write_bytes(encoded(picture, path.suffix, 95))
