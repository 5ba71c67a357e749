"""Scores bodies that are no person's: python -m benchmarks.bodies [EXAMPLE | track_EXAMPLE ...]

A robot arm, a quadruped, a desk lamp and a person with a stick, rendered by the project with the
exact truth (examples.bodies), are fitted from four cameras with the very body that
was rendered, and with one whose surface is wrong by 8 mm. Then single frames of the quadruped, each
matched by itself from the true place of its trunk, with and without interference, from four and
from two cameras; and random stances of a spider whose four legs interfere at once (silhouettes
without errors), each searched by itself without any prior, with and without interference. Last, the
robot arm and the quadruped tracked from each of the four cameras alone, with poses sampled within
the joint limits and with a library of another motion of the same body. One line each on stdout:
mean error of the joint angles in degrees, of the landmarks in millimetres and in per cent of the
body's length, in the world and relative to the root. Recordings and results are in out/bodies.
"""

import json
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from calib.camera import Rig
from examples.bodies.example_bodies import spider
from examples.bodies.example_motions import (
    BODY,
    EXAMPLES,
    TRUE_MOTION,
    example_motion,
    film_example,
)
from silhouette_core.body.model import BodyModel
from silhouette_core.estimator import Settings
from silhouette_core.image.raster import render_parts
from silhouette_core.monocular.making.from_motion import make_library
from silhouette_core.monocular.tree.pose_library import LibrarySettings
from silhouette_core.motion.kinematics import landmarks, place
from silhouette_core.motion.motion import Motion
from silhouette_core.motion.motion_file import read_motion, write_motion
from silhouette_core.motion.pose import Pose
from silhouette_core.progress import SilentReporter, StageClock
from silhouette_core.refinement.observation import PinholeViews
from silhouette_core.scoring.silhouette_error import posed_mesh
from voxelpose.demo.room import demo_rig
from voxelpose.fitting import Output, fit, track
from voxelpose.multiview.carving.carver import carve
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.observe import FrameObservation
from voxelpose.multiview.matching.matcher import MatchSettings, match
from voxelpose.multiview.proposers.pose_search import SEARCHED, BodyGeometry, find_pose, refine_fit
from voxelpose.multiview.silhouettes.observation_store import ObservationStore
from voxelpose.multiview.silhouettes.prepared_silhouettes import (
    PreparationSettings,
    prepare_silhouettes,
)
from voxelpose.multiview.tuning import CARVING
from voxelpose.recording.folder import Recording

OUT = Path(__file__).resolve().parents[1] / "out" / "bodies"
_FRAMES = range(0, 45, 3)
_JOINED_M = 0.5
_GROWN_M = 0.008
_STANCES, _WRONG_MM = 100, 30
_LIBRARY, _PITCHES_DEG = 36_000, (5.0, 13.0, 22.0)  # samples, and how far the cameras look down


def length_m(name: str, model: BodyModel) -> float:
    """Length to which errors are related: of the quadruped its trunk's, else the body's extent."""
    return 0.88 if name == "quadruped" else model.extent_m


def recording_of(name: str) -> Path:
    """The rendered recording, made once."""
    folder = OUT / name
    return folder if (folder / TRUE_MOTION).exists() else film_example(folder, name)


def score(name: str, motion: Motion, truth: Motion) -> dict[str, float]:
    """Errors of a motion against the true one, over the frames that have a pose."""
    rows = np.searchsorted(truth.frames, motion.frames)
    free = ~truth.model.tree.dof_fixed
    turns = np.degrees(np.abs(motion.angles_rad - truth.angles_rad[rows]))[:, free]
    found_m, true_m = motion.landmarks(), truth.landmarks()[rows]
    mm = 1000 * np.linalg.norm(found_m - true_m, axis=2)
    moved_m = found_m - found_m[:, :1] - (true_m - true_m[:, :1])
    relative_mm = 1000 * float(np.linalg.norm(moved_m, axis=2).mean())
    return {
        "frames": len(motion),
        "angle_deg": round(float(turns.mean()), 2),
        "largest_mean_angle_deg": round(float(turns.mean(0).max()), 2),
        "landmarks_mm": round(float(mm.mean()), 2),
        "worst_frame_mm": round(float(mm.mean(1).max()), 2),
        "landmarks_percent": round(float(mm.mean()) / length_m(name, truth.model) / 10, 2),
        "relative_mm": round(relative_mm, 2),
        "relative_percent": round(relative_mm / length_m(name, truth.model) / 10, 2),
    }


def fitted(
    name: str, grown_m: float = 0.0, interference: bool = True, cameras: tuple[str, ...] = ()
) -> dict[str, object]:
    """Scores one example from four cameras, or some of them, fitted with the body that was rendered
    or with one whose surface lies `grown_m` outside of it.
    """
    folder, body = recording_of(name), recording_of(name) / BODY
    truth, words = read_motion(folder / TRUE_MOTION), f"{name}_fit"
    if grown_m:
        rest, words = read_motion(body), f"{name}_grown"
        grown_surface = rest.model.vertices_m + grown_m * rest.model.vertex_normals
        grown = replace(rest, model=replace(rest.model, vertices_m=grown_surface))
        body = OUT / f"{words}.safetensors"
        write_motion(grown, body)
    started = time.perf_counter()
    options = {"body": str(body), "interference": interference}
    output, settings = Output(OUT / words, overwrite=True), Settings(options=options)
    result = fit(Recording.open(folder, cameras=list(cameras) or None), output, settings)
    seconds = round(time.perf_counter() - started, 1)
    errors = score(name, result.motion, truth)
    told = {"grown_mm": 1000 * grown_m, "interference": interference, "cameras": len(cameras) or 4}
    return {"example": name, **told, **errors, "seconds": seconds}


def library_of(name: str) -> Path:
    """Library of half a minute of the example's movement after the part that is filmed, every angle
    moving 0.75 to 1.25 times as far about a middle that is shifted by some degrees. Made once.
    """
    path = OUT / f"{name}.vplib"
    if not path.exists():
        later, rng = example_motion(name, 500).select(slice(50, None)), np.random.default_rng(7)
        middle, count = later.angles_rad.mean(0), later.model.dof_count
        gain, shift = rng.uniform(0.75, 1.25, count), np.radians(rng.normal(0, 4.0, count))
        angles = middle + shift + gain * (later.angles_rad - middle)
        other = replace(later, angles_rad=np.clip(angles, *later.model.tree.dof_limits_rad.T))
        settings = LibrarySettings(_LIBRARY, pitches_deg=_PITCHES_DEG)
        make_library({"later": other}, later.model, path, settings)
    return path


def tracked(name: str, camera: str, recorded: bool) -> dict[str, object]:
    """Scores an example tracked from one camera, with sampled poses or a library of recordings."""
    folder = recording_of(name)
    words = f"{name}_track_{camera}_{'recorded' if recorded else 'sampled'}"
    options = {"body": str(folder / BODY)} | (
        {"library": str(library_of(name))} if recorded else {}
    )
    started = time.perf_counter()
    source, output = Recording.open(folder, cameras=[camera]), Output(OUT / words, overwrite=True)
    result = track(source, output, Settings(options=options))
    seconds = round(time.perf_counter() - started, 1)
    errors = score(name, result.motion, read_motion(folder / TRUE_MOTION))
    poses = "recorded" if recorded else "sampled"
    return {"example": name, "track": camera, "poses": poses, **errors, "seconds": seconds}


def single_frames(cameras: tuple[str, ...]) -> list[dict[str, object]]:
    """Frames of the quadruped matched by themselves from the true place of the trunk, with and
    without interference: as matched, and refined.
    """
    folder = recording_of("quadruped")
    truth = read_motion(folder / TRUE_MOTION)
    rows, source = [], Recording.open(folder, cameras=list(cameras))
    preparation = PreparationSettings(CARVING.voxel_m, 0, "off", joined_m=_JOINED_M, person=False)
    with (
        prepare_silhouettes(
            source, Settings(), preparation, StageClock(), SilentReporter()
        ) as prepared,
        closing(ObservationStore(prepared.observer, prepared.store)) as observations,
    ):
        body = BodyGeometry.from_model(truth.model, CARVING.voxel_m, "cpu")
        for interference in (True, False):
            settings = replace(MatchSettings(), interference=interference)
            matched_mm, refined_mm, sizes, stopped = [], [], [], 0
            for t in _FRAMES:
                observations.carve(range(t, t + 1))
                frame = observations.observe(t)
                if frame is None:
                    continue
                rotation = truth.select(slice(t, t + 1)).parts()[0][0, 0]
                start = Pose(truth.root_m[t], rotation, np.zeros(truth.model.dof_count))
                found = match(body.body_volume, frame.grid, frame.occupancy, start, settings)
                refined = refine_fit(body, frame.observation, found.pose, None, SEARCHED)
                true_m = truth.landmarks()[t]
                matched_mm.append(_error_mm(truth.model, found.pose, true_m))
                refined_mm.append(_error_mm(truth.model, refined.pose, true_m))
                sizes.append(max(map(len, found.groups)))
                stopped += len(found.stopped)
            rows.append({
                "single_frames": len(matched_mm), "cameras": len(cameras),
                "interference": interference, "largest_group": max(sizes), "stopped": stopped,
                "matched_mm": round(float(np.mean(matched_mm)), 1),
                "refined_mm": round(float(np.mean(refined_mm)), 1),
                "refined_worst_mm": round(float(np.max(refined_mm)), 1),
                "refined_over_44_mm": int(np.sum(np.array(refined_mm) > 44)),
            })  # fmt: skip
    return rows


def stances(cameras: tuple[int, ...]) -> list[dict[str, object]]:
    """Random stances of the spider, each searched by itself with and without interference."""
    model, views = spider(), PinholeViews.from_rig(_pinholes(cameras))
    body = BodyGeometry.from_model(model, CARVING.voxel_m, "cpu")
    rows = []
    for interference in (True, False):
        settings = replace(MatchSettings(), interference=interference)
        matched_mm, fitted_mm, sizes, stopped = [], [], [], 0
        for seed in range(_STANCES):
            rng = np.random.default_rng(seed)
            turn = Rotation.from_euler("z", rng.uniform(0, 2 * np.pi)).as_matrix()
            low, high = 0.9 * model.tree.dof_limits_rad.T
            truth = Pose(np.array([0.0, 0.0, 0.45]), turn, rng.uniform(low, high))
            frame, true_m = _silhouettes(model, truth, views), _landmarks(model, truth)
            start = Pose(truth.root_m, truth.root_rotation, np.zeros(model.dof_count))
            found = match(body.body_volume, frame.grid, frame.occupancy, start, settings)
            best = find_pose(body, frame, settings)[0]
            matched_mm.append(_error_mm(model, found.pose, true_m))
            fitted_mm.append(_error_mm(model, best.pose, true_m))
            sizes.append(max(map(len, found.groups)))
            stopped += len(found.stopped) + len(best.stopped)
        wrong = np.array(fitted_mm) > _WRONG_MM
        rows.append({
            "spider_stances": _STANCES, "cameras": len(cameras), "interference": interference,
            "largest_group": max(sizes), "stopped": stopped,
            "matched_from_true_root_mm": round(float(np.mean(matched_mm)), 1),
            "fitted_median_mm": round(float(np.median(fitted_mm)), 1),
            f"fitted_over_{_WRONG_MM}_mm": int(wrong.sum()),
            "wrong": np.flatnonzero(wrong).tolist(),
        })  # fmt: skip
    return rows


def _pinholes(cameras: tuple[int, ...]) -> Rig:
    return Rig(tuple(demo_rig(8).cameras[number - 1].pinhole() for number in cameras))


def _silhouettes(model: BodyModel, pose: Pose, views: PinholeViews) -> FrameObservation:
    """Silhouettes without errors, and their hull."""
    vertices, masks = posed_mesh(model, pose), []
    for camera in views.rig:
        seen = vertices @ camera.rotation.T + camera.translation
        parts = render_parts(seen, model.faces, model.face_part, camera.matrix, camera.size)[0]
        masks.append(parts > 0)
    grid = VoxelGrid.from_bounds(vertices.min(0) - 0.1, vertices.max(0) + 0.1, CARVING.voxel_m)
    return FrameObservation(views, masks, grid, carve(views.rig, masks, grid))


def _landmarks(model: BodyModel, pose: Pose) -> np.ndarray:
    placed = place(model, pose.root_m[None], pose.root_rotation[None], pose.angles_rad[None])
    return landmarks(model, *placed)[0]


def _error_mm(model: BodyModel, pose: Pose, true_m: np.ndarray) -> float:
    return 1000 * float(np.linalg.norm(_landmarks(model, pose) - true_m, axis=1).mean())


def main() -> None:
    """Prints the rows asked for."""
    for name in [name for name in EXAMPLES if len(sys.argv) == 1 or name in sys.argv]:
        for grown_m in (0.0, _GROWN_M):
            print(json.dumps(fitted(name, grown_m)), flush=True)
    for name in ("robot_arm", "quadruped"):
        if len(sys.argv) == 1 or f"track_{name}" in sys.argv:
            for recorded in (False, True):
                for number in range(1, 5):
                    print(json.dumps(tracked(name, f"cam_{number}", recorded)), flush=True)
    if len(sys.argv) == 1 or "quadruped" in sys.argv:
        for cameras in (("cam_1", "cam_2", "cam_3", "cam_4"), ("cam_1", "cam_3")):
            for row in single_frames(cameras):
                print(json.dumps(row), flush=True)
    if len(sys.argv) == 1 or "spider" in sys.argv:
        for cameras in ((), ("cam_1", "cam_2", "cam_4"), ("cam_1", "cam_3")):
            for interference in (True, False):
                row = fitted("spider", interference=interference, cameras=cameras)
                print(json.dumps(row), flush=True)
        for numbers in ((1, 2, 3, 4), (1, 2, 4), (1, 3)):
            for row in stances(numbers):
                print(json.dumps(row), flush=True)


if __name__ == "__main__":
    main()
