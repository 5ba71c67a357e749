"""The notation of movements: key poses as text.

A key is a time in seconds and then what differs from standing, `name number` pairs in degrees: "0.5
r.arm 75 elbow 12 lean 5". Limbs' names mean both sides, with "l." or "r." before them one. What a
key leaves out is as in standing.

- arm, out: the upper arm's swing forward and sideways from hanging, together one turn of sqrt(arm²
  + out²) toward where they point; out below 0 is across the body. elbow: bend. turn: of the upper
  arm about itself, above 0 brings a bent forearm inward. lift: shoulder.
- hip, straddle: the thigh likewise. knee: bend. toe: foot outward. heel: raised (above 0) or toes
  raised; 0 is the sole flat.
- tip: pelvis forward. lean, side, twist: trunk forward, to its left, its left shoulder back. look,
  nod: head to the left, down.
- yaw: the whole body, to its left.

A movement's table has `keys`, and may have `hold` (a key's pairs for every key), `repeat` (how
often), `cycle` (seconds after which the keys follow with left and right exchanged; one repeat is
both), `yaw_per_cycle` (degrees of turning), `speed` and `sideways` (m/s ahead and to the left).
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

MIDDLE = ("tip", "lean", "side", "twist", "look", "nod", "yaw")
LIMBS = ("arm", "out", "elbow", "turn", "lift", "hip", "straddle", "knee", "toe", "heel")
COLUMNS = MIDDLE + tuple(f"{side}.{limb}" for side in "lr" for limb in LIMBS)
_STANDING = {
    "out": 9.0,
    "elbow": 14.0,
    "arm": 2.0,
    "turn": 10.0,
    "hip": 2.0,
    "knee": 4.0,
    "straddle": 3.0,
    "toe": 6.0,
}
STANDING = np.array([_STANDING.get(column.rpartition(".")[2], 0.0) for column in COLUMNS])
_EXCHANGED = [
    COLUMNS.index(c.replace("l.", "?.").replace("r.", "l.").replace("?.", "r.")) if "." in c else k
    for k, c in enumerate(COLUMNS)
]
_TURNED = np.where(np.isin(COLUMNS, ["side", "twist", "look", "yaw"]), -1.0, 1.0)


@dataclass(frozen=True, eq=False)
class Movement:
    """Key poses of one movement, all repeats written out.

    Attributes:
        times_s: (K,) increasing, from 0.
        poses_deg: (K, C) by `COLUMNS`.
        speed: m/s ahead and to the left.
    """

    times_s: NDArray[np.float64]
    poses_deg: NDArray[np.float64]
    speed: tuple[float, float]


def movements() -> dict[str, Movement]:
    """Returns the movements of movements.toml by name."""
    text = (files("silhouette_core.motion.keyposes") / "movements.toml").read_text(encoding="utf-8")
    return {name: _movement(**table) for name, table in tomllib.loads(text).items()}


def _movement(
    keys: list[str],
    hold: str = "",
    repeat: int = 1,
    cycle: float = 0.0,
    yaw_per_cycle: float = 0.0,
    speed: float = 0.0,
    sideways: float = 0.0,
) -> Movement:
    times = np.array([float(key.split()[0]) for key in keys])
    poses = np.array([_pose(f"{hold} {key.partition(' ')[2]}") for key in keys])
    period = cycle or times[-1]
    if cycle:
        other = poses[:, _EXCHANGED] * (np.ones(len(COLUMNS)) if yaw_per_cycle else _TURNED)
        times, poses = np.append(times, times + cycle), np.vstack([poses, other])
        period = 2 * cycle
    elif repeat > 1:  # the last key is the first of the next round
        times, poses = times[:-1], poses[:-1]
    whole = np.concatenate([times + period * k for k in range(repeat)])
    all_poses = np.tile(poses, (repeat, 1))
    if cycle or repeat > 1:
        whole, all_poses = np.append(whole, period * repeat), np.vstack([all_poses, poses[:1]])
    all_poses[:, COLUMNS.index("yaw")] += yaw_per_cycle * whole / (cycle or period)
    return Movement(whole, all_poses, (speed, sideways))


def _pose(pairs: str) -> NDArray[np.float64]:
    pose = STANDING.copy()
    words = pairs.split()
    for name, number in zip(words[::2], words[1::2], strict=True):
        for column in (name,) if name in COLUMNS else (f"l.{name}", f"r.{name}"):
            pose[COLUMNS.index(column)] = float(number)
    return pose
