"""Summary of a library as text, and a contact sheet of its tree's nodes."""

from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from calib.checks import ByteArray
from calib.storage.atomic import write_whole
from silhouette_core.monocular.tree.pose_library import PoseLibrary, describe_body

_ROWS, _ACROSS = 9, 10
_CROP_PX = (190, 208)  # width and height of the middle of the window; most silhouettes fit
_GAP = 4


def summary(library: PoseLibrary, path: Path) -> str:
    """A few lines on what a library holds."""
    pitches = sorted(set(np.degrees(library.views[:, 1]).round(3).tolist()))
    mirrored = int(library.bases.mirrored.sum())
    nodes = " / ".join(f"{len(level):,}" for level in library.levels)
    thresholds = " / ".join(f"{level.threshold:.4f}" for level in library.levels)
    clips = np.bincount(library.bases.source[:, 0], minlength=len(library.bases.clips))
    occluded, proposal = library.occluded.mean(axis=0), library.proposal
    lines = [
        f"{path}: {path.stat().st_size / 1e6:,.1f} MB",
        f"body      {describe_body(library.model)}",
        (
            f"poses     {len(library):,} = {len(library.bases.angles):,} ({mirrored:,} of them"
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
            f"clips     {int((clips > 0).sum())} of {len(library.bases.clips)} gave poses:"
            f" {', '.join(library.bases.clips)}"
        ),
    ]
    return "\n".join(lines)


def write_sheet(library: PoseLibrary, path: Path) -> None:
    """Writes an image of nodes of the first level.

    Each row shows a node's representative, then samples from its leaves, coloured by part. The rows
    are taken from the list of nodes ordered by number of samples, largest first. Raises InputError
    where the file cannot be written.
    """
    members = _samples_of_first_level(library)
    order = np.argsort([-len(samples) for samples in members], kind="stable")
    # More rows for the large nodes: the small ones hold a sample or two.
    chosen = np.unique((np.linspace(0, 1, _ROWS) ** 3 * (len(order) - 1)).astype(int))
    rows = [_row(library, int(node), members[node]) for node in order[chosen]]
    sheet = np.concatenate(
        [
            rows[0],
            *(np.pad(row, ((_GAP, 0), (0, 0), (0, 0)), constant_values=60) for row in rows[1:]),
        ]
    )
    coded, buffer = cv2.imencode(".png", sheet)
    write_whole(path, buffer.tobytes() if coded else b"")


def _samples_of_first_level(library: PoseLibrary) -> list[NDArray[np.int32]]:
    """Samples of each node of the first level."""
    bounds = np.arange(len(library.levels[0]) + 1)
    for offsets in library.child_offsets:
        bounds = offsets[bounds]
    return [np.asarray(library.leaf_samples[first:last]) for first, last in pairwise(bounds)]


def _row(library: PoseLibrary, node: int, samples: NDArray[np.int32]) -> ByteArray:
    """Image of one node."""
    drawn = samples[
        np.unique(np.linspace(0, len(samples) - 1, min(_ACROSS - 1, len(samples))).astype(int))
    ]
    windows = library.render(
        np.concatenate([[library.levels[0].representative[node]], drawn])
    ).windows
    colours = len(library.model.names) + 1
    hues = (np.arange(colours) * 53 % 180).astype(np.uint8)
    palette = cv2.cvtColor(
        np.stack([hues, np.full_like(hues, 120), np.full_like(hues, 235)], -1)[None],
        cv2.COLOR_HSV2BGR,
    )[0]
    palette[0] = (30, 25, 22)
    left, top = (np.array(windows.shape[:0:-1]) - _CROP_PX) // 2
    wide, high = _CROP_PX
    tiles = [
        np.pad(
            cv2.resize(part, None, fx=0.6, fy=0.6, interpolation=cv2.INTER_AREA),
            ((0, 0), (0, _GAP), (0, 0)),
        )
        for part in palette[windows[:, top : top + high, left : left + wide]]
    ]
    tiles[0][:, -_GAP:] = 255
    label, light = f"node {node}: {len(samples)}", (235, 235, 235)
    cv2.putText(tiles[0], label, (3, 12), cv2.FONT_HERSHEY_SIMPLEX, 0.38, light, 1, cv2.LINE_AA)
    tiles += [np.full_like(tiles[0], 25)] * (_ACROSS - len(tiles))
    return np.concatenate(tiles, axis=1)
