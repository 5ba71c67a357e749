"""What each part of the estimators carries: it is taken out, and the same recordings are estimated.

    python -m benchmarks.ablation one RECORDING ...
    python -m benchmarks.ablation several [SEED ...]

`one`: the only camera of each RECORDING (a folder with truth.json), as `track` with the true
stature, without each cost in turn; with motion model DM1 instead of DM2; and as `--method paper`.
`several`: for every SEED a person of ../shared/render whose limbs are near to each other (crossed
legs, folded arms, hands on hips) before four cameras, with the interference of parts (Iiyama,
Kameda and Minoh, section 3) and without: finished fits, and every sixth frame searched by itself.
Prints the mean error of the joints relative to the pelvis, mm. Drawn recordings and results stay in
out/ablation; results are not made again.
"""

import json
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from benchmarks.drawn import SHARED
from benchmarks.follower import first_pose_mm, silhouettes
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Settings
from silhouette_core.monocular import tuning
from silhouette_core.monocular.tracking import hypothesis_tracker
from silhouette_core.monocular.tracking.frame_costs import FrameCosts
from silhouette_core.motion.joint_files import read_joints
from silhouette_core.motion.keyposes.notation import COLUMNS, STANDING, Movement, movements
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.motion.kinematics import forward
from voxelpose.evaluation import score_motion
from voxelpose.fitting import Output, fit
from voxelpose.multiview.matching import matcher
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth

OUT = Path(__file__).resolve().parents[1] / "out" / "ablation"
TERMS = "floor", "proposal"
CROSSED_DEG = {"l.hip": 20, "l.straddle": -14, "l.knee": 14,
               "r.hip": -5, "r.straddle": -12, "r.knee": 14}  # fmt: skip
SEEDS = 1, 2, 3, 4
_EVERY = 6
# Parts whose proximal joints are what the renderer calls so.
_NAMES = {
    "hips": "pelvis",
    "spine": "lumbar",
    "chest": "thorax",
    "neck": "neck",
    "head": "head",
} | {
    f"{side[0]}{name}": f"{side}_{part}"
    for side in ("left", "right")
    for name, part in (
        *(("clav", "clavicle"), ("shoulder", "upper_arm"), ("elbow", "forearm")),
        *(("wrist", "hand"), ("hip", "thigh"), ("knee", "shin"), ("ankle", "foot")),
        ("toe", "toes"),
    )
}

Switch = Callable[[], AbstractContextManager[object]]


def without_term(name: str) -> AbstractContextManager[object]:
    """Hypotheses of one camera without one of their costs."""
    init = FrameCosts.__init__

    def fewer(self: FrameCosts, *given: object) -> None:
        init(self, *given)  # type: ignore[arg-type]
        del self.terms[name]

    return patch.object(FrameCosts, "__init__", fewer)


def occlusion_unaware() -> AbstractContextManager[object]:
    """Motion model DM1 in the product: eq. (4) alone, without (5)."""
    model = replace(tuning.MOTION_MODEL, magnification=1.0)
    return patch.object(hypothesis_tracker, "MOTION_MODEL", model)


def one_by_one() -> AbstractContextManager[object]:
    """Parts matched one after the other, whether or not their movable areas interfere."""
    return patch.object(matcher, "_interfering", lambda candidates: [[c] for c in candidates])


ONE: dict[str, tuple[str, Switch]] = {
    "whole": ("monocular", nullcontext),
    **{f"without {name}": ("monocular", lambda name=name: without_term(name)) for name in TERMS},
    "DM1": ("monocular", occlusion_unaware),
    "paper": ("tree", nullcontext),
}
SEVERAL: dict[str, Switch] = {"together": nullcontext, "one by one": one_by_one}


def off_mm(folder: Path, result: Path, estimator: str, switch: Switch) -> float:
    """Error of a recording estimated in one way, kept in `result`."""
    truth = read_truth(folder / "truth.json")
    if not (result / "joints.csv").exists():
        stature_m = json.loads((folder / "truth.json").read_text())["stature"]
        settings = Settings(stature_m=stature_m, threads=1)
        with switch():
            fit(Recording.open(folder), Output(result, overwrite=True), settings, estimator)
    return score_motion(truth, read_joints(result / "joints.csv", len(truth))).root_mm


def one(folders: list[Path]) -> None:
    """One camera: a row for each recording, a column for each way."""
    print(f"{'recording':<12}" + "".join(f"{name:>20}" for name in ONE))
    rows = []
    for folder in folders:
        kept = OUT / "one" / f"{folder.parent.name}_{folder.name}"
        rows.append([off_mm(folder, kept / name, *ONE[name]) for name in ONE])
        print(f"{folder.name:<12}" + "".join(f"{mm:>20.1f}" for mm in rows[-1]), flush=True)
    for name, share in (("median", 50), ("90 %", 90)):
        print(f"{name:<12}" + "".join(f"{mm:>20.1f}" for mm in np.percentile(rows, share, axis=0)))
    worse = np.array(rows) - np.array(rows)[:, :1]
    print(f"{'than whole':<12}" + "".join(f"{mm:>+20.1f}" for mm in worse.mean(axis=0)))
    error = worse.std(axis=0, ddof=1) / np.sqrt(len(rows)) if len(rows) > 1 else worse[0] * np.nan
    print(f"{'(its error)':<12}" + "".join(f"{mm:>20.1f}" for mm in error))


def near_positions(kind: str, rng: np.random.Generator) -> dict[str, NDArray[np.float64]]:
    """Joints (1 + T, 3) of somebody whose limbs are near to each other, by the renderer's names.

    They sway about the pose. Row 0 stands upright.
    """
    pose = STANDING.copy()
    if kind == "crossed legs":
        pose[[COLUMNS.index(name) for name in CROSSED_DEG]] = list(CROSSED_DEG.values())
    else:
        pose = movements()[kind].poses_deg[1]
    moved = np.where(pose != STANDING, 4.0, 0.0)
    keys = np.concatenate([STANDING[None], pose + rng.normal(0, moved, (5, len(pose)))])
    times_s = np.array([0.0, *(1.0 + 0.4 * np.arange(5))])
    model = BodyModel.from_sizes(BodySizes(1.75))
    motion = perform(Movement(times_s, keys, (0.0, 0.0)), model)
    joints = forward(model, motion.root_m, motion.root_quaternion, motion.angles_rad)[1]
    joints = np.concatenate([joints[:1], joints[30:]])
    return {name: joints[:, model.names.index(part)] for name, part in _NAMES.items()}


def draw(seed: int, kind: str) -> Path:
    """A recording of somebody whose limbs are near to each other, drawn if it is not there."""
    out = OUT / "drawn" / f"{kind.replace(' ', '_')}_{seed}"
    if (out / "truth.json").is_file():
        return out
    sys.path.insert(0, str(SHARED / "render"))
    from render import film, look_at  # type: ignore[import-not-found]
    from subject import Subject, retarget  # type: ignore[import-not-found]

    rng = np.random.default_rng(seed)
    u = rng.uniform
    subject = Subject(("male", "female")[rng.integers(2)], u(-0.5, 0.5), u(-0.4, 0.6), u(-0.5, 0.5))
    rotation, root = retarget(near_positions(kind, rng), subject)
    around, focal = np.radians(u(0, 360) + 90 * (np.arange(4) + u(-0.15, 0.15, 4))), u(540, 600)
    matrix = np.array([[focal, 0, 320], [0, focal, 240], [0, 0, 1]])
    cameras = [
        look_at((4.4 * np.cos(a), 4.4 * np.sin(a), u(0.9, 2.5)), (0, 0, 0.95), matrix, (640, 480))
        for a in around
    ]
    colours = {name: tuple(u(25, 215, 3)) for name in ("shirt", "trousers", "shoes")}
    colours["skin"] = (130, 160, 215)
    scene = {"seed": seed, "kind": kind, "cameras": 4, "stature": round(subject.stature, 3)}
    film(out, subject, rotation, root, cameras, seed=seed, scene=scene, colours=colours)
    return out


def several(seeds: list[int]) -> None:
    """Several cameras: a row for each kind and seed; finished fits, and frames by themselves."""
    print(f"{'recording':<20}" + "".join(f"{name + w:>24}" for w in (", fit", ", frames")
                                         for name in SEVERAL))  # fmt: skip
    rows = []
    for kind in ("crossed legs", "arms folded", "hands on hips"):
        for seed in seeds:
            folder = draw(seed, kind)
            kept = OUT / "several" / folder.name
            row = [off_mm(folder, kept / name, "multiview", SEVERAL[name]) for name in SEVERAL]
            truth = read_truth(folder / "truth.json")
            rig, masks = silhouettes(Recording.open(folder), 480)
            stature_m = json.loads((folder / "truth.json").read_text())["stature"]
            settings, numbers = Settings(stature_m=stature_m), range(0, len(masks), _EVERY)
            for switch in SEVERAL.values():
                with switch():
                    found = [first_pose_mm(rig, settings, masks[k], truth[k]) for k in numbers]
                row.append(float(np.mean(found)))
            rows.append(row)
            print(f"{folder.name:<20}" + "".join(f"{mm:>24.1f}" for mm in row), flush=True)
    print(f"{'mean':<20}" + "".join(f"{mm:>24.1f}" for mm in np.mean(rows, axis=0)))


def main(words: list[str]) -> int:
    """Runs one of the two tables."""
    if words[:1] == ["one"] and len(words) > 1:
        one([Path(word) for word in words[1:]])
    elif words[:1] == ["several"]:
        if not SHARED.is_dir():
            print(f"{SHARED} is absent: nobody to draw", file=sys.stderr)
            return 2
        several([int(word) for word in words[1:]] or list(SEEDS))
    else:
        print(__doc__, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
