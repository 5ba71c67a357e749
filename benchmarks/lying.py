"""Fits people on the floor: `python -m benchmarks.lying [SEED...]`.

Each seed draws a person of ../shared/render in a recorded motion that is laid onto the floor, or
falls onto it, before three to six cameras at the height of tables, of tripods or of the ceiling.
Recordings and results stay in out/lying. Scored, in mm: mean errors of all joints relative to the
pelvis (root) and in the world (mean), the worst joint of arms and legs (limb), and the error that
was stated (said); and of the limbs' joints in all frames how many are called known, with a
confidence of a half or more, though they are over 150 mm off (false).
"""

import sys
import time
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.drawn import SHARED
from benchmarks.seated import seated
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.estimator import Settings
from silhouette_core.motion.joint_files import read_joints
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth
from voxelpose.reliability import verdict_of
from voxelpose.results import Result

OUT = Path(__file__).resolve().parents[1] / "out" / "lying"
SEEDS = tuple(range(811, 821))
KINDS = "back", "front", "side", "fall", "crawl", "exercise"
_FRAMES, _FPS = 16, 15
LIMBS = [
    k for k, name in enumerate(LANDMARK_NAMES) if name.endswith(("knee", "ankle", "elbow", "wrist"))
]
FALSE_MM = 150
_BENT = "crawl", "exercise"  # whose hips and knees are those of somebody who sits


def leans(kind: str, rng: np.random.Generator) -> Rotation:
    """How the body leans in every frame: about x forward, about y to the side, from upright."""
    forward = 1 if kind in ("front", "crawl") or (kind == "fall" and rng.random() < 0.5) else -1
    degrees = np.tile([forward * rng.uniform(75, 95), rng.uniform(-10, 10)], (_FRAMES, 1))
    if kind == "side":
        degrees = np.tile(
            rng.uniform(-25, 25, 2) + np.array([0, rng.choice([-90, 90])]), (_FRAMES, 1)
        )
    if kind == "fall":
        degrees *= np.clip(np.linspace(-0.4, 1.6, _FRAMES), 0, 1)[:, None] ** 2
    return Rotation.from_euler("xy", degrees, degrees=True)


def draw(folder: Path, seed: int) -> Path:
    """A recording, drawn if it is not there."""
    kind = KINDS[seed % len(KINDS)]
    out = folder / f"{seed}_{kind}"
    if (out / "scene.json").is_file():
        return out
    sys.path.insert(0, str(SHARED / "render"))
    import draw as shared_draw  # type: ignore[import-not-found]
    from render import film, look_at  # type: ignore[import-not-found]
    from subject import Subject, clip_positions, retarget  # type: ignore[import-not-found]

    rng = np.random.default_rng(seed)
    u = rng.uniform
    s = Subject(("male", "female")[rng.integers(2)], u(-0.4, 0.4), u(-0.4, 0.4), u(-0.4, 0.4))
    mocap = shared_draw.DATA / "mocap"
    rotation, root, clip, first, mirrored = shared_draw.piece(rng, s, mocap, _FRAMES, _FPS)
    if kind in _BENT:
        path = next(p for p in shared_draw.clips(mocap) if p.stem == clip)
        rotation, root = retarget(seated(clip_positions(path, 30.0), rng), s, mirrored)
        step = 30 // _FPS
        rotation = rotation[first : first + _FRAMES * step : step]
    across = rotation[:, s.names.index("Hips"), :2, 0].mean(axis=0)  # where the left hip is
    faced = Rotation.from_euler("z", -np.arctan2(across[1], across[0]))
    turn = Rotation.from_euler("z", u(0, 2 * np.pi)) * leans(kind, rng) * faced
    rotation = turn.as_matrix()[:, None] @ rotation
    root = np.zeros((_FRAMES, 3))
    for t in range(_FRAMES):
        vertices = s.pose(rotation[t], root[t])[0]
        root[t, 2] = -vertices[:, 2].min()
    middle = s.pose(rotation[-1], root[-1])[0]
    root[:, :2] -= 0.5 * (middle.max(axis=0) + middle.min(axis=0))[:2]
    count = int(rng.choice([3, 4, 4, 5, 6]))
    around = np.radians(u(0, 360) + 360 * (np.arange(count) + u(-0.2, 0.2, count)) / count)
    heights = u(*((0.6, 1.2), (1.0, 2.6), (2.6, 3.8))[rng.integers(3)], count)
    radius, focal = u(3.4, 4.2), u(540, 600)
    matrix = np.array([[focal, 0, 320], [0, focal, 240], [0, 0, 1]])
    cameras = [
        look_at((radius * np.cos(a), radius * np.sin(a), height), (0, 0, 0.5), matrix, (640, 480))
        for a, height in zip(around, heights, strict=True)
    ]
    look = dict(noise=u(2, 5), shadow=u(0.55, 0.85))
    scene = dict(seed=seed, kind=kind, clip=clip, cameras=count, high_m=round(heights.mean(), 1))
    film(out, s, rotation, root, cameras, fps=_FPS, seed=seed, scene=scene, **look)
    return out


def limb_errors_mm(result: Result, truth: np.ndarray) -> np.ndarray:
    """Errors (T, 8) of `LIMBS` in the frames of a result, mm; truth (frames, 15, 3) in metres."""
    motion = result.motion
    apart = motion.landmarks()[:, LIMBS] - truth[motion.frames][:, LIMBS]
    return 1000 * np.linalg.norm(apart, axis=2)


def main(words: list[str]) -> int:
    """Draws, fits and scores."""
    if not SHARED.is_dir():
        print(f"{SHARED} is absent: nothing to fit", file=sys.stderr)
        return 2
    print("recording       cameras  root  mean  limb  said  false    s  verdict")
    for seed in [int(word) for word in words] or SEEDS:
        recording = draw(OUT / "drawn", seed)
        out, begun = OUT / "results" / recording.name, time.perf_counter()
        result = fit(
            Recording.open(recording), Output(out, overwrite=True), Settings(network="off")
        )
        spent = time.perf_counter() - begun
        truth = read_truth(recording / "truth.json")
        joints = read_joints(out / "joints.csv", len(truth))
        scored = score_motion(truth, joints)
        quality, off_mm = result.motion.quality, limb_errors_mm(result, truth)
        false = (off_mm > FALSE_MM) & (quality["landmark_confidence"][:, LIMBS] >= 0.5)
        print(
            f"{recording.name:<16}{len(Recording.open(recording).rig):>7}{scored.root_mm:>6.0f}"
            f"{scored.mpjpe_mm:>6.0f}{off_mm.mean(axis=0).max():>6.0f}"
            f"{np.nanmean(quality['joint_error_mm']):>6.0f}{false.sum():>7}{spent:>5.0f}"
            f"  {verdict_of(result.summary)}",
            flush=True,
        )
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
