"""Errors of `calibrate sync` by each method, and of a rig from a carried board, where cameras film
at 25, 30 and 60 frames per second and began at different times: python -m benchmarks.out_of_step
[person] [pointing] [shared] [board]

The recordings of `person`, `pointing` and `board` are made here; those of `shared` are in
../shared/data, or in $VOXELPOSE_SHARED/data.
"""

import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray
from scipy.io import wavfile
from scipy.signal import fftconvolve

from benchmarks.accuracy import SHARED
from benchmarks.agreement import recorded, tracked
from benchmarks.board_scene import BoardCamera, align_rigs, carried, room, without_poses
from calib.board import Board
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import pose_difference
from calib.files import write_rig
from calib.signals import Offset, SignalSettings, offsets_from_signals
from calib.synchronise import outline_signal
from calib.tangency import OutlineTrack
from silhouette_core.progress import SilentReporter
from voxelpose.calibration.extrinsics import ExtrinsicsSettings, extrinsics_from_recording
from voxelpose.calibration.sync import SyncSettings, sync_recording
from voxelpose.demo.choreography import performances
from voxelpose.demo.mannequin import Mannequin
from voxelpose.demo.room import FilmCamera, demo_rig
from voxelpose.recording.timestamps import TIMESTAMPS, write_timestamps

RATES = (25.0, 30.0, 60.0, 30.0)
BOARD = Board(8, 5, 0.1)
SOUND_HZ = 44100
METRES_PER_S = 343.0
DRAWS, BOARD_DRAWS = 3, 2
Picture = NDArray[np.uint8]


def write_film(
    path: Path, fps: float, pictures: Iterable[Picture], sound: NDArray[np.float64] | None = None
) -> None:
    """Writes an MP4 of pictures (H, W, 3) uint8, BGR, and of sound (S,), -1 to 1."""
    with tempfile.TemporaryDirectory() as scratch:
        wave = Path(scratch) / "sound.wav"
        if sound is not None:
            wavfile.write(wave, SOUND_HZ, np.int16(np.clip(sound, -1, 1) * 32767))
        writer = None
        for picture in pictures:
            if writer is None:
                writer = imageio_ffmpeg.write_frames(
                    str(path),
                    picture.shape[1::-1],
                    fps=fps,
                    pix_fmt_in="bgr24",
                    macro_block_size=1,
                    audio_path=None if sound is None else str(wave),
                    ffmpeg_log_level="error",
                )
                writer.send(None)
            writer.send(np.ascontiguousarray(picture))
        if writer is not None:
            writer.close()


def began(seed: int, count: int) -> NDArray[np.float64]:
    """Times (count,), s, at which cameras began."""
    return np.random.default_rng(seed).uniform(0, 2, count)


def restless(time_s: float) -> tuple:
    """Pose of the demo's actor, who repeats nothing at the same pace."""
    return performances()["there_and_back"].pose_at(time_s + 0.8 * np.sin(0.37 * time_s))


def clapping(
    seconds: float, distance_m: float, seed: int, noise: float
) -> Callable[[float], NDArray[np.float64]]:
    """Sound from a time on, as a microphone at a distance hears two claps in a room that echoes."""
    rng = np.random.default_rng(seed)
    dry = np.zeros(int((seconds + 4) * SOUND_HZ))
    length = int(0.01 * SOUND_HZ)
    burst = np.random.default_rng(1).normal(size=length) * np.exp(-np.arange(length) / length * 5)
    for at_s in (3.1, 3.9):
        begin = int((at_s + distance_m / METRES_PER_S) * SOUND_HZ)
        dry[begin : begin + length] += burst / distance_m
    echo = rng.normal(size=int(0.3 * SOUND_HZ)) * np.exp(-np.arange(int(0.3 * SOUND_HZ)) / 2500)
    echo = 0.05 * echo
    echo[0] = 1.0
    heard = fftconvolve(dry, echo)[: len(dry)] + noise * rng.normal(size=len(dry))
    heard *= 0.5 / np.abs(heard).max()
    return lambda begin_s: heard[int(begin_s * SOUND_HZ) :][: int(seconds * SOUND_HZ)]


def errors_ms(
    offsets: Sequence[Offset], truth_s: NDArray[np.float64]
) -> tuple[list[float], list[float]]:
    """Errors of the offsets, and the standard errors that were stated, without the reference's."""
    lines = list(zip(offsets, truth_s, strict=True))[1:]
    return (
        [1000 * (line.offset_s - true) for line, true in lines],
        [1000 * line.error_s for line, _ in lines],
    )


def tell(title: str, errors: Sequence[float], stated: Sequence[float], agreed: bool) -> None:
    size = np.abs(errors)
    print(
        f"{title:<34} error {size.mean():6.1f} ms, worst {size.max():6.1f}; stated"
        f" {np.sqrt(np.mean(np.square(stated))):5.1f}; {'written' if agreed else 'not written'}",
        flush=True,
    )


def person() -> None:
    """Somebody moves and claps before four cameras."""
    for draw in range(DRAWS):
        _filmed(f"person {draw}", restless, draw)


def pointing() -> None:
    """Somebody stands and points with one arm, now and then above the head."""
    _filmed("pointing", performances()["pointing"].pose_at, 0)


def _filmed(title: str, move: Callable[[float], tuple], draw: int) -> None:
    """Errors of all methods that need no board, from 14 s before four cameras."""
    seconds, rig, actor = 14.0, demo_rig(4), Mannequin.build()
    begin_s = began(draw, len(rig))
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        (folder / "background").mkdir()
        write_rig(rig, folder / "calibration.toml")
        for index, camera in enumerate(rig):
            view = FilmCamera(camera, np.random.default_rng((draw, index)))
            fps, name = RATES[index], f"{camera.name}.mp4"
            write_film(folder / "background" / name, fps, (view.empty() for _ in range(20)))
            times = begin_s[index] + np.arange(int(seconds * fps)) / fps
            vertices = (actor.pose(*move(float(time_s)))[0] for time_s in times)
            distance_m = float(np.linalg.norm(camera.center_m - [0, 0, 1.2]))
            sound = clapping(seconds, distance_m, 10 * draw + index, 0.01)
            write_film(
                folder / name,
                fps,
                (view.picture(v, actor.faces, actor.face_colour) for v in vertices),
                sound(begin_s[index]),
            )
        for by in ("geometry", "silhouettes", "sound"):
            if by != "geometry":
                (folder / "calibration.toml").unlink(missing_ok=True)
            sync = sync_recording(folder, SyncSettings(by=by, max_offset_s=2.5))
            found, stated = errors_ms(sync.result.offsets, begin_s[0] - begin_s)
            tell(f"{title}, by {by}", found, stated, sync.result.agreed)


def shared() -> None:
    """Silhouettes of shared recordings, cut by up to 0.4 s, every other camera at half its rate."""
    for name in ("walk4", "traffic4", "dance8", "balancing4"):
        rig, masks, fps = recorded(name)
        cut = np.random.default_rng(0).integers(0, int(0.4 * fps), len(rig))
        signals = []
        for index, track in enumerate(tracked(rig, masks, fps).values()):
            kept = np.arange(cut[index], len(track.time_s), 1 + index % 2)
            outlines = tuple(track.outlines[number] for number in kept)
            time_s = (kept - cut[index]) / fps
            signals.append(outline_signal(OutlineTrack(track.camera, time_s, outlines)))
        result = offsets_from_signals(signals, SignalSettings(1.0))
        found, stated = errors_ms(result.offsets, (cut[0] - cut) / fps)
        tell(f"{name}, {len(masks[rig.names[0]]) / fps:.1f} s", found, stated, result.agreed)


def board() -> None:
    """A board is carried before three cameras for 24 s."""
    seconds, rig = 24.0, room(3, 3.2, size=(960, 540), arc_deg=80)
    for draw in range(BOARD_DRAWS):
        begin_s, path = began(100 + draw, len(rig)), carried(rig, 26.0, draw)
        with tempfile.TemporaryDirectory() as scratch:
            even, mixed = Path(scratch) / "even", Path(scratch) / "mixed"
            even.mkdir(), mixed.mkdir()
            for index, camera in enumerate(rig):
                film = BoardCamera(camera, BOARD, index)
                for folder, fps in ((even, 30.0), (mixed, RATES[index])):
                    times = begin_s[index] + np.arange(int(seconds * fps)) / fps
                    target = folder / f"{camera.name}.mp4"
                    if folder is mixed and fps == 30.0:
                        shutil.copy(even / target.name, target)
                    else:
                        write_film(target, fps, (film.picture(path(float(t))) for t in times))
            _calibrated(f"board {draw}, 30 fps, as filmed", even, rig)
            for folder, title in ((even, "30 fps"), (mixed, "25, 30, 60 fps")):
                settings = SyncSettings(by="board", board=BOARD, lenses=without_poses(rig))
                sync = sync_recording(folder, settings)
                found, stated = errors_ms(sync.result.offsets, begin_s[0] - begin_s)
                tell(f"board {draw}, {title}, by board", found, stated, sync.result.agreed)
                sync.write(folder / TIMESTAMPS)
                _calibrated(f"board {draw}, {title}, in step", folder, rig)
                true = {
                    name: times_s + late
                    for (name, times_s), late in zip(sync.times.items(), begin_s, strict=True)
                }
                write_timestamps(folder / TIMESTAMPS, true)
                _calibrated(f"board {draw}, {title}, true times", folder, rig)


def _calibrated(title: str, folder: Path, truth: Rig) -> None:
    """Prints the errors of a rig from a recording of the board."""
    try:
        found = extrinsics_from_recording(
            BOARD, without_poses(truth), folder, ExtrinsicsSettings(), SilentReporter()
        )
    except InputError as error:
        print(f"{title:<34} refused: {error}", flush=True)
        return
    aligned = align_rigs(found.rig, truth)
    pairs = [pose_difference(aligned[camera.name], camera) for camera in truth]
    position_mm, rotation_deg = np.array(pairs).T
    print(
        f"{title:<34} reprojection {found.rms_px:5.2f} px, position {position_mm.mean():6.1f} mm,"
        f" worst {position_mm.max():6.1f}, rotation {rotation_deg.mean():.2f} deg",
        flush=True,
    )


PARTS = {"person": person, "pointing": pointing, "shared": shared, "board": board}


def main(names: list[str]) -> int:
    """Runs the named parts, or all."""
    if ("shared" in names or not names) and not (SHARED / "data").is_dir():
        print(f"no recordings in {SHARED / 'data'}: set VOXELPOSE_SHARED", file=sys.stderr)
        return 2
    for name in names or PARTS:
        PARTS[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
