"""Speed: `python -m benchmarks [PART OF A NAME ...]`, or `make bench`.

One line per case: name, our time, the reference's time, and their ratio. Both ran in turn in this
process, after a warm-up; the shortest of several runs counts. Damaged files: `benchmarks.fuzz`.
"""

import platform
import sys

from benchmarks import carving, cases, causal, filter, fitting, library, scoring, silhouettes  # noqa: F401
from silhouette_core.jit import set_threads


def main(parts: list[str]) -> int:
    """Runs the cases whose names hold one of `parts`, or all."""
    chosen = [name for name in cases.names() if not parts or any(part in name for part in parts)]
    if not chosen:
        print(f"no such case; there are: {', '.join(cases.names())}", file=sys.stderr)
        return 2
    print(
        f"{platform.machine()}, Python {platform.python_version()}, {set_threads()} threads",
        flush=True,
    )
    for name in chosen:
        print(cases.run(name), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
