"""Silhouettes before uniform backdrops, without an empty view, against the rendered truth.

    python -m benchmarks.screens [--seeds 0 ...] [--colours blue ...] [--sheet FILE]

The demo's actor stands in place before a screen and moves one arm, or walks, before screens of
several colours, with a floor of another colour and without. Light falls off to one side and toward
the corners; there are sensor noise, flicker, a cast shadow, and a tenth of the screen's colour on
the actor, whose clothes differ from the screen's colour. All of this is drawn from the seed. One
line each: intersection over union, mean of eight frames, of the background that is found by itself
(`auto`, with its kind) and of the one estimated from the take as before (`moving`).
"""

import argparse
import sys
import tempfile
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.contact_sheet import Tile, write_sheet
from benchmarks.overlap import overlap
from calib.camera import Camera, Rig
from calib.files import write_rig
from silhouette_core.image.silhouettes import Silhouettes
from silhouette_core.jit import set_threads
from voxelpose.demo.choreography import Performance, performances
from voxelpose.demo.mannequin import COLOURS_BGR, Mannequin
from voxelpose.demo.room import FilmCamera, demo_rig, write_video
from voxelpose.recording.folder import Recording

SCREENS = {
    "blue": (170, 80, 30),
    "green": (70, 175, 60),
    "white": (235, 235, 235),
    "grey": (128, 128, 128),
    "black": (22, 22, 22),
    "red": (50, 45, 170),
    "beige": (150, 180, 200),
}  # BGR
FLOORED = {True: "floor", False: "no floor"}
_FRAMES, _COMPARED, _FPS = 45, 8, 15
_BEHIND_M, _APART = 1.6, 90  # of the screen; grey levels of clothes and screen, summed
_WAVE = (0.0, 10, 10), (0.7, 100, 50), (1.4, 10, 10)  # seconds; degrees of the right arm


class ScreenCamera(FilmCamera):
    """One camera's view of an actor before a screen."""

    def __init__(self, camera: Camera, seed: int, screen: Sequence[float], floor: bool) -> None:
        """Paints the screen, and dresses the actor."""
        rng = np.random.default_rng((seed, *(int(value) for value in screen), floor))
        colour = np.clip(np.array(screen) + rng.uniform(-12, 12, 3), 8, 245)
        clothes = COLOURS_BGR.copy()
        for number in range(len(clothes)):
            while np.abs(clothes[number] - colour).sum() < _APART:
                clothes[number] = rng.uniform(25, 215, 3)
        super().__init__(camera, rng, 0.9 * clothes + 0.1 * colour, rng.uniform(0.2, 0.45))
        height, width = self._room.shape[:2]
        x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        centre, direction = self._wide.rays(np.column_stack([x.ravel(), y.ravel()]))
        with np.errstate(divide="ignore"):
            to_floor = np.where(direction[:, 2] < 0, -centre[2] / direction[:, 2], np.inf)
        away = -centre[:2] / np.linalg.norm(centre[:2])
        to_screen = (_BEHIND_M - centre[:2] @ away) / (direction[:, :2] @ away)
        below = (to_floor < to_screen).reshape(height, width, 1)
        ground = colour + rng.uniform(30, 90, 3) * np.where(colour < 128, 1, -1)
        light = np.where(below & floor, ground, colour)
        u, v = 2 * x / width - 1, 2 * y / height - 1
        slope = rng.uniform(-0.15, 0.15, 2)
        dark = rng.uniform(0.1, 0.3) / 2 * (u**2 + v**2)
        self._room = (light * (1 + slope[0] * u + slope[1] * v - dark)[..., None]).astype(
            np.float32
        )
        self._floor = below.astype(np.float32)
        self._noise *= rng.uniform(0.7, 2.0)


class MaskCamera(FilmCamera):
    """The actor white before black."""

    def __init__(self, camera: Camera) -> None:
        """Blackens the room."""
        bright = np.full_like(COLOURS_BGR, 1000.0)  # whatever the light
        super().__init__(camera, np.random.default_rng(0), bright, 0.0)
        self._room, self._noise = np.zeros_like(self._room), np.zeros_like(self._noise)


def film(
    folder: Path, colour: Sequence[float], floor: bool, action: str, seed: int
) -> list[NDArray[np.bool_]]:
    """Films a take into a folder; the actor's silhouettes (480, 640) of its frames."""
    rng = np.random.default_rng((seed, floor))
    camera = demo_rig(4)[f"cam_{rng.integers(1, 5)}"]
    actor, view, mask = (
        Mannequin.build(),
        ScreenCamera(camera, seed, colour, floor),
        MaskCamera(camera),
    )
    centre = -camera.rotation.T @ camera.translation
    yaw = float(np.degrees(np.arctan2(centre[0], -centre[1])) + rng.uniform(-50, 50))
    wave = Performance("yaw r_out r_elbow", np.array([[t, yaw, *arm] for t, *arm in _WAVE], float))
    played = wave if action == "standing" else performances()["walk"]
    poses = [actor.pose(*played.pose_at(frame / _FPS))[0] for frame in range(_FRAMES)]
    folder.mkdir(parents=True)
    write_rig(Rig((camera,)), folder / "calibration.toml")
    pictures = (view.picture(v, actor.faces, actor.face_colour) for v in poses)
    write_video(folder / f"{camera.name}.mp4", _FPS, pictures)
    return [mask.picture(v, actor.faces, actor.face_colour)[..., 0] > 127 for v in poses]


def measure(folder: Path, true: Sequence[NDArray[np.bool_]]) -> tuple[str, list[float], list[Tile]]:
    """Kind of background, mean overlaps with both, and pictures."""
    recording = Recording.open(folder)
    (name,) = recording.rig.names
    found = [Silhouettes(recording, kind) for kind in ("auto", "moving")]
    numbers = np.linspace(0, _FRAMES - 1, _COMPARED).round().astype(int).tolist()
    scores: list[list[float]] = [[], []]
    tiles: list[Tile] = []
    for number, frames in zip(numbers, recording.at(numbers), strict=True):
        for silhouettes, score in zip(found, scores, strict=True):
            mask = silhouettes.of(frames)[name]
            score.append(overlap(mask, true[number]))
            if silhouettes is found[0]:
                tiles.append(Tile(frames[name], mask, true[number], None, f"{score[-1]:.2f}"))
    return found[0].kinds[name], [float(np.mean(score)) for score in scores], tiles[::2]


def main(arguments: Sequence[str] | None = None) -> int:
    """Films and measures."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", nargs="*", type=int, default=[0])
    parser.add_argument("--colours", nargs="*", choices=SCREENS, default=list(SCREENS))
    parser.add_argument("--sheet", type=Path, metavar="FILE")
    given = parser.parse_args(arguments)
    set_threads()
    print(f"{'screen':<8}{'':<10}{'actor':<10}{'seed':>5}  {'kind':<20}{'auto':>7}{'moving':>8}")
    means: dict[str, list[list[float]]] = defaultdict(list)
    rows: list[list[Tile]] = []
    with tempfile.TemporaryDirectory() as scratch:
        for seed in given.seeds:
            for colour in given.colours:
                for floor, words in FLOORED.items():
                    for action in ("standing", "walking"):
                        folder = Path(scratch) / f"{seed}{colour}{floor}{action}"
                        true = film(folder, SCREENS[colour], floor, action, seed)
                        kind, overlaps, tiles = measure(folder, true)
                        means[action].append(overlaps)
                        rows.append(tiles)
                        values = f"{overlaps[0]:>7.3f}{overlaps[1]:>8.3f}"
                        print(
                            f"{colour:<8}{words:<10}{action:<10}{seed:>5}  {kind:<20}{values}",
                            flush=True,
                        )
    for action, scores in means.items():
        auto, moving = np.mean(scores, axis=0)
        least = min(score[0] for score in scores)
        print(f"{action}: auto {auto:.3f} (least {least:.3f}), moving {moving:.3f}")
    if given.sheet is not None:
        write_sheet(rows, given.sheet)
    return 0


if __name__ == "__main__":
    sys.exit(main())
