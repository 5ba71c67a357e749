"""A trial of Pose2Sim: videos, and calibration/Calib_*.toml of the trial or its session."""

import argparse
import tomllib
from pathlib import Path

from clip import (
    UP_AXES,
    VIDEOS,
    CameraView,
    Clip,
    InputError,
    Rig,
    camera_name,
    natural_order,
    number_in,
    open_frames,
    read_rig,
    read_text,
    select_names,
    to_world_z_up,
    z_up_from,
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


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a trial.

    Raises:
        InputError: something is missing or cannot be read.
    """
    folder = source / "videos"
    files = (path for path in folder.glob("*") if path.suffix.lower() in VIDEOS)
    videos = {path.stem: path for path in sorted(files, key=natural_order)}
    select_names(videos, None, "video", folder)
    file = options.calibration or _calibration(source)
    rig = read_rig(file, unit=options.unit or _unit(file))
    pairs = match_videos(list(videos), rig, file)
    views = []
    for name in select_names(videos, options.cameras, "video", folder):
        camera = to_world_z_up(rig[pairs[name]], options.up, name=camera_name(name))
        views.append(CameraView(camera, open_frames(videos[name])))
    truth = None
    if options.trc is not None and not options.no_truth:
        from voxelpose.recording.truth import read_truth

        truth = read_truth(options.trc) @ z_up_from(options.up).T
    return Clip(tuple(views), None, truth, notes={"clip": source.resolve().name})


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


def match_videos(videos: list[str], rig: Rig, file: Path) -> dict[str, str]:
    """Returns each video's camera: of the same name, else the same number, else the same position.

    Pose2Sim itself uses the position in the order.

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
