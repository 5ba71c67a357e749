"""EasyMocap and ZJU-MoCap: intri.yml, extri.yml, videos or images, masks."""

import argparse
from pathlib import Path

import numpy as np
from take import (
    UP_AXES,
    InputError,
    Pictures,
    Take,
    View,
    camera_name,
    choose,
    find_pictures,
    number_in,
    numbers_of,
    placed,
    read_rig,
    upright,
)
from truth import BODY25, confident, from_keypoints, read_json

SUMMARY = "EasyMocap's layout and ZJU-MoCap: 4 to 23 cameras, masks, no marker-based truth."

_MASKS = ("mask", "masks", "mask_cihp", "mask-schp", "mask-schp-parsing")


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that say what the folder does not."""
    group.add_argument(
        "--masks", help=f"folder of the masks (default: the first of {', '.join(_MASKS)})"
    )
    group.add_argument(
        "--mask-above",
        type=int,
        default=0,
        help="a mask's pixel is the person above this value (default 0)",
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


def read(source: Path, options: argparse.Namespace) -> Take:
    """Reads a sequence.

    Raises:
        InputError: something is missing or cannot be read.
    """
    if not (source / "intri.yml").is_file() and (source / "annots.npy").is_file():
        raise InputError(
            f"{source} has its cameras only in annots.npy, a pickle, which can run any code when "
            "it is opened: write intri.yml and extri.yml of it as easymocap/card.md says"
        )
    filmed = {path.name if path.is_dir() else path.stem: path for path in _filmed(source)}
    choose(filmed, None, "video or folder of images", source)
    opened = {name: Pictures.open(path) for name, path in filmed.items()}
    sizes = {one.size for one in opened.values()}
    rig = read_rig(source, unit="m", size=sizes.pop() if len(sizes) == 1 else None)
    pairs = _matched(list(rig.names), list(opened))
    names = choose([name for name in rig.names if name in pairs], options.cameras, "camera", source)
    masks = _mask_folder(source, options.masks)
    views = []
    for name in names:
        camera = placed(rig[name], options.up, name=camera_name(name))
        path = None if masks is None else find_pictures(masks / pairs[name])
        given = None if path is None else Pictures.open(path)
        views.append(View(camera, opened[pairs[name]], 0, given, options.mask_above))
    truth, constructed = None, ()
    if options.keypoints is not None and not options.no_truth:
        points = _read_keypoints(options.keypoints, options.person)
        truth, constructed = from_keypoints(points @ upright(options.up).T, BODY25)
    notes = {"take": source.resolve().name}
    return Take(tuple(views), options.fps, truth, constructed, notes=notes)


def _filmed(source: Path) -> list[Path]:
    """Returns what images/ or videos/ holds, or the folders that ZJU-MoCap has at the top."""
    for folder in (source / "images", source / "videos"):
        found = [path for path in folder.glob("*") if find_pictures(path) is not None]
        if found:
            return sorted(found, key=numbers_of)
    found = [
        path for path in source.glob("Camera*") if path.is_dir() and find_pictures(path) is not None
    ]
    return sorted(found, key=numbers_of)


def _matched(cameras: list[str], pictures: list[str]) -> dict[str, str]:
    """Returns the pictures of every camera: of the same name, else of the same number."""
    by_number = {number_in(name): name for name in pictures}
    if len(by_number) < len(pictures):
        by_number = {}
    found = {name: name if name in pictures else by_number.get(number_in(name)) for name in cameras}
    return {name: match for name, match in found.items() if match is not None}


def _mask_folder(source: Path, wanted: str | None) -> Path | None:
    if wanted is not None and not (source / wanted).is_dir():
        raise InputError(f"{source / wanted} is missing: correct --masks, or leave it out")
    names = _MASKS if wanted is None else (wanted,)
    return next((source / name for name in names if (source / name).is_dir()), None)


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
    return confident(points, 0.0)
