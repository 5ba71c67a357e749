"""Speed of an older checkout against this one: python -m benchmarks.between OLD [PART ...]

OLD is a folder with another version of the project, for example made by `git worktree add ../old
COMMIT`. Every case of `python -m benchmarks` that both have is run in both, in turn, four times;
the shortest time counts. One line per case: old, new, and their ratio, above 1 where this one is
faster.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

ROUNDS = 4
LINE = re.compile(r"^(\S.*?)\s{2,}([\d.]+) ms", re.MULTILINE)


def main(arguments: list[str]) -> int:
    """Print the comparison."""
    if not arguments or not (Path(arguments[0]) / "benchmarks").is_dir():
        print("give the folder of an older checkout: one that holds benchmarks/", file=sys.stderr)
        return 2
    trees = Path(arguments[0]).resolve(), Path(__file__).resolve().parents[1]
    best: dict[str, list[float]] = {}
    for _ in range(ROUNDS):
        for side, tree in enumerate(trees):
            for name, milliseconds in times(tree, arguments[1:]):
                row = best.setdefault(name, [float("inf")] * 2)
                row[side] = min(row[side], milliseconds)
    print(f"{'case':<34}{'old, ms':>12}{'new, ms':>12}{'old / new':>12}")
    for name, (old, new) in best.items():
        if old + new < float("inf"):
            print(f"{name:<34}{old:>12.3f}{new:>12.3f}{old / new:>12.2f}")
    return 0


def times(tree: Path, parts: list[str]) -> list[tuple[str, float]]:
    """Names and times, ms, of the cases of a checkout."""
    process = subprocess.run(
        [sys.executable, "-m", "benchmarks", *parts],
        cwd=tree,
        env={**os.environ, "PYTHONPATH": str(tree)},
        capture_output=True,
        text=True,
        check=True,
    )
    return [(name.strip(), float(ms)) for name, ms in LINE.findall(process.stdout)]


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
