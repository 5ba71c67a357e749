"""Plain folders: images or videos per camera, masks, backgrounds, any calibration."""

import argparse
from pathlib import Path

from clip import (
    UP_AXES,
    CameraView,
    Clip,
    InputError,
    camera_name,
    find_frames,
    open_frames,
    open_masks,
    read_rig,
    select_names,
    to_world_z_up,
)

SUMMARY = "Plain folders of images or videos, with masks, and any calibration that voxelpose reads."

_CALIBRATIONS = [
    f"calibration{end}" for end in (".toml", ".yml", ".yaml", ".json", ".xml", ".txt", "")
]


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that say how the folder is laid out."""
    group.add_argument(
        "--calibration", type=Path, help="file or folder (default SOURCE/calibration.*)"
    )
    group.add_argument(
        "--unit", choices=("m", "cm", "mm"), help="of the calibration, if it does not say it"
    )
    group.add_argument(
        "--up", choices=UP_AXES, default="z", help="axis of its world that points up (z)"
    )
    group.add_argument("--fps", type=float, help="frames per second, needed for folders of images")
    for name, default in (
        ("pictures", "{camera}"),
        ("masks", "masks/{camera}"),
        ("background", "background/{camera}"),
    ):
        group.add_argument(
            f"--{name}",
            default=default,
            metavar="PATH",
            help=f"where a camera's {name} are in SOURCE, without suffix (default {default})",
        )


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a folder.

    Raises:
        InputError: something is missing or cannot be read.
    """
    file = options.calibration or _calibration(source)
    sizes = {open_frames(path).size for path in _all_frames(source, options)}
    rig = read_rig(file, unit=options.unit, size=sizes.pop() if len(sizes) == 1 else None)
    views = []
    names = select_names(rig.names, options.cameras, "camera", file)
    masks = open_masks({name: _at(source, options.masks, name) for name in names}, options.label)
    for name in names:
        frames, background = (
            None if (path := _at(source, pattern, name)) is None else open_frames(path)
            for pattern in (options.pictures, options.background)
        )
        if frames is None and name not in masks:
            raise InputError(
                f"camera {name} of {file} has neither {options.pictures} nor {options.masks} in "
                f"{source}: say where with --pictures and --masks, or choose with --cameras"
            )
        camera = to_world_z_up(rig[name], options.up, name=camera_name(name))
        views.append(CameraView(camera, frames, 0, masks.get(name), background))
    return Clip(tuple(views), options.fps, notes={"clip": source.resolve().name})


def _calibration(source: Path) -> Path:
    for name in _CALIBRATIONS:
        if (source / name).exists():
            return source / name
    raise InputError(f"{source} holds no calibration.*: say where it is with --calibration")


def _at(source: Path, pattern: str, camera: str) -> Path | None:
    if "{camera}" not in pattern:
        raise InputError(f"{pattern!r} must hold {{camera}}, which stands for the camera's name")
    return find_frames(source / pattern.replace("{camera}", camera))


def _all_frames(source: Path, options: argparse.Namespace) -> list[Path]:
    """Returns all images and masks; they have the image size, which a calibration may omit."""
    patterns = [pattern.replace("{camera}", "*") for pattern in (options.pictures, options.masks)]
    paths = (find_frames(path) for pattern in patterns for path in sorted(source.glob(pattern)))
    return [path for path in paths if path is not None]
