"""A recording folder as far as it can be opened, also where `fit` would refuse it.

Without a calibration, or with files that do not fit each other, its pictures can be shown and
drawn on all the same; what needs more says why it is not there.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from calib.camera import Rig
from calib.errors import InputError
from calib.files import read_rig
from calib.files.anipose import read_up
from voxelpose.recording.folder import Recording, calibration_path, default_camera, open_readers
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.subject import read_subject

_RATE = 25  # where nothing tells it; nothing here depends on it


@dataclass(frozen=True, eq=False)
class OpenedFolder:
    """A recording folder that is being set up."""

    recording: Recording  # its pictures; cameras that are not calibrated stand anywhere
    calibrated: bool  # whether the cameras are where the calibration says
    fault: str  # why `fit` would refuse the folder; "" where it would not
    fps: float | None = None  # where its files do not state it, as `label`
    label: str | None = None

    @classmethod
    def open(
        cls,
        folder: Path,
        unit: str | None = None,
        fps: float | None = None,
        label: str | None = None,
    ) -> "OpenedFolder":
        """Opens a folder, with unit, frame rate and label of the person in masks/ where its files
        do not state them; InputError where it is none, or there are no pictures, or some that
        cannot be read.
        """
        open_recording = partial(Recording.open, folder, unit=unit, fps=fps, label=label)
        try:
            return cls(open_recording(), True, "", fps, label)
        except InputError as error:
            fault = str(error)
        readers, masks_only, _ = open_readers(folder, None, label)
        calibration = calibration_path(folder)
        rig = _calibrated(calibration, readers, unit)
        if rig is not None and len(rig) == len(readers):
            try:  # cameras without pictures are no hindrance
                recording = open_recording(cameras=rig.names)
                return cls(recording, recording.calibration_path is not None, "", fps, label)
            except InputError as error:
                fault = str(error)
        cameras = rig or Rig(tuple(default_camera(name, r.size) for name, r in readers.items()))
        count = min(reader.frame_count for reader in readers.values())
        rate = fps or next((r.fps for r in readers.values() if r.fps is not None), _RATE)
        recording = Recording(
            Path(folder),
            None if rig is None else calibration,
            cameras,
            {name: readers[name] for name in cameras.names},
            0,
            count,
            rate,
            np.arange(count) / rate,
            read_subject(Path(folder) / "subject.toml"),
            masks_only,
            read_up(calibration) if rig is not None and calibration is not None else None,
            cameras.names,
            numbers=np.arange(count),
        )
        return cls(recording, rig is not None, fault, fps, label)


def _calibrated(
    calibration: Path | None, readers: Mapping[str, FrameReader], unit: str | None
) -> Rig | None:
    """The filmed cameras as calibrated; None where one is not, or at another size."""
    if calibration is None:
        return None
    sizes = {reader.size for reader in readers.values()}
    try:
        rig = read_rig(calibration, unit=unit, size=sizes.pop() if len(sizes) == 1 else None)
    except InputError:
        return None
    if any(name not in rig or rig[name].size != reader.size for name, reader in readers.items()):
        return None
    return rig.select([name for name in rig.names if name in readers])
