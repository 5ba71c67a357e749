"""Fits seated people, whose chair came with them: `python -m benchmarks.seated [SEED...]`.

Each seed draws a person of ../shared/render who sits and moves the upper body as in a recorded
motion, before three to six cameras, once with no chair (`air`), on a stool (`stool`) and on a chair
with a backrest (`chair`). The empty view shows no furniture, as when it was carried in with the
person. Recordings and results stay in out/seated. Scored: mean absolute errors of the knees and
ankles, and of all joints, mm.
"""

import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.drawn import SHARED
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.motion.joint_files import read_joints
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth
from voxelpose.reliability import verdict_of

OUT = Path(__file__).resolve().parents[1] / "out" / "seated"
SEEDS = 701, 702, 703, 704
KINDS = "air", "stool", "chair"
_CLIPS = "train_directing_traffic_1", "train_directing_traffic_4", "test_basketball_1"
_FRAMES, _FPS = 60, 30
_LEGS = [
    LANDMARK_NAMES.index(f"{side}_{joint}")
    for side in ("left", "right")
    for joint in ("knee", "ankle")
]
_BOX = np.array([[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4],
                 [2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]])  # fmt: skip


def box(low: tuple[float, ...], high: tuple[float, ...]) -> NDArray[np.float64]:
    """The eight corners of a box."""
    return np.array([[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]]
                     for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # fmt: skip


def furniture(kind: str, seat_m: float) -> list[NDArray[np.float64]]:
    """Boxes of a chair at the origin, whose user faces -y: seat, four legs, backrest."""
    if kind == "air":
        return []
    half, thick, leg = 0.22, 0.05, 0.02
    boxes = [box((-half, -half, seat_m - thick), (half, half, seat_m))]
    for x in (-half + leg, half - leg):
        for y in (-half + leg, half - leg):
            boxes.append(box((x - leg, y - leg, 0.01), (x + leg, y + leg, seat_m - thick)))
    if kind == "chair":
        boxes.append(box((-half, half - 0.04, seat_m + 0.12), (half, half, seat_m + 0.45)))
    return boxes


def seated(position: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """A recorded motion's joint positions, with its hips held still and its legs sitting."""
    hips = position["hips"]
    position = {name: at - hips + hips[:1] for name, at in position.items()}
    count = len(hips)
    lateral = position["lhip"] - position["rhip"]
    lateral[:, 2] = 0
    lateral /= np.linalg.norm(lateral, axis=-1, keepdims=True)
    mean = lateral[1:].mean(axis=0)
    lateral[:] = mean / np.linalg.norm(mean)
    up = np.array([0.0, 0, 1])
    forward = np.cross(up, lateral)
    forward *= (
        -1 if np.median(((position["ltoe"] - position["lankle"]) * forward).sum(-1)) < 0 else 1
    )
    t = np.arange(count)[:, None] / 30
    for side in "lr":
        along = [np.linalg.norm(position[side + b] - position[side + a], axis=-1).mean()
                 for a, b in (("hip", "knee"), ("knee", "ankle"), ("ankle", "toe"))]  # fmt: skip
        spread = (1 if side == "l" else -1) * rng.uniform(0.0, 0.25)
        thigh = forward + spread * lateral + rng.uniform(-0.1, 0.1) * up
        swing = rng.uniform(-0.3, 0.2) + rng.uniform(0, 0.2) * np.sin(rng.uniform(1, 3) * t)
        knee = position[side + "hip"] + along[0] * thigh / np.linalg.norm(
            thigh, axis=-1, keepdims=True
        )
        shank = -up + swing * forward
        ankle = knee + along[1] * shank / np.linalg.norm(shank, axis=-1, keepdims=True)
        position |= {side + "knee": knee, side + "ankle": ankle}
        position[side + "toe"] = ankle + along[2] * (forward - 0.15 * up)
    return position


def draw(folder: Path, seed: int, kind: str) -> Path:
    """A recording, drawn if it is not there."""
    out = folder / f"{seed}_{kind}"
    if (out / "scene.json").is_file():
        return out
    sys.path.insert(0, str(SHARED / "render"))
    import draw as shared_draw  # type: ignore[import-not-found]
    from render import film, look_at  # type: ignore[import-not-found]
    from subject import Subject, clip_positions, retarget  # type: ignore[import-not-found]

    rng = np.random.default_rng(seed)
    u = rng.uniform
    s = Subject(("male", "female")[rng.integers(2)], u(-0.5, 0.5), u(-0.4, 0.6), u(-0.5, 0.5))
    paths = [p for p in shared_draw.clips(shared_draw.DATA / "mocap") if p.stem in _CLIPS]
    position = clip_positions(paths[rng.integers(len(paths))], 30.0)
    rotation, root = retarget(seated(position, rng), s)
    first = int(rng.integers(0, len(root) - _FRAMES))
    rotation, root = rotation[first : first + _FRAMES], root[first : first + _FRAMES]
    root[:, :2] -= root[:, :2].mean(axis=0)
    vertices, joints, _ = s.pose(rotation[0], root[0])
    hips = [joints[s.names.index(f"{side}UpLeg")] for side in ("Left", "Right")]
    middle, side = 0.5 * (hips[0] + hips[1]), (hips[0] - hips[1])[:2]
    yaw = np.arctan2(side[1], side[0])
    near = np.abs(vertices[:, :2] - middle[:2]).max(axis=1) < 0.08
    seat = float(vertices[near, 2].min()) - 0.01
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    place = np.array([middle[0], middle[1], 0]) - turn @ np.array([0, 0.04, 0])
    _add_furniture(s, [b @ turn.T + place for b in furniture(kind, seat)])
    count = int(rng.choice([3, 4, 4, 5, 6]))
    around = np.radians(u(0, 360) + 360 * (np.arange(count) + u(-0.2, 0.2, count)) / count)
    radius, focal = u(3.6, 4.5), u(540, 600)
    matrix = np.array([[focal, 0, 320], [0, focal, 240], [0, 0, 1]])
    cameras = [
        look_at((radius * np.cos(a), radius * np.sin(a), u(0.9, 2.5)), (0, 0, 0.75), matrix,
                (640, 480), (u(-0.2, 0.02), u(0, 0.05), 0, 0, 0.0)) for a in around
    ]  # fmt: skip
    colour = lambda: tuple(u(25, 215, 3))  # noqa: E731
    colours = dict(skin=(130, 160, 215), shirt=colour(), trousers=colour(), shoes=colour())
    look = dict(noise=u(2, 6), blur=u(0.1, 0.4), shadow=u(0.55, 0.85), colours=colours)
    scene = dict(seed=seed, kind=kind, cameras=count)
    film(out, s, rotation, root, cameras, fps=_FPS, seed=seed, scene=scene, **look)
    return out


def _add_furniture(subject: Any, boxes: list[NDArray[np.float64]]) -> None:
    """Lets the subject's mesh have boxes that do not move; they have the trousers' colour."""
    if not boxes:
        return
    body, first = subject.pose, len(subject.vertices)
    faces = np.concatenate([_BOX + first + 8 * k for k in range(len(boxes))])
    corners = np.concatenate(boxes)
    subject.faces = np.concatenate([subject.faces, faces])
    legs = np.zeros((len(corners), subject.weights.shape[1]))
    legs[:, subject.names.index("LeftUpLeg")] = 1
    whole = np.concatenate([subject.weights, legs])

    def pose(rotations: Any, root: Any) -> Any:
        vertices, joints, top = body(rotations, root)
        return np.concatenate([vertices, corners]), joints, top

    rest, own = subject.vertices, subject.weights

    def alone(rotations: Any, root: Any) -> Any:
        subject.vertices, subject.weights = rest, own
        try:
            return pose(rotations, root)
        finally:
            subject.vertices, subject.weights = np.concatenate([rest, corners]), whole

    subject.vertices, subject.weights, subject.pose = np.concatenate([rest, corners]), whole, alone


def main(words: list[str]) -> int:
    """Draws, fits and scores."""
    if not SHARED.is_dir():
        print(f"{SHARED} is absent: nothing to fit", file=sys.stderr)
        return 2
    seeds = [int(word) for word in words] or SEEDS
    print("recording      cameras  legs_mm  mpjpe_mm  root_mm    s  verdict")
    for seed in seeds:
        for kind in KINDS:
            recording = draw(OUT / "drawn", seed, kind)
            result, begun = OUT / "results" / recording.name, time.perf_counter()
            found = fit(Recording.open(recording), Output(result, overwrite=True))
            spent = time.perf_counter() - begun
            truth = read_truth(recording / "truth.json")
            joints = read_joints(result / "joints.csv", len(truth))
            scored = score_motion(truth, joints)
            verdict = verdict_of(found.summary).level
            legs = 1000 * np.nanmean(np.linalg.norm(joints[:, _LEGS] - truth[:, _LEGS], axis=-1))
            print(
                f"{recording.name:<14}{len(Recording.open(recording).rig):>8}{legs:>9.1f}"
                f"{scored.mpjpe_mm:>10.1f}{scored.root_mm:>9.1f}{spent:>5.0f}  {verdict}",
                flush=True,
            )
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
