"""Rendered recordings as other cameras had filmed them: python -m benchmarks.altered KIND NAME ...

KIND `grey`: without colour, empty view included. `lost`: the second camera lost six frames of the
middle, which its times tell. `shaken`: every camera shakes by up to 5 px and 0.2 degrees, the empty
view included. NAME is a recording of ../shared/data (or $VOXELPOSE_SHARED), or a
folder. Prints a row for the recording and one for its copy, encoded alike (H.264): root_mm of `fit`
with the true stature where it is known, frames without a pose, intersection over union of the
silhouettes before completion with the true ones, where these are known, every 60th frame, and
verdict. Copies and results stay in
out/altered.
"""

import argparse
import json
import shutil
from pathlib import Path

import numpy as np

from benchmarks.overlap import SHARED, overlap, true_masks
from silhouette_core.estimator import Settings
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.motion.joint_files import read_joints
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.ffmpeg import QUIET, finished
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth
from voxelpose.reliability import verdict_of

OUT = Path(__file__).resolve().parents[1] / "out" / "altered"
EVERY = 60  # frames
_X, _Y = "(3*sin(1.1*on)+2*sin(0.37*on))", "(2*sin(0.9*on+1)+2*sin(0.29*on))"
_ROLL = "(0.0035*sin(0.61*on))"
_CORNERS = [
    f"x{i}='{x}+{_X}-{_ROLL}*({y}-H/2)':y{i}='{y}+{_Y}+{_ROLL}*({x}-W/2)'"
    for i, (x, y) in enumerate([("0", "0"), ("W", "0"), ("0", "H"), ("W", "H")])
]
FILTERS = {
    "plain": "null",
    "grey": "format=gray",
    "lost": "select='not(between(n,36,41))'",
    "shaken": f"perspective={':'.join(_CORNERS)}:interpolation=cubic:eval=frame",
}


def altered(folder: Path, kind: str) -> Path:
    """A copy of a recording, made if it is not there."""
    out = OUT / f"{folder.name}_{kind}"
    if out.exists():
        return out
    made = shutil.copytree(folder, out.with_suffix(".new"), dirs_exist_ok=True)
    videos = sorted(made.glob("*.mp4"))
    for video in [*videos, *made.glob("background/*.mp4")]:
        alone = kind == "lost" and video != videos[1]
        said = f"{FILTERS['plain' if alone else kind]},format=yuv420p"
        coded = "-fps_mode", "vfr", "-c:v", "libx264", "-crf", "15"
        target = video.with_suffix(".mkv")
        done = finished(*QUIET, "-y", "-i", str(video), "-vf", said, *coded, str(target))
        if done.returncode:
            raise SystemExit(f"FFmpeg could not write {target}: {done.stderr.strip()}")
        video.unlink()
    return made.rename(out)


def row(folder: Path, frames: tuple[int, int] | None) -> str:
    """Fits a recording and scores it."""
    recording = Recording.open(folder, frames)
    stature_m = json.loads((folder / "truth.json").read_text()).get("stature")
    result = OUT / "results" / folder.name
    written = fit(recording, Output(result, True, pictures=False), Settings(stature_m=stature_m))
    truth = read_truth(folder / "truth.json")
    if frames is not None:
        truth[frames[1] :] = np.nan
    score = score_motion(truth, read_joints(result / "joints.csv", len(truth)))
    common: list[float] = []
    if (folder / "masks/masks.npz").exists():
        silhouettes, true = Silhouettes(recording), true_masks(folder)
        for number, _, seen in recording:
            if number % EVERY == 0:
                found = silhouettes.of(seen)
                common += [overlap(mask, true[name][number]) for name, mask in found.items()]
    posed = written.summary["frames"]["with_pose"]  # type: ignore[index]
    total = (recording.numbers[-1] + 1) - recording.numbers[0]
    return (
        f"{folder.name:<18}{score.root_mm:>8.1f}{1 - posed / total:>8.3f}"
        f"{np.mean(common) if common else np.nan:>7.3f}  {verdict_of(written.summary).level}"
    )


def main() -> None:
    """Fits recordings and their copies."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("kind", choices=sorted({*FILTERS} - {"plain"}))
    parser.add_argument("recordings", nargs="+")
    parser.add_argument("--frames", type=int, help="the first so many frames only")
    given = parser.parse_args()
    frames = None if given.frames is None else (0, given.frames)
    print("recording          root_mm  no pose    IoU  verdict")
    for name in given.recordings:
        folder = Path(name) if Path(name).is_dir() else SHARED / "data" / name
        for kind in ("plain", given.kind):
            print(row(altered(folder, kind), frames), flush=True)


if __name__ == "__main__":
    main()
