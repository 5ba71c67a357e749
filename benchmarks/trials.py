"""Random recordings, many at a time: python -m benchmarks.trials [GROUP ...] [--seeds FIRST LAST]

Draws the recordings of each GROUP with ../shared/render (or that of $VOXELPOSE_SHARED), runs
`voxelpose batch` over them, and writes their tables into out/trials/tables.md: one row per
group, the errors of the joints and of the kinds of motion, and how often what was said of itself
was true.
"careful" are seeds 201 to 240 of level 1, "careless" 301 to 340 of level 2, "made" the recordings
that datasets/made/recipes.toml describes, which need nothing from elsewhere. Left out: all groups.
What was drawn and estimated before is kept in out/trials; delete a result to make it again.
"""

import argparse
import json
import os
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.drawn import SHARED, drawn
from benchmarks.expected_error import reliability_rows, sample
from benchmarks.recipes import read_recipes
from silhouette_core.body.joints import LANDMARK_NAMES
from voxelpose.batch.batch_tables import write_tables
from voxelpose.batch.jobs import jobs_of
from voxelpose.batch.run import BatchSettings, Outcome, run_batch
from voxelpose.multiview.quality.quality import NEAR_MM
from voxelpose.reliability import verdict_of

ROOT = Path(__file__).resolve().parents[1]
OUT = ROOT / "out" / "trials"
RECIPES = ROOT / "datasets" / "made" / "recipes.toml"
GROUPS = {"careful": (1, 201, 240), "careless": (2, 301, 340)}
WRONG_MM = 80.0
SIDES = re.compile(r"^(left|right)_")
_JOINTS = list(dict.fromkeys(SIDES.sub("", name) for name in LANDMARK_NAMES if name != "pelvis"))


@dataclass(frozen=True)
class Trial:
    """A recording of a group and what came of it.

    Attributes:
        outcome: of the batch.
        motion: kind of its motion.
    """

    outcome: Outcome
    motion: str

    @property
    def root_mm(self) -> float:
        """Mean root-relative error; infinite where there is no result, or hardly any pose."""
        score = self.outcome.score
        return score["root_mm"] if score and score["lost"] < 0.5 else float("inf")

    @property
    def doubtful(self) -> bool:
        """Whether the program says so, or refuses."""
        outcome = self.outcome
        return outcome.status == "failed" or verdict_of(outcome.summary).level != "reliable"


def recordings(group: str, seeds: Sequence[int] | None) -> list[Path]:
    """The group's recordings, drawn or rendered if they are not there."""
    folder = OUT / "recordings" / group
    if group == "made":
        several = [item for item in read_recipes(RECIPES).items() if len(item[1].cameras) > 1]
        return [recipe.render(folder / name) for name, recipe in several]
    level, first, last = GROUPS[group]
    return drawn(folder, seeds or range(first, last + 1), level)


def run(group: str, seeds: Sequence[int] | None) -> list[Trial]:
    """Estimates the group's recordings; what was done before is kept."""
    folders = recordings(group, seeds)
    jobs = jobs_of(folders, "fit", {})
    processes = min(os.cpu_count() or 1, len(jobs))

    def tell(outcome: Outcome, count: int | None) -> None:
        error = outcome.score.get("root_mm", float("nan"))
        words = outcome.message or verdict_of(outcome.summary).level
        print(f"[{count}/{len(jobs)}] {outcome.job.name}: {error:.1f} mm, {words}", flush=True)

    out = OUT / group
    settings = BatchSettings(out, processes, pictures=False, report=False)
    outcomes = run_batch(jobs, settings, tell)
    write_tables(outcomes, out)
    return [
        Trial(outcome, _motion_of(folder))
        for outcome, folder in zip(outcomes, folders, strict=True)
    ]


def _motion_of(folder: Path) -> str:
    """Kind of a recording's motion: its clip's name without number, or its own."""
    scene = folder / "scene.json"
    if not scene.is_file():
        return folder.name
    clip = json.loads(scene.read_text())["clip"]
    return re.sub(r"^(train|test)_|_\d+$", "", clip)


def table(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in Markdown."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def accuracy_table(groups: dict[str, list[Trial]]) -> str:
    """One row per group; wrong is what is farther off than WRONG_MM, or hardly posed."""
    columns = ("recordings", "number", "median root_mm", "95 %", "worst", "right")
    rows = []
    for name, trials in groups.items():
        errors = np.array([trial.root_mm for trial in trials])
        doubtful, wrong = np.array([trial.doubtful for trial in trials]), errors > WRONG_MM
        quantiles = np.quantile(errors, [0.5, 0.95, 1.0], method="nearest")
        cells = [f"{value:.1f}" if np.isfinite(value) else "–" for value in quantiles]
        doubts = f"{(wrong & doubtful).sum()} of {wrong.sum()}"
        false_doubts = f"{(~wrong & doubtful).sum()} of {(~wrong).sum()}"
        rows.append([name, len(trials), *cells, (~wrong).sum(), doubts, false_doubts])
    return table([*columns, "wrong ones called doubtful", "right ones called doubtful"], rows)


def joint_table(groups: dict[str, list[Trial]]) -> str:
    """Errors of the joints, left and right together, in the recordings that are right: of every
    group the median of the recordings, and what one in ten exceeds.
    """
    rows = []
    for group, trials in groups.items():
        errors = _joint_errors([trial for trial in trials if trial.root_mm <= WRONG_MM])
        for name, share in (("median", 50), ("90 %", 90)):
            cells = np.percentile(errors, share, axis=0) if len(errors) else []
            rows.append([group, name, *(f"{cell:.0f}" for cell in cells)])
    return table(["recordings", "", *_JOINTS], rows)


def motion_table(groups: dict[str, list[Trial]]) -> str:
    """Errors of the kinds of motion, all groups together: median and worst recording, and of those
    that are right the median error of every joint.
    """
    kinds: dict[str, list[Trial]] = defaultdict(list)
    for trials in groups.values():
        for trial in trials:
            kinds[trial.motion].append(trial)
    rows = []
    for kind, trials in kinds.items():
        errors = [trial.root_mm for trial in trials]
        median = float(np.quantile(errors, 0.5, method="lower"))
        worst = f"{max(errors):.1f}" if np.isfinite(max(errors)) else "–"
        joints = _joint_errors([trial for trial in trials if trial.root_mm <= WRONG_MM])
        cells = [f"{cell:.0f}" for cell in np.median(joints, axis=0)] if len(joints) else []
        rows.append((median, [kind, len(trials), f"{median:.1f}", worst, *cells]))
    rows = [cells for _, cells in sorted(rows, key=lambda row: row[0])]
    return table(["motion", "recordings", "median root_mm", "worst", *_JOINTS], rows)


def _joint_errors(trials: Sequence[Trial]) -> NDArray[np.float64]:
    """Errors (n, J), mm relative to the pelvis, of the joints, means of left and right."""
    errors = np.array([trial.outcome.score["joint_root_mm"] for trial in trials])
    if not len(errors):
        return np.zeros((0, len(_JOINTS)))
    own = [[SIDES.sub("", other) == name for other in LANDMARK_NAMES] for name in _JOINTS]
    return np.stack([errors[:, sides].mean(axis=1) for sides in own], axis=1)


def reliability_table(groups: dict[str, list[Trial]]) -> str:
    """How many joints were near the truth, by the probability that was said."""
    sections = []
    for name, trials in groups.items():
        done = [trial.outcome.job for trial in trials if trial.outcome.status != "failed"]
        found = [sample(Path(job.recording), OUT / name / job.name) for job in done]
        said = np.concatenate([one["said"].ravel() for one in found])
        was = np.concatenate([one["error"].ravel() for one in found]) < NEAR_MM
        rows = [[name, *row] for row in reliability_rows(said, was)]
        sections += rows
    return table(["recordings", "said", "of", "mean of what was said", "was"], sections)


def main() -> None:
    """Runs the trials and writes their tables."""
    words = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    words.add_argument("groups", nargs="*", choices=[*GROUPS, "made", []], metavar="GROUP")
    words.add_argument("--seeds", nargs=2, type=int, metavar=("FIRST", "LAST"))
    given = words.parse_args()
    seeds = range(given.seeds[0], given.seeds[1] + 1) if given.seeds else None
    names = given.groups or ["made", *(GROUPS if SHARED.is_dir() else [])]
    groups = {name: run(name, seeds) for name in names}
    tables = [accuracy_table(groups), joint_table(groups), motion_table(groups)]
    tables.append(reliability_table(groups))
    text = "\n\n".join(tables)
    print(f"\n{text}")
    if not given.groups and seeds is None:
        made = f"`make trials`, {datetime.now(UTC):%Y-%m-%d}."
        (OUT / "tables.md").write_text(f"{made}\n\n{text}\n", encoding="utf-8")


if __name__ == "__main__":
    main()
