"""Writes a clip as a recording folder.

The folder is written beside its target, then renamed, so that it is never incomplete.
"""

import os
import shutil
import tomllib
from argparse import Namespace
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from clip import (
    VIDEOS,
    CameraView,
    Clip,
    FolderWriter,
    FrameReader,
    InputError,
    Recording,
    Rig,
    write_rig,
    write_timestamps,
)
from truth import crop_truth, write_truth

_RATE_TOLERANCE = 0.01


def write(clip: Clip, out: Path, options: Namespace) -> str:
    """Writes the recording.

    Args:
        clip: the clip as the recipe read it.
        out: the folder to make.
        options: of the command line: name, source, frames, silhouettes, no_truth, stature, sex,
            label, copy, overwrite.

    Returns:
        One line that describes what was written.

    Raises:
        InputError: the clip does not make a recording that can be opened, `out` stands in the way,
            or it cannot be written.
    """
    writer = check_out(out, options.source, options.overwrite)
    try:
        with writer as beside:
            try:
                summary = _fill(beside, clip, options)
            except InputError as error:
                raise InputError(str(error).replace(str(beside), str(out))) from None
    except OSError as error:
        raise InputError(
            f"{out} cannot be written: {error.strerror or error}: choose another place"
        ) from None
    return f"{out}: {summary}"


def check_out(out: Path, source: Path, overwrite: bool) -> FolderWriter:
    """Returns the writer of `out`, once it is known that it may be made.

    Raises:
        InputError: it exists and may not be replaced, the source is in it, or it has no parent.
    """
    if not out.parent.is_dir():
        raise InputError(f"{out.parent} is no folder: make it, or correct the recording's place")
    if source.resolve().is_relative_to(out.resolve()):
        raise InputError(
            f"{out} holds the data set itself: choose another folder for the recording"
        )
    return FolderWriter(out, overwrite, _is_ours)


def _is_ours(folder: Path) -> bool:
    """Whether a folder was written by this command."""
    try:
        calibration = (folder / "calibration.toml").read_text(encoding="utf-8")
        return "data_set" in tomllib.loads(calibration).get("metadata", {})
    except (OSError, ValueError):
        return False


def _fill(folder: Path, clip: Clip, options: Namespace) -> str:
    """Writes all files; returns a description of the recording."""
    views = [_masks_only(view) if options.silhouettes else view for view in clip.views]
    first, count = _frame_range(views, options.frames)
    cut = options.frames is not None
    fps = _fps(clip, views)
    rig = Rig(tuple(view.camera for view in views))
    notes = {"data_set": options.name, **clip.notes}
    write_rig(rig, folder / "calibration.toml", notes=notes)
    for view in views:
        name = view.camera.name
        span = range(view.start + first, view.start + first + count) if cut else None
        if view.frames is not None:
            _place(view.frames, folder / name, span, options.copy)
        if view.masks is not None:
            _place_masks(view, folder / "masks" / name, span, options)
        if view.background is not None and not options.silhouettes:
            _place(view.background, folder / "background" / name, None, options.copy)
    if cut or _needs_timestamps(views, fps):
        _write_timestamps(folder / "timestamps.csv", views, fps, count if cut else None)
    _write_subject(folder / "subject.toml", options.stature, options.sex)
    has_truth = clip.truth is not None and not options.no_truth
    if has_truth:
        truth_of_range = crop_truth(clip.truth, first, count)
        write_truth(folder / "truth.json", truth_of_range, fps, clip.approximate, options.name)
    recording = Recording.open(folder)
    recording.backgrounds()  # checks their sizes
    if recording.frame_count != count:
        raise InputError(
            f"the recording would have {recording.frame_count} frames instead of {count}: "
            "the files end early; choose frames that all have (--frames A:B)"
        )
    what = "silhouettes" if recording.silhouettes_given else "images"
    return f"{len(views)} cameras, {count} frames of {what}{', truth' if has_truth else ''}"


def _masks_only(view: CameraView) -> CameraView:
    if view.masks is None:
        raise InputError(
            f"there are no masks of camera {view.camera.name}: leave out --silhouettes, "
            "or the camera"
        )
    return replace(view, frames=None, background=None)


def _reader(view: CameraView) -> FrameReader:
    """Returns the camera's frames, or its masks where it has no frames."""
    if view.frames is None and view.masks is None:
        raise InputError(
            f"camera {view.camera.name} has neither images nor masks: leave it out (--cameras)"
        )
    return view.frames or view.masks


def _frame_range(
    views: list[CameraView], frames: tuple[int | None, int | None] | None
) -> tuple[int, int]:
    """Returns the first frame of the clip that is used, and the number of frames."""
    if min(view.start for view in views) != 0:
        raise ValueError("frame 0 of a clip must be the first frame of one of its files")
    end = min(_reader(view).frame_count - view.start for view in views)
    start, stop = frames or (None, None)
    first, last = start or 0, end if stop is None else stop
    if not 0 <= first < last <= end:
        raise InputError(f"frames {first}:{last} are not in all cameras: choose from 0:{end}")
    return first, last - first


def _fps(clip: Clip, views: list[CameraView]) -> float:
    """Returns the clip's frames per second."""
    rates = [rate for view in views if (rate := _reader(view).fps) is not None]
    fps = clip.fps if clip.fps is not None else (float(np.median(rates)) if rates else None)
    if fps is None:
        raise InputError("images do not state a frame rate: give --fps, frames per second")
    if not (np.isfinite(fps) and fps > 0):
        raise InputError(f"{fps} frames per second are impossible: give --fps as a positive number")
    return float(fps)


def _place(frames: FrameReader, target: Path, span: range | None, copy: bool) -> None:
    """Links or copies a video or images to a path without suffix; a video's span is decoded."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if frames.path.is_file() and (frames.stills or span is None):
        _link(frames.path, target.with_name(target.name + frames.path.suffix.lower()), copy)
        return
    target.mkdir()
    if frames.stills:
        stills = frames.stills if span is None else frames.stills[span.start : span.stop]
        for number, still in enumerate(stills):
            _link(still, target / f"{number:06d}{still.suffix.lower()}", copy)
    else:
        for number, frame in enumerate(frames.frames(span.start, span.stop)):
            _write_image(target / f"{number:06d}.png", frame)


def _place_masks(view: CameraView, target: Path, span: range | None, options: Namespace) -> None:
    """Writes masks as black and white images; a video is kept unless it is cut or has labels."""
    masks = view.masks
    whole = span is None and options.label is None
    if whole and masks.path.is_file() and masks.path.suffix.lower() in VIDEOS:
        _place(masks, target, None, options.copy)
        return
    # Masks may end earlier than the images beside them.
    stop = masks.frame_count if span is None else min(span.stop, masks.frame_count)
    target.mkdir(parents=True)
    for number, frame in enumerate(masks.frames(span.start if span else 0, stop)):
        _write_image(target / f"{number:06d}.png", frame[..., 0])


def _write_image(file: Path, image: np.ndarray) -> None:
    good, data = cv2.imencode(".png", image)
    if not good:
        raise RuntimeError(f"OpenCV cannot encode {file.name}")
    data.tofile(file)


def _link(source: Path, target: Path, copy: bool) -> None:
    """Hard-links a file where the file system allows it, or copies it."""
    source = source.resolve()
    if not copy:
        try:
            os.link(source, target)
            return
        except OSError:
            pass  # another disk, or one without links
    shutil.copyfile(source, target)


def _needs_timestamps(views: list[CameraView], fps: float) -> bool:
    """Returns whether the files alone do not state simultaneous frames and their rate."""
    readers = [_reader(view) for view in views]
    same_rate = all(
        reader.fps and abs(reader.fps / fps - 1) < _RATE_TOLERANCE for reader in readers
    )
    counts = {reader.frame_count for reader in readers}
    same_span = len(counts) == 1 and not any(view.start for view in views)
    return not (same_rate and same_span) and max(counts) > 1


def _write_timestamps(file: Path, views: list[CameraView], fps: float, count: int | None) -> None:
    """Writes the time of every frame; simultaneous frames have the same time."""
    latest = max(view.start for view in views)
    times = {}
    for view in views:
        frames = np.arange(_reader(view).frame_count if count is None else count)
        offset = latest - view.start if count is None else 0
        times[view.camera.name] = (frames + offset) / fps
    write_timestamps(file, times)


def _write_subject(file: Path, stature: float | None, sex: str | None) -> None:
    lines = [f"stature = {stature}"] if stature is not None else []
    lines += [f'sex = "{sex}"'] if sex else []
    if lines:
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
