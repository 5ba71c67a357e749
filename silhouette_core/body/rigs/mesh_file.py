"""Files of triangles, read by trimesh."""

from pathlib import Path
from typing import Any

import numpy as np

from calib.documents import load_text, parse_xml
from calib.errors import InputError

MESH_SUFFIXES = ".stl", ".dae", ".obj", ".ply"
_LARGEST = 100_000_000


def read_triangles(file: Path, most: int) -> Any:
    """The triangles of a file, a `trimesh.Trimesh` as it stands in the file.

    Args:
        most: number of triangles that there may be.

    Raises:
        InputError: the file is missing, damaged, too large, or holds no surface.
    """
    import trimesh

    try:
        size = file.stat().st_size
    except OSError as error:
        raise InputError(f"{file} cannot be read: {error.strerror}") from None
    if size > _LARGEST:
        raise InputError(f"{file} is larger than {_LARGEST / 1e6:.0f} MB: simplify it")
    if file.suffix.lower() == ".dae":  # its parser would follow what a document type defines
        parse_xml(load_text(file, _LARGEST, errors="replace"), file)
    try:
        with file.open("rb") as stream, np.errstate(all="ignore"):
            loaded: Any = trimesh.load_mesh(
                stream, file_type=file.suffix[1:].lower(), process=False
            )
        count = len(loaded.faces) if len(loaded.vertices) else 0
        usable = count and np.isfinite(loaded.vertices).all()
    # Its parsers raise whatever a damaged file leads to.
    except Exception as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:150]
        raise InputError(f"{file} cannot be read as a mesh ({reason}): export it again") from None
    if not usable or loaded.faces.min() < 0 or loaded.faces.max() >= len(loaded.vertices):
        raise InputError(f"{file} has no surface: export it again")
    if count > most:
        raise InputError(f"{file} has {count} triangles, above {most}: simplify it")
    return loaded
