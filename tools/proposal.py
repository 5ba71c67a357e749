"""Learns the proposal that comes with the program, from recorded motion.

Usage: `python -m tools.proposal [--begun FILE] [--motion FOLDER] [--leave-out CLIP ...] [--out
FOLDER]`, an hour on two cores, or with --begun, a proposal that goes on learning but for its
encoders, half of it. Writes proposal.safetensors and proposal.toml, which states how it was made.
The same motion gives the same file, for any number of threads. Interrupted, it goes on where it
was. A quarter of the motion is left out: results are reported on it.
"""

import argparse
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import tomlkit

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.monocular import tuning
from silhouette_core.monocular.making.from_motion import learned_from, motion_digest, read_clips
from silhouette_core.monocular.making.learning_settings import LearningSettings, TrainingSettings
from silhouette_core.monocular.making.virtual_defects import seen_errors
from silhouette_core.monocular.proposal import shipped
from silhouette_core.monocular.tree.build import Checkpoint
from silhouette_core.motion.motion import Motion
from voxelpose.cli.terminal import Progress

ROOT = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("VOXELPOSE_SHARED", ROOT.parent / "shared"))
SIZES = BodySizes(1.75)  # random bodies around it are learned from
SETTINGS = LearningSettings()
FURTHER = replace(
    SETTINGS, frames=220_000, seed=1, training=TrainingSettings(steps=6_000, kept_rate=0.2)
)
HELD_OUT = tuple(
    """
    001_08 002_03 002_08 005_01 005_05 005_09
    005_13 005_18 006_02 006_06 006_11 007_01
    007_05 007_10 test_jumping_1 test_walking_10 train_basketball_2 train_directing_traffic_1
    train_jumping_3 train_running_2 train_soccer_1 train_soccer_5 train_walking_20 train_walking_35
    train_walking_5
    """.split()
)
NUMBERS = (
    *(tuning.TRAINING, tuning.MIXTURE, tuning.VARIED_MOTION, tuning.VIRTUAL_PEOPLE),
    *(tuning.VIRTUAL_CAMERAS, tuning.VIRTUAL_DEFECTS, tuning.VIRTUAL_SHADING),
)


def recipe() -> str:
    """Digest of all but the recorded motion that decides what is learned."""
    facts = repr((SIZES, SETTINGS, FURTHER, NUMBERS, tuple(seen_errors())))
    return hashlib.sha256(facts.encode()).hexdigest()


def write_card(
    clips: Mapping[str, Motion], left_out: Sequence[str], begun: str, date: str, path: Path
) -> None:
    """Writes what states how a proposal was made."""
    settings = FURTHER if begun else SETTINGS
    card = {
        "what": "proposal of poses of one person from the silhouettes of one camera, and joints",
        "made_by": f"python -m tools.proposal{' --begun FILE' if begun else ''}: by this program"
        " alone, from rendered silhouettes",
        "motion": "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu, free for every use;"
        " it is learned from and not contained",
        "clips": sorted(clips),
        "left_out": sorted(left_out),
        "motion_sha256": motion_digest(clips),
        "begun_sha256": begun,
        "seed": settings.seed,
        "date": date,
        "version": version("voxelpose"),
        "recipe_sha256": recipe(),
        "settings": json.dumps(asdict(settings)),
        "licence": "as the program's",
    }
    path.write_text(tomlkit.dumps(card), encoding="utf-8")


def main() -> None:
    """Learns and writes it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motion", type=Path, default=SHARED / "data" / "mocap")
    parser.add_argument("--begun", type=Path, help="goes on learning, but for its encoders")
    parser.add_argument("--leave-out", nargs="*", default=list(HELD_OUT), metavar="CLIP")
    parser.add_argument("--out", type=Path, default=shipped.FILE.parent)
    given = parser.parse_args()
    model = BodyModel.from_sizes(SIZES)
    unfinished = ROOT / "out" / "proposal"
    with Progress() as progress:
        clips = read_clips([given.motion], model, leave_out=given.leave_out, reporter=progress)
        begun, settings, digest = None, SETTINGS, ""
        if given.begun is not None:
            begun, settings = shipped.read_proposal(given.begun), FURTHER
            digest = hashlib.sha256(given.begun.read_bytes()).hexdigest()
        proposal = learned_from(clips, model, settings, unfinished, progress, begun)
    given.out.mkdir(parents=True, exist_ok=True)
    shipped.write_proposal(proposal, given.out / shipped.FILE.name)
    today = datetime.now(UTC).date().isoformat()
    card = given.out / shipped.CARD.name
    write_card(clips, given.leave_out, digest, today, card)
    Checkpoint.remove(unfinished)


if __name__ == "__main__":
    main()
