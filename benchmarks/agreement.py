"""Accuracy of `calibrate check` and `calibrate sync` on recordings with artificial defects:
python -m benchmarks.agreement [whole] [bumps] [breaks] [sync] [fit]

Silhouettes come from the videos. The recordings are in ../shared/data, or in
$VOXELPOSE_SHARED/data.
"""

import json
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

from benchmarks.accuracy import SHARED
from calib.agreement import Agreement, agreement
from calib.camera import Camera, Rig
from calib.extrinsics import pose_difference
from calib.moments import even_moments
from calib.repair import explain
from calib.rotation import matrix_from_rodrigues
from calib.synchronise import Synchronisation, synchronise
from calib.tangency import OutlineTrack
from silhouette_core.estimator import Settings
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.motion.joint_files import read_joints
from voxelpose.calibration.check import LONG_SIDE_PX
from voxelpose.calibration.sync import SyncSettings, sync_recording
from voxelpose.demo.room import make_recording
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.timestamps import TIMESTAMPS
from voxelpose.recording.truth import read_truth

MOMENTS = 12
MAX_OFFSET_FRAMES = 12
AXES = {"nod": (1.0, 0, 0), "pan": (0, 1.0, 0), "roll": (0, 0, 1.0)}
SIZES_DEG = (0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0, 5.0)
Masks = dict[str, list[np.ndarray]]


@cache
def recorded(name: str) -> tuple[Rig, Masks, float]:
    """Rig, silhouettes of every frame, and frame rate of a recording.

    balancing4* is balancing4 with the pose of its cam_3 corrected.
    """
    with tempfile.TemporaryDirectory() as folder:
        recording = Recording.open(_folder(name.rstrip("*"), Path(folder)))
        silhouettes = Silhouettes(recording, long_side_px=LONG_SIDE_PX)
        masks: Masks = {camera: [] for camera in recording.rig.names}
        for _, _, frames in recording:
            for camera, mask in silhouettes.of(frames).items():
                masks[camera].append(mask)
    rig = recording.rig
    if name.endswith("*"):
        tracks = tracked(rig, masks, recording.fps)
        moments = even_moments(recording.frame_count, MOMENTS) / recording.fps
        (repair,) = explain(tracks, agreement(list(tracks.values()), moments), moments, 0.0)
        rig = repair.rig(rig)
    return rig, masks, recording.fps


def _folder(name: str, scratch: Path) -> Path:
    if name == "demo":
        return make_recording(scratch)
    if name != "standing4":
        return SHARED / "data" / name
    source = SHARED / "data" / name
    (scratch / "background").mkdir()
    shutil.copy(source / "calibration.toml", scratch)
    for number in range(1, 5):
        shutil.copy(source / f"cam_{number}_person_and_board.avi", scratch / f"cam_{number}.avi")
        shutil.copy(
            source / f"cam_{number}_background.avi", scratch / f"background/cam_{number}.avi"
        )
    return scratch


def tracked(rig: Rig, masks: Masks, fps: float) -> dict[str, OutlineTrack]:
    return {
        camera.name: OutlineTrack.from_masks(
            camera, np.arange(len(masks[camera.name])) / fps, masks[camera.name]
        )
        for camera in rig
    }


def checked(tracks: dict[str, OutlineTrack], fps: float) -> tuple[Agreement, np.ndarray]:
    moments = even_moments(min(len(track.time_s) for track in tracks.values()), MOMENTS) / fps
    return agreement(list(tracks.values()), moments), moments


def bumped(
    camera: Camera, degrees: float, axis: tuple[float, float, float], shift_m: float = 0.0
) -> Camera:
    turn = matrix_from_rodrigues(np.radians(degrees) * np.array(axis) / np.linalg.norm(axis))
    return replace(
        camera,
        rotation=turn @ camera.rotation,
        translation=turn @ camera.translation + np.array([shift_m, 0, 0]),
    )


def letterboxed(masks: list[np.ndarray], fraction: float) -> list[np.ndarray]:
    height, width = masks[0].shape
    inner = round(height * fraction)
    top = (height - inner) // 2
    pictures = []
    for mask in masks:
        small = (
            cv2.resize(mask.astype(np.uint8) * 255, (width, inner), interpolation=cv2.INTER_AREA)
            > 127
        )
        pictures.append(np.pad(small, ((top, height - inner - top), (0, 0))))
    return pictures


def whole() -> None:
    """Agreement of the unmodified recordings."""
    for name in ("walk4", "traffic4", "dance8", "standing4", "demo", "balancing4", "balancing4*"):
        rig, masks, fps = recorded(name)
        tracks = tracked(rig, masks, fps)
        started = time.perf_counter()
        result, _ = checked(tracks, fps)
        worst = max(line.error_px for line in result.table)
        seconds = 1000 * (time.perf_counter() - started)
        print(
            f"{name:<12} {result.error_px:5.2f} px, worst camera {worst:5.2f} px,"
            f" {seconds:3.0f} ms: {result.summary}",
            flush=True,
        )


def bumps() -> None:
    """Smallest rotation that is detected."""
    print(
        f"{'recording':<12} {'turn':<5}"
        + "".join(f"{size:>7}°" for size in SIZES_DEG)
        + "   named rightly, of all cameras; wrongly: another"
    )
    for name in ("walk4", "traffic4", "dance8", "balancing4*"):
        rig, masks, fps = recorded(name)
        tracks = tracked(rig, masks, fps)
        for turn, axis in AXES.items():
            cells, wrong = [], 0
            for size in SIZES_DEG:
                right = 0
                for camera in rig:
                    result, _ = checked(
                        tracks
                        | {
                            camera.name: tracks[camera.name].with_camera(bumped(camera, size, axis))
                        },
                        fps,
                    )
                    right += result.culprits == (camera.name,)
                    wrong += bool(set(result.culprits) - {camera.name})
                cells.append(f"{right}/{len(rig)}")
            print(
                f"{name:<12} {turn:<5}"
                + "".join(f"{cell:>8}" for cell in cells)
                + f"   wrongly {wrong}",
                flush=True,
            )


def broken(name: str) -> Iterator[tuple[str, str, dict[str, OutlineTrack], Camera]]:
    """Yields each defect of a recording: kind, camera, tracks, and the original camera."""
    rig, masks, fps = recorded(name)
    tracks = tracked(rig, masks, fps)
    delay = round(0.1 * fps)
    for index, camera in enumerate(rig):
        own, own_masks = tracks[camera.name], masks[camera.name]
        other = rig.cameras[(index + 1) % len(rig)]
        yield (
            "turned",
            camera.name,
            tracks | {camera.name: own.with_camera(bumped(camera, 3, (0.6, 0.8, 0)))},
            camera,
        )
        yield (
            "moved",
            camera.name,
            tracks | {camera.name: own.with_camera(bumped(camera, 3, (0.6, 0.8, 0), 0.2))},
            camera,
        )
        delayed = replace(own, time_s=own.time_s + delay / fps)
        yield "out of step", camera.name, tracks | {camera.name: delayed}, camera
        box = OutlineTrack.from_masks(camera, own.time_s, letterboxed(own_masks, 0.75))
        yield "scaled", camera.name, tracks | {camera.name: box}, camera
        if camera.size == other.size:
            swap = {
                camera.name: tracks[other.name].with_camera(camera),
                other.name: own.with_camera(other),
            }
            yield "swapped", camera.name, tracks | swap, camera


def breaks() -> None:
    """Diagnosis of each defect, and accuracy of its repair."""
    for name in ("walk4", "balancing4*"):
        outcomes: dict[str, list[tuple[bool, bool, float, float, float, float]]] = {}
        fps = recorded(name)[2]
        for kind, camera, tracks, original in broken(name):
            result, moments = checked(tracks, fps)
            repairs = explain(tracks, result, moments, MAX_OFFSET_FRAMES / fps)
            line = (False, False, np.nan, np.nan, np.nan, np.nan)
            if len(repairs) == 1 and camera in (repairs[0].camera, repairs[0].with_camera):
                repair = repairs[0]
                mm, deg = (
                    (np.nan, np.nan)
                    if repair.with_camera
                    else pose_difference(repair.after, original)
                )
                frames = abs(repair.offset_s * fps - (kind == "out of step") * round(0.1 * fps))
                line = True, repair.kind == kind, mm, deg, frames, repair.after_px
            outcomes.setdefault(kind, []).append(line)
        for kind, lines in outcomes.items():
            named, right, *numbers = zip(*lines, strict=True)
            mm, deg, frames, px = (_spread(column) for column in numbers)
            print(
                f"{name:<12} {kind:<12} named {sum(named)}/{len(lines)}, as such"
                f" {sum(right)}/{len(lines)}; median/worst after repair: {mm} mm, {deg} deg,"
                f" {frames} frames, {px} px",
                flush=True,
            )


def _spread(values: tuple[float, ...]) -> str:
    known = [value for value in values if np.isfinite(value)]
    return f"{np.median(known):.2f}/{np.max(known):.2f}" if known else "-"


def in_between(masks: list[np.ndarray], frames: float) -> list[np.ndarray]:
    """Silhouettes shifted by a fraction of a frame: weighted means of signed distance fields."""
    fields = [
        cv2.distanceTransform(m.astype(np.uint8), cv2.DIST_L2, 3)
        - cv2.distanceTransform((~m).astype(np.uint8), cv2.DIST_L2, 3)
        for m in masks
    ]
    return [(1 - frames) * a + frames * b > 0 for a, b in pairwise(fields)]


def sync() -> None:
    """Errors of the estimated offsets of shifted cameras, in frames."""
    for name in ("walk4", "traffic4", "demo", "dance8", "balancing4*"):
        rig, masks, fps = recorded(name)
        tracks = list(tracked(rig, masks, fps).values())
        unshifted = synchronise(tracks, 1.0)
        print(f"{name:<12} as filmed: {_worst(unshifted, np.zeros(len(rig)), fps)}", flush=True)
        rng = np.random.default_rng(0)
        for kind in ("whole", "fractional", "half rate"):
            cut = rng.integers(0, 12, len(rig)).astype(float)
            shifted = []
            for index, (camera, skipped) in enumerate(zip(rig, cut, strict=True)):
                part = 0.25 * (1 + index % 3) if kind == "fractional" else 0.0
                selected = in_between(masks[camera.name], part) if part else masks[camera.name]
                step = 2 if kind == "half rate" and index % 2 else 1
                selected = selected[int(skipped) :: step]
                cut[index] += part
                shifted.append(
                    OutlineTrack.from_masks(camera, np.arange(len(selected)) * step / fps, selected)
                )
            result = synchronise(shifted, 1.0)
            print(
                f"{name:<12} {kind:<11}: {_worst(result, -(cut - cut[0]), fps)};"
                f" {result.before_px:.1f} -> {result.after_px:.2f} px",
                flush=True,
            )


def _worst(result: Synchronisation, frames: np.ndarray, fps: float) -> str:
    errors = np.array([line.offset_s * fps for line in result.offsets]) - frames
    stated = np.array([line.error_s * fps for line in result.offsets])
    mean, worst = np.abs(errors[1:]).mean(), np.abs(errors).max()
    return (
        f"error {mean:.3f} frames, worst {worst:.3f}; stated standard error up to"
        f" {np.nanmax(stated):.3f}"
    )


def fitted() -> None:
    """Fits of dance8 with videos started up to 9 frames apart, before and after synchronisation."""
    source = SHARED / "data" / "dance8"
    stature_m = json.loads((source / "truth.json").read_text())["stature"]
    truth = read_truth(source / "truth.json")
    cut = {
        "cam_0": 4,
        "cam_1": 9,
        "cam_2": 0,
        "cam_3": 7,
        "cam_4": 2,
        "cam_5": 6,
        "cam_6": 1,
        "cam_7": 5,
    }
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "dance8"
        shutil.copytree(source / "background", folder / "background")
        shutil.copy(source / "calibration.toml", folder)
        for name, skipped in cut.items():
            frames = list(Recording.open(source, cameras=[name]).readers[name])[skipped:80]
            (folder / name).mkdir()
            for number, frame in enumerate(frames):
                cv2.imwrite(str(folder / name / f"{number:04d}.png"), frame)
        offsets = sync_recording(
            folder, SyncSettings(max_offset_s=1.0, rates=dict.fromkeys(cut, 30.0))
        )
        for title, stamped in (("as filmed", False), ("in step", True)):
            if stamped:
                offsets.write(folder / TIMESTAMPS)
            recording = Recording.open(folder, (10, 34), fps=None if stamped else 30.0)
            out = Path(scratch) / "out"
            fit(
                recording,
                Output(out, overwrite=True, pictures=False),
                Settings(stature_m=stature_m),
            )
            # Frame 0 of the recording is the clock's first that all have.
            clock = 9 if stamped else cut["cam_0"]
            score = score_motion(truth, read_joints(out / "joints.csv", len(truth), clock))
            print(
                f"dance8 shifted, {title}: root_mm {score.root_mm:.1f}, mpjpe_mm"
                f" {score.mpjpe_mm:.1f}, frames {score.frames}",
                flush=True,
            )
    recording = Recording.open(source, (19, 43))
    with tempfile.TemporaryDirectory() as scratch:
        fit(
            recording,
            Output(Path(scratch) / "out", overwrite=True, pictures=False),
            Settings(stature_m=stature_m),
        )
        score = score_motion(truth, read_joints(Path(scratch) / "out" / "joints.csv", len(truth)))
        print(
            f"dance8 as it is, the same moments: root_mm {score.root_mm:.1f}, mpjpe_mm"
            f" {score.mpjpe_mm:.1f}, frames {score.frames}",
            flush=True,
        )


PARTS = {"whole": whole, "bumps": bumps, "breaks": breaks, "sync": sync, "fit": fitted}


def main(names: list[str]) -> int:
    """Runs the named parts, or all."""
    if not (SHARED / "data").is_dir():
        print(f"no recordings in {SHARED / 'data'}: set VOXELPOSE_SHARED", file=sys.stderr)
        return 2
    for name in names or PARTS:
        PARTS[name]()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
