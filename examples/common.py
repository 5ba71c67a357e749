"""Output folder and recording of the examples."""

import sys
from pathlib import Path

from voxelpose import make_recording

_FRAMES = 12


def out_folder() -> Path:
    """Returns the folder given as the first argument, or out/examples; made if it is missing."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def recording_folder(out: Path) -> Path:
    """Returns the demo's recording, rendered once; a recording of your own can be used instead."""
    folder = out / "recording"
    if not (folder / "truth.json").exists():
        make_recording(folder, _FRAMES)
    return folder
