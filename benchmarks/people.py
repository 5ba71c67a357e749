"""Several people: `python -m benchmarks.people N CAMERAS SEED ... [--careless]`

N people of ../shared/render before CAMERAS cameras, a recording for each seed (level 1; 2 if
careless), fitted with nothing told; before one camera, tracked, with their number told. Prints a
row each: how many are found, whose frames are lost, the mean error of the joints relative to the
pelvis of everybody and of the worst, mm, and the verdicts. Recordings and results stay in
out/people; results are made again.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

from benchmarks.drawn import SHARED, drawn
from calib.errors import InputError
from voxelpose.evaluation import evaluate_people
from voxelpose.fitting import Output, fit_people
from voxelpose.recording.folder import Recording
from voxelpose.reliability import verdict_of

OUT = Path(__file__).resolve().parents[1] / "out" / "people"


def main(words: list[str]) -> int:
    """Draws, fits and scores."""
    if len(words) < 3 or not SHARED.is_dir():
        print(__doc__, file=sys.stderr)
        return 2
    careless = "--careless" in words
    people, cameras, *seeds = (int(word) for word in words if word != "--careless")
    folder = OUT / f"{people}_before_{cameras}{'_careless' * careless}"
    options = ("--people", str(people), "--cameras", str(cameras))
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
        else:
            row += f"{'–':>7}{'–':>9}{'–':>10}"
        print(f"{row}{spent_s:>6.0f}  {verdicts}", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
