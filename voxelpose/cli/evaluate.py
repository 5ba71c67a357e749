"""voxelpose evaluate."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, ClassVar

from tyro.conf import Positional, arg


@dataclass(frozen=True)
class Evaluate:
    """The arguments of `voxelpose evaluate`."""

    help: ClassVar[str] = """Scores a result against known joint positions.

TRUTH is a truth.json: {"unit": "m", "joints": {"pelvis": [[x, y, z], ...], ...}},
the 15 joints of joints.csv in world coordinates, one position per frame.

  voxelpose evaluate walk_fit walk/truth.json
  voxelpose evaluate walk_fit walk/truth.json --json
"""

    result: Annotated[Positional[Path], arg(metavar="OUT")]
    """Folder of a fit, or a joints.csv."""
    truth: Annotated[Positional[Path], arg(metavar="TRUTH")]
    """File with the true positions."""
    offset: Annotated[int, arg(metavar="FRAMES")] = 0
    """Added to the result's frame numbers before they are compared."""
    json: bool = False
    """Print JSON instead of a table."""

    def run(self) -> int:
        """Scores."""
        from silhouette_core.body.joints import LANDMARK_NAMES
        from voxelpose.evaluation import read_joints, read_truth, score_motion
        from voxelpose.results import as_json

        truth = read_truth(self.truth)
        path = self.result / "joints.csv" if self.result.is_dir() else self.result
        score = score_motion(truth, read_joints(path, len(truth), self.offset))
        if self.json:
            joints = dict(zip(LANDMARK_NAMES, score.joint_root_mm, strict=False))
            print(as_json({**asdict(score), "joint_root_mm": joints}), end="")
            return 0
        from voxelpose.cli.closing import print_score

        print_score(score)
        return 0
