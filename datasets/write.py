"""Writes a take as a recording folder.

It is written beside its place, then renamed: it is there whole, or not at all.
"""

import os
import shutil
import tomllib
from argparse import Namespace
from pathlib import Path

import cv2
import numpy as np
from take import InputError, Pictures, Recording, Rig, Take, View, write_rig
from truth import fitted, write_truth

_RATE_TOLERANCE = 0.01


def write(take: Take, out: Path, options: Namespace) -> str:
    """Writes the recording.

    Args:
        take: what the recipe read.
        out: the folder to make.
        options: of the command line: name, source, frames, silhouettes, no_truth, stature, sex,
            copy, overwrite.

    Returns:
        One line that says what was written.

    Raises:
        InputError: the take does not make a recording that can be opened, `out` stands in the way,
            or it cannot be written.
    """
    check_out(out, options.source, options.overwrite)
    beside = out.parent / f".{out.name}.{os.getpid()}"
    old = out.parent / f".{out.name}.{os.getpid()}.old"
    try:
        beside.mkdir()
        said = _fill(beside, take, options)
        if out.exists():
            out.rename(old)
        beside.rename(out)
    except InputError as error:
        raise InputError(str(error).replace(str(beside), str(out))) from None
    except OSError as error:
        raise InputError(
            f"{out} cannot be written: {error.strerror or error}: choose another place"
        ) from None
    finally:
        if old.exists() and not out.exists():
            old.rename(out)
        for folder in (beside, old):
            shutil.rmtree(folder, ignore_errors=True)
    return f"{out}: {said}"


def check_out(out: Path, source: Path, overwrite: bool) -> None:
    """Checks that `out` may be made.

    Raises:
        InputError: it exists and may not be replaced, the source is in it, or it has no parent.
    """
    if not out.parent.is_dir():
        raise InputError(f"{out.parent} is no folder: make it, or correct the recording's place")
    if source.resolve().is_relative_to(out.resolve()):
        raise InputError(
            f"{out} holds the data set itself: choose another folder for the recording"
        )
    if not out.exists():
        return
    if not overwrite:
        raise InputError(f"{out} exists: choose another folder, or replace it with --overwrite")
    if "data_set" not in _metadata(out / "calibration.toml"):
        raise InputError(
            f"{out} was not made by this command: remove it yourself or choose another folder"
        )


def _metadata(calibration: Path) -> dict:
    try:
        return tomllib.loads(calibration.read_text(encoding="utf-8")).get("metadata", {})
    except (OSError, ValueError):
        return {}


def _fill(folder: Path, take: Take, options: Namespace) -> str:
    """Writes all files; returns what they are."""
    views = [_without_pictures(view) if options.silhouettes else view for view in take.views]
    first, count = _range(views, options.frames)
    cut = options.frames is not None
    fps = _fps(take, views)
    rig = Rig(tuple(view.camera for view in views))
    notes = {"data_set": options.name, **take.notes}
    write_rig(rig, folder / "calibration.toml", notes=notes)
    for view in views:
        name = view.camera.name
        span = (view.start + first, count) if cut else None
        if view.pictures is not None:
            _place(view.pictures, folder / name, span, options.copy)
        if view.masks is not None:
            _place_masks(view, folder / "masks" / name, span, options.copy)
        if view.background is not None and not options.silhouettes:
            _place(view.background, folder / "background" / name, None, options.copy)
    if cut or _needs_timestamps(views, fps):
        _write_timestamps(folder / "timestamps.csv", views, fps, count if cut else None)
    _write_subject(folder / "subject.toml", options.stature, options.sex)
    truth = take.truth is not None and not options.no_truth
    if truth:
        known = fitted(take.truth, first, count)
        write_truth(folder / "truth.json", known, fps, take.approximate, options.name)
    recording = Recording.open(folder)
    recording.backgrounds()  # checks their sizes
    if recording.frame_count != count:
        raise InputError(
            f"the recording would have {recording.frame_count} frames instead of {count}: "
            "the files end early; choose frames that all have (--frames A:B)"
        )
    what = "silhouettes" if recording.silhouettes_given else "pictures"
    return f"{len(views)} cameras, {count} frames of {what}{', truth' if truth else ''}"


def _without_pictures(view: View) -> View:
    if view.masks is None:
        raise InputError(
            f"there are no masks of camera {view.camera.name}: leave out --silhouettes, "
            "or the camera"
        )
    return View(view.camera, None, view.start, view.masks, view.mask_above)


def _frames(view: View) -> Pictures:
    """Returns that by which the view's frames are counted."""
    if view.pictures is None and view.masks is None:
        raise InputError(
            f"camera {view.camera.name} has neither pictures nor masks: leave it out (--cameras)"
        )
    return view.pictures or view.masks


def _range(views: list[View], frames: tuple[int | None, int | None] | None) -> tuple[int, int]:
    """Returns the first frame of the take that is used, and how many."""
    if min(view.start for view in views) != 0:
        raise ValueError("frame 0 of a take must be the first frame of one of its files")
    end = min(_frames(view).count - view.start for view in views)
    start, stop = frames or (None, None)
    first, last = start or 0, end if stop is None else stop
    if not 0 <= first < last <= end:
        raise InputError(f"frames {first}:{last} are not in all cameras: choose from 0:{end}")
    return first, last - first


def _fps(take: Take, views: list[View]) -> float:
    """Returns the take's rate."""
    rates = [rate for view in views if (rate := _frames(view).fps) is not None]
    fps = take.fps if take.fps is not None else (float(np.median(rates)) if rates else None)
    if fps is None:
        raise InputError(
            "images do not tell how fast they were taken: give --fps, frames per second"
        )
    if not (np.isfinite(fps) and fps > 0):
        raise InputError(f"{fps} frames per second are impossible: give --fps as a positive number")
    return float(fps)


def _place(pictures: Pictures, target: Path, span: tuple[int, int] | None, copy: bool) -> None:
    """Puts a video or stills at a path without suffix; of a video, a span is decoded to stills."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if pictures.stills:
        chosen = pictures.stills if span is None else pictures.stills[span[0] : sum(span)]
        if pictures.path.is_file():
            _link(pictures.path, target.with_name(target.name + pictures.path.suffix.lower()), copy)
            return
        target.mkdir()
        for number, still in enumerate(chosen):
            _link(still, target / f"{number:06d}{still.suffix.lower()}", copy)
    elif span is None:
        _link(pictures.path, target.with_name(target.name + pictures.path.suffix.lower()), copy)
    else:
        target.mkdir()
        for number, frame in enumerate(pictures.frames(*span)):
            _write_image(target / f"{number:06d}.png", frame)


def _place_masks(view: View, target: Path, span: tuple[int, int] | None, copy: bool) -> None:
    """Puts masks as black and white images; a video of masks that is kept whole stays as it is."""
    masks = view.masks
    if masks.is_video and span is None:
        _place(masks, target, None, copy)
        return
    begin, count = span or (0, masks.count)
    target.mkdir(parents=True)
    for number, frame in enumerate(masks.frames(begin, count)):
        white = np.where(frame.max(axis=2) > view.mask_above, 255, 0).astype(np.uint8)
        _write_image(target / f"{number:06d}.png", white)


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


def _needs_timestamps(views: list[View], fps: float) -> bool:
    """Whether the files alone do not tell which frames belong together and how fast they are."""
    files = [_frames(view) for view in views]
    plain = all(one.fps and abs(one.fps / fps - 1) < _RATE_TOLERANCE for one in files)
    together = len({one.count for one in files}) == 1 and not any(view.start for view in views)
    return not (plain and together) and max(one.count for one in files) > 1


def _write_timestamps(file: Path, views: list[View], fps: float, count: int | None) -> None:
    """Writes when every frame was taken: frames that belong together have the same time."""
    latest = max(view.start for view in views)
    lines = ["cam_id,frame_time"]
    for view in views:
        frames = range(_frames(view).count) if count is None else range(count)
        offset = latest - view.start if count is None else 0
        lines += [f"{view.camera.name},{(number + offset) / fps:.6f}" for number in frames]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _write_subject(file: Path, stature: float | None, sex: str | None) -> None:
    lines = [f"stature = {stature}"] if stature is not None else []
    lines += [f'sex = "{sex}"'] if sex else []
    if lines:
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
