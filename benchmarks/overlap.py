"""Silhouettes against the true masks of rendered recordings: the paper's section 5.1 and the
refined method.

    python -m benchmarks.overlap [RECORDING ...] [--every N] [--grey]

Prints, per recording, the mean over cameras and frames of intersection over union, the fraction of
frames under 0.9, and processor time per frame in ms on one thread, without decoding. --grey first
removes the person's colour from every frame.
"""

import argparse
import os
import time
from pathlib import Path

import cv2
import numpy as np

from silhouette_core.image.background import BackgroundModel
from silhouette_core.jit import set_threads
from voxelpose.recording.folder import Recording

SHARED = Path(os.environ.get("VOXELPOSE_SHARED", Path(__file__).resolve().parents[2] / "shared"))
RECORDINGS = ("walk4", "dance8", "traffic4", "swing1", "turn1")
DISC = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))


def true_masks(folder: Path) -> dict[str, np.ndarray]:
    with np.load(folder / "masks/masks.npz") as packed:
        width = int(packed["width"])
        return {
            name: np.unpackbits(packed[name], axis=2)[:, :, :width].astype(bool)
            for name in packed.files
            if name != "width"
        }


def overlap(result: np.ndarray, truth: np.ndarray) -> float:
    return float((result & truth).sum() / max((result | truth).sum(), 1))


def greyed(frame: np.ndarray, empty: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Frame with a person as grey and bright as concrete, with the same shading and edges."""
    coverage = cv2.GaussianBlur(truth.astype(np.float32), (3, 3), 0.7)[..., None]
    person = np.where(
        coverage > 0.3, (frame - (1 - coverage) * empty) / np.maximum(coverage, 0.3), frame
    )
    inside = person[truth].max(axis=1)
    shade = (
        np.clip(person.max(axis=2, keepdims=True) / max(float(np.median(inside)), 1.0), 0.7, 1.3)
        if len(inside)
        else 1.0
    )
    return np.clip(np.rint(coverage * 110 * shade + (1 - coverage) * frame), 0, 255).astype(
        np.uint8
    )


def measure(folder: Path, every: int, grey: bool) -> dict[str, np.ndarray]:
    recording, truth = Recording.open(folder), true_masks(folder)
    backgrounds = recording.backgrounds()
    paper = {
        name: BackgroundModel.from_frames(frames, "paper") for name, frames in backgrounds.items()
    }
    refined = {name: BackgroundModel.from_frames(frames) for name, frames in backgrounds.items()}
    results: dict[str, list[float]] = {
        "paper": [],
        "paper, opened": [],
        "refined": [],
        "paper ms": [],
        "refined ms": [],
    }
    for index, _, frames in recording:
        if index % every:
            continue
        for name, recorded in frames.items():
            frame = greyed(recorded, paper[name].mean, truth[name][index]) if grey else recorded
            started = time.thread_time()
            plain = paper[name].silhouette(frame)
            between = time.thread_time()
            mask, _ = refined[name].look(frame)
            results["refined ms"].append(1e3 * (time.thread_time() - between))
            results["paper ms"].append(1e3 * (between - started))
            opened = cv2.morphologyEx(plain.view(np.uint8), cv2.MORPH_OPEN, DISC).view(bool)
            for method, result in (("paper", plain), ("paper, opened", opened), ("refined", mask)):
                results[method].append(overlap(result, truth[name][index]))
    return {key: np.array(values) for key, values in results.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("recordings", nargs="*", default=RECORDINGS)
    parser.add_argument("--every", type=int, default=1, help="measure every n-th frame only")
    parser.add_argument("--grey", action="store_true", help="remove the person's colour")
    given = parser.parse_args()
    set_threads(1)
    cv2.setNumThreads(1)
    print(
        "| recording | paper 5.1 | paper 5.1, opened | refined | refined, worst frame | refined"
        " under 0.9 | paper ms | refined ms |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name in given.recordings:
        result = measure(SHARED / "data" / name, given.every, given.grey)
        low = (result["refined"] < 0.9).mean()
        cells = [f"{result[key].mean():.4f}" for key in ("paper", "paper, opened", "refined")]
        cells += [
            f"{result['refined'].min():.3f}",
            f"{low:.1%}",
            f"{np.median(result['paper ms']):.1f}",
            f"{np.median(result['refined ms']):.1f}",
        ]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
