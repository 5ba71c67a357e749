"""Recordings that ../shared/render (or that of $VOXELPOSE_SHARED) draws at random."""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

SHARED = Path(os.environ.get("VOXELPOSE_SHARED", Path(__file__).resolve().parents[2] / "shared"))


def drawn(
    folder: Path,
    seeds: Sequence[int],
    level: int,
    clip: str | None = None,
    options: Sequence[str] = (),
) -> list[Path]:
    """Recordings of some seeds, drawn if they are not there.

    Args:
        folder: of the recordings.
        seeds: a recording each.
        level: 0 clean, 1 filmed carefully, 2 carelessly.
        clip: recorded motion; None: drawn, too.
        options: further ones of the program that draws.

    Raises:
        subprocess.CalledProcessError: a recording could not be drawn, as from a clip too short.
    """
    missing = [str(k) for k in seeds if not (folder / str(k) / "truth.json").is_file()]
    if missing:
        draw = SHARED / "render" / "draw.py"
        command = [
            sys.executable,
            draw.name,
            str(folder.resolve()),
            *missing,
            "--level",
            str(level),
        ]
        command += [*options, *([] if clip is None else ["--clip", clip])]
        subprocess.run(command, cwd=draw.parent, check=True, stdout=subprocess.DEVNULL)
    return [folder / str(k) for k in seeds]
