"""Learns the proposal that comes with the program, from recorded motion and the program's own.

Usage: `python -m tools.proposal [--motion FOLDER] [--leave-out CLIP ...] [--out FOLDER]`, some 40
minutes on two cores. Writes proposal.safetensors and proposal.toml, which states how it was made.
The same motion gives the same file, for any number of threads. Interrupted, it goes on where it
was.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np
import tomlkit

from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.monocular import tuning
from silhouette_core.monocular.making.checkpoint import Checkpoint
from silhouette_core.monocular.making.from_motion import read_clips
from silhouette_core.monocular.making.proposal_learning import LearningSettings, learn_proposal
from silhouette_core.monocular.proposal import shipped
from silhouette_core.motion.keyposes import keypose_motions
from silhouette_core.motion.keyposes.notation import movements
from silhouette_core.motion.motion import Motion
from voxelpose.cli.progress import Progress

ROOT = Path(__file__).resolve().parents[1]
SHARED = Path(os.environ.get("VOXELPOSE_SHARED", ROOT.parent / "shared"))
SIZES = BodySizes(1.75)  # random bodies around it are learned from
SETTINGS = LearningSettings()
NUMBERS = (
    *(tuning.TRAINING, tuning.MIXTURE, tuning.VARIED_MOTION, tuning.VIRTUAL_PEOPLE),
    *(tuning.VIRTUAL_CAMERAS, tuning.VIRTUAL_DEFECTS, tuning.VIRTUAL_SHADING),
)


def recipe() -> str:
    """Digest of all but the recorded motion that decides what is learned."""
    facts = repr((SIZES, SETTINGS, NUMBERS, sorted(movements().items())))
    return hashlib.sha256(facts.encode()).hexdigest()


def digest(motions: Mapping[str, Motion]) -> str:
    """Digest of motions."""
    found = hashlib.sha256()
    for name, motion in sorted(motions.items()):
        found.update(name.encode())
        for array in (motion.root_m, motion.root_quaternion, motion.angles_rad, motion.time_s):
            found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()


def main() -> None:
    """Learns and writes it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motion", type=Path, default=SHARED / "data" / "mocap")
    parser.add_argument("--leave-out", nargs="*", default=[], metavar="CLIP")
    parser.add_argument("--out", type=Path, default=shipped.FILE.parent)
    given = parser.parse_args()
    model = BodyModel.from_sizes(SIZES)
    unfinished = ROOT / "out" / "proposal"
    with Progress() as progress:
        clips = read_clips([given.motion], model, leave_out=given.leave_out, reporter=progress)
        own, data = keypose_motions(model), digest(clips)
        kept = Checkpoint(unfinished, hashlib.sha256((recipe() + data).encode()).hexdigest())
        motions = [*clips.values(), *own.values()]
        proposal = learn_proposal(motions, model, SETTINGS, progress, kept.step)
    given.out.mkdir(parents=True, exist_ok=True)
    shipped.write_proposal(proposal, given.out / shipped.FILE.name)
    card = {
        "what": "proposal of poses of one person from the silhouettes of one camera",
        "made_by": "python -m tools.proposal, by this program alone, from rendered silhouettes",
        "motion": "CMU Graphics Lab Motion Capture Database, mocap.cs.cmu.edu, free for every use;"
        " it is learned from and not contained. And this program's own key poses.",
        "clips": sorted(clips),
        "left_out": given.leave_out,
        "own_motions": sorted(own),
        "motion_sha256": data,
        "seed": SETTINGS.seed,
        "date": datetime.now(UTC).date().isoformat(),
        "version": version("voxelpose"),
        "recipe_sha256": recipe(),
        "settings": json.dumps(asdict(SETTINGS)),
        "licence": "as the program's",
    }
    (given.out / shipped.CARD.name).write_text(tomlkit.dumps(card), encoding="utf-8")
    Checkpoint.remove(unfinished)


if __name__ == "__main__":
    main()
