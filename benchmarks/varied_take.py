"""A long take of one person, made of pieces of ../shared's recorded motion.

Pieces of several clips, joined by short blends, are filmed once as ../shared/render films with
care. The take goes through them forward and backward in turn, until it is long enough; brightness
drifts and noise is drawn anew, so that no two pictures are the same.
"""

import json
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from benchmarks.drawn import SHARED

FPS = 15
_PIECES, _PIECE_S, _CANDIDATES = 12, 8.0, 8
_BLEND_S, _BLEND_M_S = 0.7, 1.2  # shortest blend; speed of the pelvis where it has to move
_DRIFT, _DRIFT_S, _NOISE = 0.03, 240.0, 1.5  # relative brightness, its period, grey levels


def varied_take(folder: Path, seed: int, minutes: float) -> Path:
    """A recording of four cameras, 15 frames a second; made if it is not there.

    Args:
        folder: of the recording.
        seed: of person, room, cameras and motion.
        minutes: its length.
    """
    if not (folder / "truth.json").is_file():
        once = folder.with_name(f"{folder.name}_once")
        if not (once / "truth.json").is_file():
            _film(once, seed)
        _go_through(once, folder, round(minutes * 60 * FPS), np.random.default_rng(seed))
    return folder


def _film(once: Path, seed: int) -> None:
    """Films the joined pieces with the shared renderer, which draws all the rest."""
    sys.path.insert(0, str(SHARED / "render"))
    import draw as shared_draw  # type: ignore[import-not-found]

    piece, names = shared_draw.piece, []

    def joined(rng: Any, subject: Any, motion: Any, *unused: object) -> tuple[Any, ...]:
        """Stands in for the renderer's choice of one piece."""
        rotations, roots = _piece(piece, rng, subject, motion, names)
        for _ in range(_PIECES - 1):
            drawn: list[Any] = []
            for _ in range(_CANDIDATES):
                own: list[str] = []
                found = _piece(piece, rng, subject, motion, own)
                turned = _face_alike(found, rotations[-1], subject)
                drawn.append((np.linalg.norm(turned[1][0] - roots[-1]), own[0], turned))
            distance, name, (to_rotations, to_roots) = min(drawn, key=lambda one: one[0])
            names.append(name)
            count = round(max(_BLEND_S, distance / _BLEND_M_S) * FPS)
            between = _blend(rotations[-1], to_rotations[0], roots[-1], to_roots[0], count)
            rotations = np.concatenate([rotations, between[0], to_rotations])
            roots = np.concatenate([roots, between[1], to_roots])
        return rotations, roots, "+".join(names), 0, False

    shared_draw.piece = joined
    try:
        shared_draw.draw(once.parent, seed, 1, 4, 0, FPS)
    finally:
        shared_draw.piece = piece
    (once.parent / str(seed)).rename(once)


def _piece(piece: Any, rng: Any, subject: Any, motion: Any, names: list[str]) -> Any:
    """A piece of a drawn clip that is long enough: rotations, roots; its clip joins the names."""
    while True:
        try:
            found = piece(rng, subject, motion, round(_PIECE_S * FPS), FPS)
        except SystemExit:
            continue
        names.append(found[2])
        return found[0], found[1]


def _face_alike(motion: Any, last: NDArray[Any], subject: Any) -> tuple[NDArray[Any], NDArray[Any]]:
    """Rotations and roots turned about z so that they begin with the heading of a pose."""
    rotations, roots = motion
    hips = subject.names.index("Hips")
    of = [np.arctan2(pose[hips][1, 0], pose[hips][0, 0]) for pose in (last, rotations[0])]
    turn = Rotation.from_euler("z", of[0] - of[1]).as_matrix()
    return turn @ rotations, roots @ turn.T


def _blend(
    before: NDArray[Any], after: NDArray[Any], root: NDArray[Any], to: NDArray[Any], count: int
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Poses between two, without them; bones turn the shorter way."""
    x = np.arange(1, count + 1) / (count + 1)
    x = x * x * (3 - 2 * x)
    bones = [
        Slerp([0, 1], Rotation.from_matrix(np.stack(pair)))(x).as_matrix()
        for pair in zip(before, after, strict=True)
    ]
    return np.stack(bones, axis=1), root + x[:, None] * (to - root)


def _order(once: int, count: int) -> Iterator[int]:
    """Frames of the take: forward, backward, forward ..."""
    period = max(2 * once - 2, 1)
    for frame in range(count):
        at = frame % period
        yield at if at < once else period - at


def _go_through(once: Path, folder: Path, count: int, rng: np.random.Generator) -> None:
    """Writes the take."""
    part = folder.with_name(f"{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    shutil.copytree(once, part, ignore=shutil.ignore_patterns("cam_*.mp4", "masks", "truth.json"))
    shutil.copytree(once / "background", part / "background", dirs_exist_ok=True)
    truth = json.loads((once / "truth.json").read_text())
    frames = list(_order(len(next(iter(truth["joints"].values()))), count))
    truth["joints"] = {name: [at[k] for k in frames] for name, at in truth["joints"].items()}
    for number, video in enumerate(sorted(once.glob("cam_*.mp4"))):
        pictures = _read(video)
        size = pictures[0].shape[1::-1]
        out = cv2.VideoWriter(str(part / video.name), cv2.VideoWriter.fourcc(*"mp4v"), FPS, size)
        grain = rng.normal(0, _NOISE, (4, *pictures[0].shape)).astype(np.float32)
        for time, k in enumerate(frames):
            gain = 1 + _DRIFT * np.sin(2 * np.pi * time / (FPS * _DRIFT_S) + number)
            noise = np.roll(grain[rng.integers(4)], rng.integers(size, size=2), axis=(0, 1))
            out.write(np.clip(pictures[k] * np.float32(gain) + noise, 0, 255).astype(np.uint8))
        out.release()
    (part / "truth.json").write_text(json.dumps(truth))
    part.rename(folder)


def _read(video: Path) -> list[NDArray[np.uint8]]:
    """All pictures of a video."""
    capture, pictures = cv2.VideoCapture(str(video)), []
    while True:
        there, picture = capture.read()
        if not there:
            return pictures
        pictures.append(picture)
