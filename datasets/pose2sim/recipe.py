"""A trial of Pose2Sim: videos, and calibration/Calib_*.toml of the trial or its session."""

import argparse
import tomllib
from pathlib import Path

from take import (
    UP_AXES,
    VIDEOS,
    InputError,
    Pictures,
    Rig,
    Take,
    View,
    camera_name,
    choose,
    number_in,
    numbers_of,
    placed,
    read_rig,
    read_text,
    upright,
)

SUMMARY = "A project of Pose2Sim: its videos and calibration, perhaps a TRC as reference."


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that say what the folder does not."""
    group.add_argument(
        "--calibration", type=Path, help="TOML to use, where there are several or it is elsewhere"
    )
    group.add_argument("--unit", choices=("m", "cm", "mm"), help="of the calibration (default m)")
    group.add_argument(
        "--up", choices=UP_AXES, default="z", help="axis of its world that points up (z)"
    )
    group.add_argument(
        "--trc", type=Path, help="reference joints; a detector's unless you know better"
    )


def read(source: Path, options: argparse.Namespace) -> Take:
    """Reads a trial.

    Raises:
        InputError: something is missing or cannot be read.
    """
    folder = source / "videos"
    videos = {
        path.stem: path for path in sorted(folder.glob("*"), key=numbers_of) if _is_video(path)
    }
    choose(videos, None, "video", folder)
    file = options.calibration or _calibration(source)
    rig = read_rig(file, unit=options.unit or _unit(file))
    pairs = matched(list(videos), rig, file)
    views = []
    for name in choose(videos, options.cameras, "video", folder):
        camera = placed(rig[pairs[name]], options.up, name=camera_name(name))
        views.append(View(camera, Pictures.open(videos[name])))
    truth = None
    if options.trc is not None and not options.no_truth:
        from voxelpose.evaluation import read_truth

        truth = read_truth(options.trc) @ upright(options.up).T
    return Take(tuple(views), None, truth, notes={"take": source.resolve().name})


def _is_video(path: Path) -> bool:
    return path.suffix.lower() in VIDEOS


def _calibration(source: Path) -> Path:
    """Returns the only Calib*.toml in a folder named after calibration, here or one level up."""
    for place in (source, source.resolve().parent):
        folders = [f for f in sorted(place.glob("*")) if f.is_dir() and "calib" in f.name.lower()]
        files = [
            file
            for f in folders
            for file in sorted(f.glob("*.toml"))
            if "calib" in file.name.lower()
        ]
        if len(files) > 1:
            listed = ", ".join(str(file) for file in files)
            raise InputError(f"there are several calibrations: choose with --calibration: {listed}")
        if files:
            return files[0]
    raise InputError(
        f"{source / 'calibration'} holds no Calib*.toml: run Pose2Sim.calibration() first"
    )


def _unit(file: Path) -> str | None:
    """Returns "m", which Pose2Sim writes without saying so, unless the file states a unit."""
    try:
        metadata = tomllib.loads(read_text(file)).get("metadata", {})
    except tomllib.TOMLDecodeError:
        return None
    return None if {"unit", "units"} & set(metadata) else "m"


def matched(videos: list[str], rig: Rig, file: Path) -> dict[str, str]:
    """Returns the camera of every video: of its name, else of its number, else of its place.

    Pose2Sim itself goes by the place in the order.

    Raises:
        InputError: none of the three fits.
    """
    if set(videos) <= set(rig.names):
        return {name: name for name in videos}
    numbers = {number_in(name): name for name in rig.names}
    if len(numbers) == len(rig.names) and {number_in(name) for name in videos} <= set(numbers):
        return {name: numbers[number_in(name)] for name in videos}
    if len(videos) != len(rig.names):
        raise InputError(
            f"{file} has the cameras {', '.join(rig.names)}, but the videos are "
            f"{', '.join(videos)}: name videos like cameras"
        )
    return dict(zip(videos, rig.names, strict=True))
