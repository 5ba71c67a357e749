"""Who and what comes beside people: `python -m benchmarks.comings SEED ... [--frames 150]`

Two people of ../shared/render before four cameras (level 1), with one thing changed in the
pictures. `away`: the second is painted over by the empty view for 2.3 s in the middle, and what of
the first is behind, too: choose seeds whose people are side by side. `crate`: a crate of 0.45 x
0.45 x 0.9 m stands beside them from a third of the time on; `dog`: one of 0.75 x 0.3 x 0.6 m
passes. Fits each with nothing told, and prints how many people are found, in how many frames
somebody is away and has no pose, root_mm, in how much of the time something is seen beside those
found, and the verdicts. Recordings and results stay in out/comings.
"""

import argparse
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.drawn import drawn
from calib.camera import Camera
from voxelpose.evaluation import evaluate_people
from voxelpose.fitting import Output, fit_people
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import TRUTH, read_people_truth
from voxelpose.reliability import verdict_of

OUT = Path(__file__).resolve().parents[1] / "out" / "comings"
AWAY_S = 2.3
CHANGES = "away", "crate", "dog"
_SIZES_M = {"crate": (0.45, 0.45, 0.9), "dog": (0.75, 0.3, 0.6)}
_PLACES_M = {"crate": (-0.3, -1.0), "dog": (-1.2, -1.0)}
_DOG_M_S = 0.5
_BROWN = 40, 60, 75

Picture = NDArray[np.uint8]
Change = Callable[[Picture, int], Picture]


def pictures(video: Path) -> Iterator[Picture]:
    """All pictures of a video."""
    capture = cv2.VideoCapture(str(video))
    while (read := capture.read())[0]:
        yield np.asarray(read[1], np.uint8)


def changed(folder: Path, kind: str, count: int) -> Path:
    """A copy of a recording with one thing changed, losslessly encoded."""
    out = OUT / f"{folder.name}_{kind}"
    if out.exists():
        return out
    made = shutil.copytree(folder, out.with_suffix(".new"), dirs_exist_ok=True)
    recording, people = Recording.open(folder), np.load(folder / "masks" / "people.npz")
    gone_s = 0.5 * (count - AWAY_S * recording.fps), 0.5 * (count + AWAY_S * recording.fps)
    gone = range(*(round(step) for step in gone_s))
    for camera in recording.rig:
        (video,) = made.glob(f"{camera.name}.*")
        seen = people[camera.name]
        if kind == "away":
            change = painted_over(folder, camera, seen, gone)
        else:
            change = beside(folder, camera, seen, kind, count // 3)
        told = cv2.VideoWriter.fourcc(*"FFV1"), recording.fps, camera.size
        writer = cv2.VideoWriter(str(video.with_suffix(".mkv")), *told)
        for t, picture in enumerate(pictures(video)):
            writer.write(change(picture, t))
        writer.release()
        video.unlink()
    if kind == "away":
        truth = json.loads((made / TRUTH).read_text())
        for places in truth["people"][1]["joints"].values():
            places[gone.start : gone.stop] = [[float("nan")] * 3] * len(gone)
        (made / TRUTH).write_text(json.dumps(truth))
    return made.rename(out)


def painted_over(folder: Path, camera: Camera, seen: Picture, gone: range) -> Change:
    """Paints the second person over by the empty view."""
    (empty,) = (folder / "background").glob(f"{camera.name}.*")
    views = list(pictures(empty))

    def change(picture: Picture, t: int) -> Picture:
        if t not in gone:
            return picture
        near = cv2.dilate((seen[t] == 2).astype(np.uint8), np.ones((7, 7), np.uint8))
        own = (near > 0) & (seen[t] != 1)
        return np.where(own[..., None], views[t % len(views)], picture)

    return change


def beside(folder: Path, camera: Camera, seen: Picture, kind: str, first: int) -> Change:
    """Draws a box behind the people who are nearer to the camera."""
    pelvis_m = np.stack([joints[:, 0] for joints in read_people_truth(folder / TRUTH)])
    centre_m = -camera.rotation.T @ camera.translation
    signs = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (0, 1)])
    rng = np.random.default_rng(1)

    def change(picture: Picture, t: int) -> Picture:
        if t < first:
            return picture
        place_m = np.array([*_PLACES_M[kind], 0.0])
        if kind == "dog":
            place_m[0] += _DOG_M_S * (t - first) / 30
        pixels, _ = camera.project(place_m + signs * _SIZES_M[kind])
        shown = np.zeros(picture.shape[:2], np.uint8)
        cv2.fillConvexPoly(shown, cv2.convexHull(pixels.round().astype(np.int32)), 1)
        box = shown > 0
        away_m = np.linalg.norm((place_m - centre_m)[:2])
        for k, own_m in enumerate(pelvis_m[:, t]):
            if np.linalg.norm((own_m - centre_m)[:2]) < away_m:
                box &= seen[t] != k + 1
        grain = rng.normal(_BROWN, 3, picture.shape).clip(0, 255).astype(np.uint8)
        return np.where(box[..., None], grain, picture)

    return change


def main() -> None:
    """Draws, changes, fits and scores."""
    words = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    words.add_argument("seeds", nargs="+", type=int)
    words.add_argument("--frames", type=int, default=150)
    given = words.parse_args()
    options = ("--people", "2", "--cameras", "4", "--frames", str(given.frames))
    print("recording     found  away  lost  root_mm  beside  verdicts")
    for folder in drawn(OUT / f"drawn_{given.frames}", given.seeds, 1, options=options):
        for kind in CHANGES:
            recording = Recording.open(changed(folder, kind, given.frames))
            out = OUT / "results" / recording.folder.name
            results = fit_people(recording, Output(out, True, pictures=False))
            summaries: list[Any] = [result.summary for result in results]
            frames = [summary["frames"] for summary in summaries]
            root_mm = [one.root_mm for one in evaluate_people(out).values()]
            share = max(float(summary["facts"]["unexplained_frames"]) for summary in summaries)
            print(
                f"{recording.folder.name:<12}{len(results):>7}"
                f"{sum(len(one['away']) for one in frames):>6}"
                f"{sum(len(one['lost']) for one in frames):>6}"
                f"{np.nanmean(root_mm):>9.1f}{share:>8.2f}  "
                + " ".join(verdict_of(summary).level for summary in summaries),
                flush=True,
            )


if __name__ == "__main__":
    main()
