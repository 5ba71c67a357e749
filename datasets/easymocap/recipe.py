"""EasyMocap and ZJU-MoCap: intri.yml, extri.yml, videos or images, masks."""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from clip import (
    UP_AXES,
    CameraView,
    Clip,
    InputError,
    camera_name,
    find_frames,
    number_in,
    open_frames,
    open_masks,
    pictures_by_camera,
    read_json,
    read_rig,
    select_names,
    to_world_z_up,
    z_up_from,
)
from truth import BODY25, drop_uncertain, from_keypoints

SUMMARY = "EasyMocap's layout and ZJU-MoCap: 4 to 23 cameras, masks, no marker-based truth."

_MASKS = ("mask", "masks", "mask_cihp", "mask-schp", "mask-schp-parsing")


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that say what the folder does not."""
    group.add_argument(
        "--masks", help=f"folder of the masks (default: the first of {', '.join(_MASKS)})"
    )
    group.add_argument("--fps", type=float, help="frames per second, needed for folders of images")
    group.add_argument(
        "--up", choices=UP_AXES, default="z", help="axis of its world that points up (z)"
    )
    group.add_argument(
        "--keypoints", type=Path, help="folder of EasyMocap's keypoints3d (body25) as reference"
    )
    group.add_argument(
        "--person", type=int, default=0, metavar="ID", help="whose keypoints (default 0)"
    )


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a sequence.

    Raises:
        InputError: something is missing or cannot be read.
    """
    if not (source / "intri.yml").is_file() and (source / "annots.npy").is_file():
        raise InputError(
            f"{source} has its cameras only in annots.npy, a pickle, which can run any code when "
            "it is opened: write intri.yml and extri.yml of it as easymocap/card.md says"
        )
    paths = _paths(source)
    select_names(paths, None, "video or folder of images", source)
    readers = {name: open_frames(path) for name, path in paths.items()}
    sizes = {reader.size for reader in readers.values()}
    rig = read_rig(source, unit="m", size=sizes.pop() if len(sizes) == 1 else None)
    pairs = _match_cameras(rig.names, list(readers))
    names = select_names(
        [name for name in rig.names if name in pairs], options.cameras, "camera", source
    )
    folder = _mask_folder(source, options.masks)
    masks = open_masks(
        {name: folder and find_frames(folder / pairs[name]) for name in names}, options.label
    )
    views = []
    for name in names:
        camera = to_world_z_up(rig[name], options.up, name=camera_name(name))
        views.append(CameraView(camera, readers[pairs[name]], 0, masks.get(name)))
    truth, constructed = None, ()
    if options.keypoints is not None and not options.no_truth:
        points = _read_keypoints(options.keypoints, options.person)
        truth, constructed = from_keypoints(points @ z_up_from(options.up).T, BODY25)
    notes = {"clip": source.resolve().name}
    return Clip(tuple(views), options.fps, truth, constructed, notes=notes)


def _paths(source: Path) -> dict[str, Path]:
    """Returns the content of images/ or videos/, or ZJU-MoCap's folders, by camera name."""
    for folder in (source / "images", source / "videos"):
        paths = pictures_by_camera(folder, stills=True)
        if paths:
            return paths
    return {
        name: path
        for name, path in pictures_by_camera(source).items()
        if path.is_dir() and name.startswith("Camera")
    }


def _match_cameras(cameras: Sequence[str], names: Sequence[str]) -> dict[str, str]:
    """Returns the frames' name of each camera: the same, else one with the same number."""
    by_number = {number_in(name): name for name in names}
    if len(by_number) < len(names):
        by_number = {}
    matches = {
        camera: camera if camera in names else by_number.get(number_in(camera))
        for camera in cameras
    }
    return {camera: name for camera, name in matches.items() if name is not None}


def _mask_folder(source: Path, name: str | None) -> Path | None:
    if name is not None and not (source / name).is_dir():
        raise InputError(f"{source / name} is missing: correct --masks, or leave it out")
    candidates = [source / folder for folder in (_MASKS if name is None else (name,))]
    return next((folder for folder in candidates if folder.is_dir()), None)


def _read_keypoints(folder: Path, person: int) -> np.ndarray:
    """Returns (T, 25, 3), m, of a file per frame; NaN where the person is absent or not seen."""
    files = {number_in(path.stem): path for path in folder.glob("*.json")}
    files.pop(None, None)
    if not files:
        raise InputError(f"{folder} holds no keypoints (000000.json ...): correct --keypoints")
    points = np.full((max(files) + 1, 25, 4), np.nan)
    for number, file in files.items():
        try:
            for one in read_json(file):
                if int(one["id"]) == person:
                    points[number] = np.asarray(one["keypoints3d"], np.float64)[:25]
        except (KeyError, TypeError, ValueError) as error:
            raise InputError(f"{file} does not hold keypoints3d of body25 ({error})") from None
    return drop_uncertain(points, 0.0)
