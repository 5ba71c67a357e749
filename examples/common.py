"""What the examples share: where they write, and what they look at."""

import sys
from pathlib import Path

from voxelpose import make_recording

_FRAMES = 12


def out_folder() -> Path:
    """Returns the folder that the first word after the example's name names, or out/examples; made
    if need be.
    """
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def recording_folder(out: Path) -> Path:
    """Returns the demo's recording: four cameras and a mannequin that moves. It is made once; a
    folder of your own will do as well.
    """
    folder = out / "recording"
    if not (folder / "truth.json").exists():
        make_recording(folder, _FRAMES)
    return folder
