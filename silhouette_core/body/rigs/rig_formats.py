"""Formats of rigs, and the choice of the reader."""

from collections.abc import Callable
from dataclasses import fields
from pathlib import Path

from calib.errors import InputError
from calib.storage.documents import load_text, parse_toml
from silhouette_core.body.model import BodyModel
from silhouette_core.body.rigs.bvh_rig import read_bvh_rig
from silhouette_core.body.rigs.gltf_rig import read_gltf
from silhouette_core.body.rigs.makehuman import CMU, MakeHumanPerson, read_makehuman
from silhouette_core.body.rigs.rig_checks import short
from silhouette_core.body.rigs.rig_dofs import LARGEST_TABLE
from silhouette_core.body.rigs.urdf_rig import read_urdf

RIG_SUFFIXES = (".glb", ".gltf", ".urdf", ".bvh", ".toml")
"""Suffixes of files that `read_rig_body` reads; .toml with a table [makehuman]."""
_HUMAN_TREE = "human"


def read_rig_body(path: Path, say: Callable[[str], None] = lambda line: None) -> BodyModel:
    """Body of a rig in a file or folder of any format that is read here. Raises InputError where
    there is no such file, it is damaged, or no body can be made of it.

    Args:
        path: a rigged .glb or .gltf, a .urdf, a .bvh, MakeHuman's data folder (an average man), or
            a .toml with a table [makehuman].
        say: receives a line about everything that is left out.
    """
    if path.is_dir():
        if not is_makehuman(path):
            raise InputError(f"{path} is no MakeHuman data folder: it lacks 3dobjs/base.obj")
        return read_makehuman(path)
    match path.suffix.lower():
        case ".glb" | ".gltf":
            return read_gltf(path)
        case ".urdf":
            return read_urdf(path, say)
        case ".bvh":
            return read_bvh_rig(path)
        case ".toml":
            return read_makehuman_table(path)
        case ".fbx":
            raise InputError(
                f"{path} is no rig that is read here: turn FBX into GLB in Blender"
                " (docs/exports.md#fbx-through-blender)"
            )
    raise InputError(
        f"{path} is no rig that is read here: give {', '.join(RIG_SUFFIXES[:-1])}, or MakeHuman's"
        " data folder"
    )


def is_makehuman(folder: Path) -> bool:
    """Whether a folder is one of MakeHuman's data."""
    return (folder / "3dobjs" / "base.obj").is_file()


def read_makehuman_table(path: Path) -> BodyModel:
    """Body of a TOML file with a table [makehuman].

    The table has the `folder` of MakeHuman's data, relative to the file; what `MakeHumanPerson`
    takes, each with its default; and `rig`, a rig of that folder ("cmu_mb" by default), or "human"
    for this project's human tree. Raises InputError where the file or the folder is damaged, or the
    table holds something else.
    """
    content = parse_toml(load_text(path, LARGEST_TABLE), path)
    table = content.get("makehuman")
    if not isinstance(table, dict):
        raise InputError(f"{path} has no table [makehuman]: write one with folder = …")
    measures = [field.name for field in fields(MakeHumanPerson)]
    if unknown := sorted(set(table) - {"folder", "rig", *measures}):
        raise InputError(
            f"{path}: [makehuman] has {short(unknown[0])}: it can have folder, rig,"
            f" {', '.join(measures)}"
        )
    folder, rig = table.get("folder"), table.get("rig", CMU)
    if not isinstance(folder, str) or not isinstance(rig, str) or not folder.isprintable():
        raise InputError(f'{path}: [makehuman] needs folder = "…", and a rig\'s name if any')
    try:
        person = MakeHumanPerson(**{name: table[name] for name in measures if name in table})
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    human = rig == _HUMAN_TREE
    return read_makehuman(path.parent / folder, person, CMU if human else rig, human)
