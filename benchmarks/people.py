"""Several people: `python -m benchmarks.people N CAMERAS SEED ... [--careless]`

N people of ../shared/render before CAMERAS cameras, a recording for each seed (level 1; 2 if
careless), fitted with nothing told; before one camera, tracked, with their number told. Prints a
row each: how many are found, whose frames are lost, the mean error of the joints relative to the
pelvis of everybody and of the worst, mm, and the verdicts; then, of several cameras, what is said
of the joints' errors beside what was. Recordings and results stay in out/people; results are made
again.
"""

import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.drawn import SHARED, drawn
from calib.errors import InputError
from voxelpose.evaluation import evaluate_people
from voxelpose.fitting import Output, fit_people
from voxelpose.multiview.quality.quality import NEAR_MM
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import TRUTH, read_people_truth
from voxelpose.reliability import verdict_of
from voxelpose.results import open_people

_SURE = 0.9
OUT = Path(__file__).resolve().parents[1] / "out" / "people"


def said_and_was(recording: Path, out: Path) -> NDArray[np.float64]:
    """Of every joint (n, 3): probability said of 30 mm, median error said and error, mm."""
    truths, rows = read_people_truth(recording / TRUTH), []
    for result in open_people(out):
        motion, quality = result.motion, result.motion.quality
        off_m = [motion.landmarks() - true[motion.frames] for true in truths]
        error_mm = 1000 * min(
            (np.linalg.norm(off, axis=2) for off in off_m), key=lambda one: float(np.median(one))
        )
        said = quality["landmark_confidence"], quality["joint_error_mm"]
        rows.append(np.stack([*said, error_mm], axis=2).reshape(-1, 3))
    return np.concatenate(rows)


def main(words: list[str]) -> int:
    """Draws, fits and scores."""
    if len(words) < 3 or not SHARED.is_dir():
        print(__doc__, file=sys.stderr)
        return 2
    careless = "--careless" in words
    people, cameras, *seeds = (int(word) for word in words if word != "--careless")
    folder = OUT / f"{people}_before_{cameras}{'_careless' * careless}"
    options = ("--people", str(people), "--cameras", str(cameras))
    joints: list[NDArray[np.float64]] = []
    print("seed  found   lost  root_mm  worst_mm     s  verdicts")
    for recording in drawn(folder, seeds, 1 + careless, options=options):
        begun = time.perf_counter()
        out = OUT / "results" / folder.name / recording.name
        how = ("monocular", None, people) if cameras == 1 else ("multiview", None, None)
        output = Output(out, True, pictures=False)
        try:
            results = fit_people(Recording.open(recording), output, None, *how)
        except InputError as error:
            print(f"{recording.name:<6}{error}", flush=True)
            continue
        spent_s = time.perf_counter() - begun
        verdicts = " ".join(verdict_of(result.summary).level for result in results)
        row = f"{recording.name:<6}{len(results):>5}"
        if len(results) in range(2, people + 1):
            scores = list(evaluate_people(out).values())
            root_mm = np.array([score.root_mm for score in scores])
            lost = np.mean([score.lost for score in scores])
            row += f"{lost:>7.2f}{np.nanmean(root_mm):>9.1f}{np.nanmax(root_mm):>10.1f}"
            if cameras > 1:
                joints.append(said_and_was(recording, out))
        else:
            row += f"{'–':>7}{'–':>9}{'–':>10}"
        print(f"{row}{spent_s:>6.0f}  {verdicts}", flush=True)
    if joints:
        near, median_mm, error_mm = np.concatenate(joints).T
        sure = error_mm[near >= _SURE] < NEAR_MM
        print(
            f"within {NEAR_MM} mm: said {near.mean():.3f}, are {(error_mm < NEAR_MM).mean():.3f};"
            f" of those with {_SURE} or more {sure.mean():.3f}; within the median said"
            f" {(error_mm < median_mm).mean():.3f}"
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
