"""Compare OpenSim's inverse kinematics on our points: python -m benchmarks.opensim_ik RESULT IK.mot

RESULT is a fit of balancing4, IK.mot what OpenSim made of `voxelpose export RESULT --to opensim`
(docs/exports.md). A line per angle, in degrees: mean of the difference and RMS of what is left
without it, of IK.mot from our own angles, and of both from `reference_opensim.mot`. The recording
is in ../shared/data, or in $VOXELPOSE_SHARED/data.
"""

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.angles import DATA, LUMBAR, OURS, lumbar_sum, read_mot
from voxelpose.export.opensim import mot_coordinates
from voxelpose.results import Result

_LOCKED = "subtalar"  # in the model


def main(words: list[str]) -> int:
    """Print the comparison."""
    if len(words) != 2 or not DATA.is_dir():
        print(f"{__doc__}\n{DATA} is needed", file=sys.stderr)
        return 2
    motion = Result.open(words[0]).motion
    solved, ours = read_mot(Path(words[1]), np.arange(len(motion))), mot_coordinates(motion)
    theirs = read_mot(DATA / "reference_opensim.mot", motion.frames)
    theirs |= {name: lumbar_sum(theirs, name) for name in LUMBAR}
    print("| angle | IK − ours | ours − reference | IK − reference |\n|---|---|---|---|")
    for name in [*OURS, *LUMBAR]:
        if not name.startswith(_LOCKED):
            pairs = (solved, ours), (ours, theirs), (solved, theirs)
            cells = [difference(one[name], other[name]) for one, other in pairs]
            print(f"| {name} | {' | '.join(cells)} |")
    return 0


def difference(values: NDArray, others: NDArray) -> str:
    """Mean of a difference of angles, and RMS without it, degrees."""
    off = (values - others + 180) % 360 - 180
    return f"{off.mean():.1f}, {off.std():.1f}"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
