"""Bodies from one recording, used for a later one of the same person.

`python -m benchmarks.body_fit [--seeds FIRST LAST]` draws two recordings of each person (seeds 101
to 120 of level 1 unless others are given; the same seed with another motion is the same person in
other clothes, before other cameras), estimates the body from the first as `voxelpose body fit`
does, and fits the second without that body and with it. Prints a line per person: error of the
stature and mean error of eight limb lengths in per cent, and root_mm of the second recording
without and with the body. What was made before is kept in out/body_fit; delete it to make it again.
"""

from __future__ import annotations

import argparse
import json
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.drawn import drawn
from benchmarks.given_body import LIMBS as LIMBS_AND_HIPS
from silhouette_core.body.body_file import read_body, unclothed, write_body
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Settings
from silhouette_core.progress import SilentReporter
from silhouette_core.refinement.adaptation import stature_of
from voxelpose.evaluation import evaluate
from voxelpose.fitting import Output, fit
from voxelpose.multiview.person.body_estimate import estimate_body, posed_frames
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import TRUTH, read_truth

OUT = Path(__file__).resolve().parents[1] / "out" / "body_fit"
LIMBS = LIMBS_AND_HIPS[:8]


def later_recordings(seeds: Sequence[int], earlier: Sequence[Path]) -> list[Path]:
    """For each person a recording of another kind of motion: the clip of the next recording that
    shows one, and can be drawn for this person.
    """
    clips = [json.loads((folder / "scene.json").read_text())["clip"] for folder in earlier]
    kinds = [clip.rsplit("_", 1)[0] for clip in clips]
    return [
        _later(
            seed,
            [
                other
                for other, kind in zip(clips[k:] + clips[:k], kinds[k:] + kinds[:k], strict=True)
                if kind != kinds[k]
            ],
        )
        for k, seed in enumerate(seeds)
    ]


def _later(seed: int, clips: Sequence[str]) -> Path:
    """A recording with the first of some clips that can be drawn."""
    for clip in clips:
        try:
            return drawn(OUT / "later", [seed], 1, clip)[0]
        except subprocess.CalledProcessError:
            continue  # too short, or it leaves the room
    raise SystemExit(f"no other motion can be drawn for seed {seed}: give more seeds")


def body_of(seed: int, recording: Path) -> Path:
    """File of the body estimated from a recording, made if it is not there."""
    path = OUT / "bodies" / f"{seed}.toml"
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.exists():
        seen = posed_frames(Recording.open(recording), Settings(), SilentReporter())
        found = estimate_body([seen], Settings(), SilentReporter())
        errors = dict(zip(found.names, found.standard_errors(), strict=True))
        write_body(found.model, path, f"of random recording {seed}", errors)
    return path


def lengths_m(joints: np.ndarray) -> np.ndarray:
    """Limb lengths (8,) of joint positions (F, 15, 3): medians of the frames."""
    pairs = [[LANDMARK_NAMES.index(name) for name in limb] for limb in LIMBS]
    return np.array(
        [np.median(np.linalg.norm(joints[:, a] - joints[:, b], axis=1)) for a, b in pairs]
    )


def size_errors(body: BodyModel, recording: Path) -> tuple[float, np.ndarray]:
    """Relative errors of the stature and of the (8,) limb lengths."""
    true_m = json.loads((recording / "scene.json").read_text())["stature"]
    limbs = lengths_m(body.landmarks_m[None]) / lengths_m(read_truth(recording / TRUTH)) - 1
    return stature_of(unclothed(body)) / true_m - 1, limbs


def root_mm(recording: Path, name: str, options: dict[str, str]) -> float:
    """Error of a fit, made if it is not there."""
    folder = OUT / name / recording.name
    if not (folder / "summary.json").exists():
        output = Output(folder, pictures=False, overwrite=True)
        fit(Recording.open(recording), output, Settings(options=options))
    return evaluate(folder, recording / TRUTH).root_mm


def main() -> None:
    """Prints the table."""
    words = argparse.ArgumentParser(description=__doc__)
    words.add_argument("--seeds", nargs=2, type=int, metavar=("FIRST", "LAST"), default=(101, 120))
    first, last = words.parse_args().seeds
    print("| seed | stature, % | limbs, mean % | root_mm without | with | change, % |")
    print("|---|---|---|---|---|---|")
    rows = []
    seeds = range(first, last + 1)
    recordings = drawn(OUT / "earlier", seeds, 1)
    laters = later_recordings(seeds, recordings)
    for seed, earlier, later in zip(seeds, recordings, laters, strict=True):
        path = body_of(seed, earlier)
        stature, limbs = size_errors(read_body(path), earlier)
        without, given = root_mm(later, "without", {}), root_mm(later, "with", {"body": str(path)})
        row = 100 * abs(stature), 100 * np.abs(limbs).mean(), without, given
        rows.append([*row, 100 * (given / without - 1)])
        print(f"| {seed} | {' | '.join(f'{value:.1f}' for value in rows[-1])} |", flush=True)
    for name, values in (("mean", np.mean(rows, axis=0)), ("median", np.median(rows, axis=0))):
        print(f"| {name} | {' | '.join(f'{value:.1f}' for value in values)} |")


if __name__ == "__main__":
    main()
