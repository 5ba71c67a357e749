"""Fits recordings with a part of one camera unknown: `python -m benchmarks.unknown_places [ROW]`.

Each recording (../shared/data/walk4, and those that ../shared/render/draw.py draws for seeds 551
and 552 at level 1) is made again in out/unknown_places in four ways: `whole`, as it is; `hidden`,
the lower third of one camera behind grey furniture, in its video and its empty view; `marked`, the
same with unknown/CAMERA.png; `painted`, as it is with that picture. Each is fitted and scored: mean
absolute errors of the ankles and of all joints, mm. A row `walk4:0.5` hides so much of the
picture's height instead of a third, `walk4:0.5:cam_0+cam_2` chooses the cameras, and
`walk4:0.5:cam_2:marked` one of the ways.
"""

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.joint_files import read_joints
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.truth import read_truth

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "unknown_places"
SHARED = Path(os.environ.get("VOXELPOSE_SHARED", ROOT.parent / "shared"))
SEEDS = 551, 552
WAYS = "whole", "hidden", "marked", "painted"
_FURNITURE = 118, 121, 124  # BGR
_NOISE = 2.0  # of the furniture's pixels, as of a camera's
_ANKLES = [LANDMARK_NAMES.index(f"{side}_ankle") for side in ("left", "right")]


def original(name: str) -> Path:
    """Folder of a recording, drawn first where it is not there."""
    if not name.isdigit():
        return SHARED / "data" / name
    folder = OUT / "drawn"
    found = sorted(folder.glob(f"*{name}*"))
    if not found:
        script = SHARED / "render" / "draw.py"
        command = [sys.executable, str(script), str(folder), name, "--level", "1"]
        subprocess.run(command, cwd=script.parent, check=True)
        found = sorted(folder.glob(f"*{name}*"))
    return found[0]


def make(source: Path, cameras: Sequence[str], share: float, way: str, target: Path) -> Path:
    """Makes a recording again with the lower part of some cameras' pictures hidden or marked."""
    if target.exists():
        return target
    recording = Recording.open(source)
    unknown = {}
    for name in cameras:
        width, height = recording.rig[name].size
        unknown[name] = np.zeros((height, width), bool)
        unknown[name][round((1 - share) * height) :] = True
    (target / "background").mkdir(parents=True)
    for path in (*source.iterdir(), *(source / "background").iterdir()):
        hidden = path.stem in cameras and way in ("hidden", "marked")
        if path.is_file() and not hidden:
            (target / path.relative_to(source)).symlink_to(path.resolve())
        elif path.is_file():
            reader, place = FrameReader.open(path), path.relative_to(source).with_suffix(".mkv")
            _write(target / place, reader, reader.fps or recording.fps, unknown[path.stem])
    if way in ("marked", "painted"):
        (target / "unknown").mkdir()
        for name, mask in unknown.items():
            cv2.imwrite(str(target / "unknown" / f"{name}.png"), mask.astype(np.uint8) * 255)
    return target


def _write(path: Path, frames: FrameReader, fps: float, unknown: NDArray[np.bool_]) -> None:
    """Writes frames without loss, with furniture where nothing is to be seen."""
    rng, size = np.random.default_rng(0), unknown.shape[::-1]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"FFV1"), fps, size)
    for frame in frames:
        noise = rng.normal(0, _NOISE, (*unknown.shape, 3)) + _FURNITURE
        furniture = np.clip(noise, 0, 255).astype(np.uint8)
        writer.write(np.where(unknown[..., None], furniture, frame))
    writer.release()


def ankle_error_mm(truth_m: NDArray[np.float64], joints_m: NDArray[np.float64]) -> float:
    """Mean distance of the ankles (T, 15, 3) from the truth."""
    return 1000 * float(
        np.nanmean(np.linalg.norm(joints_m[:, _ANKLES] - truth_m[:, _ANKLES], axis=-1))
    )


def rows(words: list[str]) -> Iterator[tuple[str, str, float, str]]:
    """Name, cameras, share and way of every fit that is asked for."""
    for word in words or ["walk4", *map(str, SEEDS)]:
        name, share, camera, way = (*word.split(":"), "", "", "")[:4]
        for one in (way,) if way else WAYS:
            yield name, camera, float(share or 1 / 3), one


def main(words: list[str]) -> int:
    """Makes, fits and scores recordings."""
    if not (SHARED / "data").is_dir():
        print(f"{SHARED / 'data'} is absent: nothing to fit", file=sys.stderr)
        return 2
    print(f"{'recording':<26}{'ankles_mm':>10}{'mpjpe_mm':>10}{'root_mm':>9}{'lost':>6}{'s':>7}")
    for name, camera, share, way in rows(words):
        source = original(name)
        camera = camera or Recording.open(source).rig.names[0]
        folder = OUT / f"{name}_{camera}_{share:.2f}_{way}"
        names = camera.split("+")
        recording = Recording.open(make(source, names, share, way, folder / "recording"))
        started = time.perf_counter()
        fit(recording, Output(folder / "result", overwrite=True, pictures=way != "whole"))
        spent_s = time.perf_counter() - started
        truth = read_truth(source / "truth.json")
        joints = read_joints(folder / "result" / "joints.csv", len(truth))
        scored = score_motion(truth, joints)
        print(
            f"{f'{name} {camera} {way}':<26}{ankle_error_mm(truth, joints):>10.1f}"
            f"{scored.mpjpe_mm:>10.1f}{scored.root_mm:>9.1f}{scored.lost:>6.2f}{spent_s:>7.0f}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
