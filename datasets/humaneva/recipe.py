"""HumanEva-I and HumanEva-II as their readme and support code lay them out."""

import argparse
import re
from dataclasses import replace
from pathlib import Path

from clip import (
    CameraView,
    Clip,
    InputError,
    camera_name,
    find_frames,
    make_camera,
    open_frames,
    read_numbers,
    read_text,
    select_names,
    to_world_z_up,
)
from humaneva.markers import truth as from_markers

SUMMARY = "HumanEva-I and -II: four subjects, 4 or 7 cameras, marker-based truth."

_ORDER = ("C1", "C2", "C3", "C4", "BW1", "BW2", "BW3", "BW4")  # the support code's
_FPS = 60.0
_REPEATED = 5  # the readme: the codec repeats the first frame, so the first five are not to be used


def add_options(group: argparse._ArgumentGroup) -> None:
    """Adds the options that choose a clip."""
    group.add_argument("--subject", required=True, help="S1, S2, S3 or S4")
    group.add_argument(
        "--action", required=True, help="Walking, Jog, ThrowCatch, Gestures, Box or Combo"
    )
    group.add_argument("--trial", default="1", help="1 (default), 2, 3 or 4")
    group.add_argument(
        "--background", default="1", help="which background video, 1 (default), 2 or 3"
    )


def read(source: Path, options: argparse.Namespace) -> Clip:
    """Reads a clip.

    Raises:
        InputError: something is missing or cannot be read.
    """
    select_names(_subjects(source), [options.subject], "subject", source)
    folder = source / options.subject
    title = f"{options.action}_{options.trial}"
    cameras = select_names(
        _available(folder, title), options.cameras, f"camera of {title}", folder / "Image_Data"
    )
    syncs = [_read_offsets(folder / "Sync_Data" / f"{title}_({name}).ofs") for name in cameras]
    starts, mocap_start, mocap_step = align_cameras(syncs)
    views = []
    for name, start in zip(cameras, starts, strict=True):
        frames = open_frames(find_frames(folder / "Image_Data" / f"{title}_({name})"))
        camera = _read_camera(folder / "Calibration_Data" / f"{name}.cal", name, frames.size)
        empty = find_frames(source / "Background" / f"Background_{options.background}_({name})")
        background = None if empty is None else open_frames(empty)
        views.append(
            CameraView(to_world_z_up(camera, "z", 0.001), frames, start, background=background)
        )
    clip = Clip(tuple(views), _FPS, notes={"clip": f"{options.subject} {title}"})
    motion = folder / "Mocap_Data" / f"{title}.c3d"
    if options.no_truth or not motion.is_file():
        return clip
    count = min(view.frames.frame_count - view.start for view in views)
    truth = from_markers(motion, options.subject, mocap_start, mocap_step, count)
    truth[:_REPEATED] = float("nan")
    return replace(clip, truth=truth)


def _subjects(source: Path) -> list[str]:
    return sorted(path.name for path in source.iterdir() if (path / "Image_Data").is_dir())


def _available(folder: Path, title: str) -> list[str]:
    """Returns the cameras that recorded a clip, in the support code's order."""
    return [n for n in _ORDER if find_frames(folder / "Image_Data" / f"{title}_({n})") is not None]


def _read_camera(file: Path, name: str, size: tuple[int, int]):
    """Reads a .cal: fc (2), cc (2), alpha_c, kc (5), R (9, by rows), T (3, mm), as Bouguet."""
    values = read_numbers(read_text(file).split(), file, "the calibration", 22)
    fx, fy, cx, cy, skew = values[:5]
    return make_camera(
        file,
        name=camera_name(name),
        size=size,
        matrix=[[fx, skew * fx, cx], [0, fy, cy], [0, 0, 1]],
        distortion=values[5:10],
        rotation=values[10:19].reshape(3, 3),
        translation=values[19:],
    )


def _read_offsets(file: Path) -> tuple[float, float, float]:
    """Reads an .ofs: a frame of the video, the motion capture's frame of that time, and its step.

    Frames are counted from 1; the step is frames of motion capture per frame of the video.
    """
    image, mocap, step = read_numbers(
        re.split(r"[\s,]+", read_text(file).strip()), file, "the offsets", 3
    )
    if not 0.5 < step < 10:
        raise InputError(
            f"{file}: {step:g} motion-capture frames per frame is impossible: download it again"
        )
    return image, mocap, step


def align_cameras(offsets: list[tuple[float, float, float]]) -> tuple[list[int], float, float]:
    """Returns the first time that all cameras recorded, in the videos and in the motion capture.

    Args:
        offsets: per camera, as `_read_offsets` reads them.

    Returns:
        The frame, from 0, of that time per camera; the motion capture's frame, from 0, which may be
        fractional (negative: before it began); and its frames per frame of the video.

    Source: the support code's sync_stream.m, which rounds videos to whole frames likewise.
    """
    _, mocap, _ = offsets[0]
    step = sum(offset[2] for offset in offsets) / len(offsets)
    at_mocap = [image + (mocap - own) / scale for image, own, scale in offsets]
    earliest = min(at_mocap)
    starts = [round(image - earliest) for image in at_mocap]
    return starts, mocap - step * (earliest - 1) - 1, step
