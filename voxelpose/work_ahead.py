"""What a long estimation takes, told before it begins."""

import shutil
import tempfile

from calib.errors import InputError
from silhouette_core.estimator import ONE_CAMERA
from voxelpose.recording.folder import Recording

_LONG_S = 600  # of work, from which it is told
# Of a camera's picture in a frame, see "how fast" in docs/results.md: ms of work with overlays, and
# bytes of scratch files and of the result.
_MS_SEVERAL, _MS_ONE = 70, 65
_SCRATCH, _RESULT = 15_000, 5_000
_MEMORY, _MEMORY_A_FRAME = 1_800_000_000, 1_300  # bytes


def work_ahead(recording: Recording, estimator: str) -> str:
    """Words on time, disk and memory that an estimation takes; "" where it is short.

    Raises:
        InputError: the folder of temporary files has no room for it.
    """
    frames, cameras = recording.frame_count, len(recording.rig)
    pictures = frames * cameras
    seconds = pictures * (_MS_ONE if estimator in ONE_CAMERA else _MS_SEVERAL) / 1000
    if seconds < _LONG_S:
        return ""
    scratch, folder = pictures * _SCRATCH, tempfile.gettempdir()
    free = shutil.disk_usage(folder).free
    needs = f"{scratch / 1e9:.1f} GB in the folder of temporary files {folder}"
    if scratch > free:
        raise InputError(
            f"{frames:,} frames of {cameras} cameras need about {needs}, which has"
            f" {free / 1e9:.1f}: set TMPDIR to another folder, or estimate parts with --frames"
        )
    hours = f"{seconds / 3600:.1f} hours" if seconds > 3600 else f"{seconds / 60:.0f} minutes"
    memory = (_MEMORY + frames * _MEMORY_A_FRAME) / 1e9
    return (
        f"{frames:,} frames of {cameras} camera{'s' * (cameras > 1)} take about {hours} on two"
        f" cores, {needs} ({free / 1e9:.0f} free), {pictures * _RESULT / 1e9:.1f} GB for the result"
        f" and {memory:.1f} GB of memory"
    )
