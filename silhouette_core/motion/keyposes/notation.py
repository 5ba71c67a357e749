"""Notation of movements: key poses as text.

A key is a time in seconds, followed by the angles that differ from standing, pairs of name and
degrees: "0.5 r.arm 75 elbow 12 lean 5". A limb's name means both sides, with "l." or "r." before it
one side.

- arm, out: swing of the upper arm forward and sideways from hanging, together one turn by
  sqrt(arm² + out²) in the direction (arm, out); out below 0 is across the body. elbow: flexion.
  turn: rotation of the upper arm about its axis, above 0 inward for a bent forearm. lift: raising
  of the shoulder.
- hip, straddle: swing of the thigh, likewise. knee: flexion. toe: turn of the foot outward. heel:
  raising of the heel, below 0 of the toes; 0 is a flat sole.
- tip: pelvis forward. lean, side, twist: trunk forward, to its left, left shoulder back. look, nod:
  head to the left, down.
- yaw: the whole body to its left.

A movement's table has `keys`, and may have `hold` (pairs for every key), `repeat` (number of
repetitions), `cycle` (seconds after which the keys follow with left and right exchanged; one
repetition is both), `yaw_per_cycle` (degrees of turning), `speed` and `sideways` (m/s ahead and to
the left).
"""

import tomllib
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from calib.checks import FloatArray

MIDDLE = ("tip", "lean", "side", "twist", "look", "nod", "yaw")
LIMBS = ("arm", "out", "elbow", "turn", "lift", "hip", "straddle", "knee", "toe", "heel")
COLUMNS = MIDDLE + tuple(f"{side}.{limb}" for side in "lr" for limb in LIMBS)
_STANDING = dict(out=9, elbow=14, arm=2, turn=10, hip=2, knee=4, straddle=3, toe=6)
STANDING = np.array([_STANDING.get(column.rpartition(".")[2], 0) for column in COLUMNS], float)
_EXCHANGED = [
    COLUMNS.index(c.replace("l.", "?.").replace("r.", "l.").replace("?.", "r.")) if "." in c else k
    for k, c in enumerate(COLUMNS)
]
_TURNED = np.where(np.isin(COLUMNS, ["side", "twist", "look", "yaw"]), -1, 1)


@dataclass(frozen=True, eq=False)
class Movement:
    """Key poses of one movement, with all repetitions."""

    times_s: FloatArray  #: (K,) float64, increasing, from 0.
    poses_deg: FloatArray  #: (K, C) float64, angles in the order of `COLUMNS`.
    speed: tuple[float, float]  #: m/s ahead and to the left.


def movements() -> dict[str, Movement]:
    """Movements of movements.toml by name."""
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
    elif repeat > 1:  # the last key is the first of the next repetition
        times, poses = times[:-1], poses[:-1]
    whole = np.concatenate([times + period * k for k in range(repeat)])
    all_poses = np.tile(poses, (repeat, 1))
    if cycle or repeat > 1:
        whole, all_poses = np.append(whole, period * repeat), np.vstack([all_poses, poses[:1]])
    all_poses[:, COLUMNS.index("yaw")] += yaw_per_cycle * whole / (cycle or period)
    return Movement(whole, all_poses, (speed, sideways))


def _pose(pairs: str) -> FloatArray:
    pose = STANDING.copy()
    words = pairs.split()
    for name, number in zip(words[::2], words[1::2], strict=True):
        for column in (name,) if name in COLUMNS else (f"l.{name}", f"r.{name}"):
            pose[COLUMNS.index(column)] = float(number)
    return pose
