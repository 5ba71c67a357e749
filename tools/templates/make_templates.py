"""Generates the template files.

Usage: `python -m tools.templates.make_templates [FOLDER]` (needs the `dev` extra).
The shape is defined by the measures in `figures` and the implicit surfaces in `mesh`; nothing is
taken from other body meshes.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save_file

from silhouette_core import body
from silhouette_core.body.joints import LANDMARK_NAMES, LANDMARK_PART, PART_NAMES
from tools.templates.figures import FIGURES, Figure
from tools.templates.mesh import body_mesh
from tools.templates.skin import MIRROR, dense_weights, face_parts, strongest

VERSION = "1"
HEAD_TOP = (0.0, -0.033, 1.0)


def make_template(
    figure: Figure, triangles: int = 4500, spacing: float = 0.004
) -> tuple[dict[str, NDArray[np.generic]], dict[str, str]]:
    """Arrays and metadata of one template body.

    Args:
        figure: measures of the body.
        triangles: approximate number of triangles.
        spacing: spacing of the sampling lattice, in units of stature.

    Returns:
        The arrays of the file (lengths in metres) and its metadata.
    """
    vertices, faces = body_mesh(figure, triangles, spacing)
    weights = dense_weights(vertices, figure)
    skin_parts, skin_weights = strongest(weights)
    half = len(faces) // 2
    left = face_parts(weights, faces[:half])
    joints = figure.joint_array()
    landmarks = joints[LANDMARK_PART]
    landmarks[LANDMARK_NAMES.index("head_top")] = HEAD_TOP
    arrays: dict[str, NDArray[np.generic]] = {
        "vertices_m": (vertices * figure.stature_m).astype(np.float32),
        "faces": faces.astype(np.int32),
        "face_part": np.concatenate([left, MIRROR[left]]).astype(np.int32),
        "skin_parts": skin_parts,
        "skin_weights": skin_weights,
        "joints_m": (joints * figure.stature_m).astype(np.float32),
        "landmarks_m": (landmarks * figure.stature_m).astype(np.float32),
    }
    about = {
        "version": VERSION,
        "sex": figure.sex,
        "stature": str(figure.stature_m),
        "chest_girth": str(figure.chest_girth_m),
        "unit": "m",
        "parts": json.dumps(PART_NAMES),
        "landmarks": json.dumps(LANDMARK_NAMES),
    }
    return arrays, about


def sort_header(file: Path) -> None:
    """Sorts the header, whose order is otherwise random, so that equal bodies give equal files."""
    data = file.read_bytes()
    end = 8 + int.from_bytes(data[:8], "little")
    header = (
        json.dumps(json.loads(data[8:end]), sort_keys=True, separators=(",", ":"))
        .encode()
        .ljust(end - 8)
    )
    file.write_bytes(len(header).to_bytes(8, "little") + header + data[end:])


def make_templates() -> None:
    """Writes man.safetensors and woman.safetensors."""
    parser = argparse.ArgumentParser(description="Makes the template bodies from their measures.")
    parser.add_argument(
        "folder",
        nargs="?",
        type=Path,
        default=Path(body.__file__).parent,
        help="where to write (default: the package)",
    )
    folder = parser.parse_args().folder
    for figure in FIGURES:
        arrays, about = make_template(figure)
        file = folder / f"{figure.name}.safetensors"
        save_file(
            {name: np.ascontiguousarray(array) for name, array in arrays.items()}, file, about
        )
        sort_header(file)
        file.chmod(0o644)


if __name__ == "__main__":
    make_templates()
