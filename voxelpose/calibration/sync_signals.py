"""Signals by which a recording's cameras are synchronised: outlines, a carried board, sound."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.board import Board, BoardView
from calib.camera import Camera, Rig
from calib.correlation import Signal
from calib.errors import InputError
from calib.pairs import board_poses
from silhouette_core.progress import Reporter
from voxelpose.calibration.board_views import BoardFinder, check_lens_size
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.sound import has_sound, onsets
from voxelpose.recording.timestamps import Times

_LEAST_VIEWS = 20
_BOARD_HZ = 12  # how often the board is looked for: enough on the boards of docs/results.md


def board_signals(
    board: Board,
    readers: Mapping[str, FrameReader],
    times: Mapping[str, Times],
    lenses: Rig,
    window_s: tuple[float, float],
    reporter: Reporter,
) -> list[Signal]:
    """Speed of a carried board in space, m/s, which is the same for all cameras.

    Args:
        readers: pictures by camera name.
        times: (frames,) float64, s, by each camera's clock.
        window_s: begin and end of the part that is used, by each camera's clock.

    Raises:
        InputError: a lens is missing or is of another picture size, or a camera hardly sees the
            board.
    """
    signals = []
    for name, reader in readers.items():
        camera = _lens(lenses, name, reader)
        inside = np.flatnonzero((times[name] >= window_s[0]) & (times[name] <= window_s[1]))
        rate = 1 / max(float(np.median(np.diff(times[name]))), 1e-9)
        numbers = inside[:: max(1, int(rate / _BOARD_HZ))]
        reporter.stage(f"looking for the board in {name}", len(numbers))
        find, views = BoardFinder(board, stills=False), []
        for picture in reader.select(numbers.tolist()):
            views.append(find(picture))
            reporter.advance()
        seen = [isinstance(view, BoardView) for view in views]
        if sum(seen) < _LEAST_VIEWS:
            raise InputError(
                f"{name} saw the board in {sum(seen)} of {len(views)} frames ({find.failure()}):"
                " carry it nearer and for longer, or choose another way with --by"
            )
        signals.append(board_speed(board, camera, times[name][numbers], views))
    return signals


def board_speed(board: Board, camera: Camera, time_s: Times, views: list) -> Signal:
    """Speed (T, 1), m/s, of a board's middle relative to a camera; NaN where it is not seen.

    Args:
        time_s: (T,) float64, s.
        views: T views; what is no `BoardView` counts as not seen.
    """
    alone = replace(camera, rotation=np.eye(3), translation=np.zeros(3))
    places = np.full((len(time_s), 3), np.nan)
    for row, view in enumerate(views):
        poses = board_poses(board, alone, view) if isinstance(view, BoardView) else []
        if poses:
            best = min(poses, key=lambda pose: pose.error)
            places[row] = best.translation + best.rotation @ board.points_m.mean(axis=0)
    seen = np.flatnonzero(np.isfinite(places).all(axis=1))
    way, passed = np.diff(places[seen], axis=0), np.diff(time_s[seen])
    speed = np.linalg.norm(way, axis=1) / passed
    speed[passed > 3 / _BOARD_HZ] = np.nan
    middle_s = 0.5 * (time_s[seen][1:] + time_s[seen][:-1])
    return Signal(camera.name, middle_s, speed[:, None])


def sound_signals(paths: Mapping[str, Path], seconds: float, reporter: Reporter) -> list[Signal]:
    """Onsets of all videos' sound.

    Args:
        paths: videos by camera name.
        seconds: length of the part, from the beginning, that is used.

    Raises:
        InputError: a camera recorded no sound.
    """
    reporter.stage("sound", len(paths))
    if silent := [name for name in paths if not has_sound(paths[name])]:
        raise InputError(
            f"{', '.join(silent)} recorded no sound: choose another way with --by, such as"
            " --by silhouettes"
        )
    signals = []
    for name, path in paths.items():
        signals.append(onsets(path, name, seconds))
        reporter.advance()
    return signals


def _lens(lenses: Rig, name: str, reader: FrameReader) -> Camera:
    """The lens of a camera, of the size of its pictures."""
    if name not in lenses:
        raise InputError(
            f"no lens for {name}: the calibration has {', '.join(lenses.names)}; add it, or choose"
            " with --cameras"
        )
    check_lens_size(lenses[name], reader)
    return lenses[name]
