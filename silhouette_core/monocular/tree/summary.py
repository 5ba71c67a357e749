"""Summary of a library as text."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from silhouette_core.monocular.tree.pose_library import PoseLibrary, describe_body


def summary(library: PoseLibrary, path: Path) -> str:
    """A few lines on what a library holds."""
    pitches = sorted(set(np.degrees(library.views[:, 1]).round(3).tolist()))
    mirrored = int(library.base_mirrored.sum())
    nodes = " / ".join(f"{len(level):,}" for level in library.levels)
    thresholds = " / ".join(f"{level.threshold:.4f}" for level in library.levels)
    clips = np.bincount(library.base_source[:, 0], minlength=len(library.clips))
    occluded, proposal = library.occluded.mean(axis=0), library.proposal
    lines = [
        f"{path}: {path.stat().st_size / 1e6:,.1f} MB",
        f"body      {describe_body(library.model)}",
        (
            f"poses     {len(library):,} = {len(library.base_angles):,} ({mirrored:,} of them"
            f" mirror images) x {len(library.views)} views"
        ),
        (
            f"views     every {library.settings.yaw_step_deg:g} degrees around, camera"
            f" {', '.join(f'{p:g}' for p in pitches)} degrees down"
        ),
        f"tree      {nodes} nodes, thresholds {thresholds}",
        (
            f"leaves    {len(library) / len(library.levels[-1]):.2f} poses each, at most"
            f" {int(np.diff(library.leaf_offsets).max()):,}"
        ),
        f"window    {int(library.cut.sum()):,} poses stick out of it",
        (
            f"hidden    {occluded.mean():.0%} of all parts; most often"
            f" {library.model.names[int(occluded.argmax())]}, {occluded.max():.0%}"
        ),
        "proposal  none" if proposal is None else f"proposal  {proposal.network.modes} modes",
        (
            f"clips     {int((clips > 0).sum())} of {len(library.clips)} gave poses:"
            f" {', '.join(library.clips)}"
        ),
    ]
    return "\n".join(lines)
