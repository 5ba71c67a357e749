"""Files of every format that the project reads, small and valid, and what is done with each.

A target makes its files in an empty folder with the project's own writers, and is then run on that
folder after one of the files was mutated: it reads the file and works with what was read, as the
commands do. Thorough runs, one in a hundred, are the commands themselves.
"""

import contextlib
import io
import json
import subprocess
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from benchmarks import calibration_fuzz_targets as calibrations
from benchmarks import library_fuzz_targets as libraries
from benchmarks import rig_fuzz_targets as rigs
from benchmarks.mutations import (
    Mutation,
    any_arrays,
    any_bytes,
    any_json,
    any_library,
    any_table,
    any_text,
)
from benchmarks.scene import ring, silhouettes
from calib.camera import Rig
from calib.errors import InputError
from calib.files import read_rig, write_rig
from calib.files.anipose import read_up
from silhouette_core.body.joints import LANDMARK_NAMES
from silhouette_core.body.model import BodyModel
from silhouette_core.body.sizes import BodySizes
from silhouette_core.estimator import Estimate, Settings
from silhouette_core.motion.conditioning import Conditioning, conditioned
from silhouette_core.motion.keyposes.notation import movements
from silhouette_core.motion.keyposes.perform import perform
from silhouette_core.motion.motion import Motion

_FRAMES = 12


@dataclass(frozen=True)
class FuzzTarget:
    """A reader and what stands behind it.

    Attributes:
        make: writes the files into an empty folder.
        mutations: how each mutated file is mutated, by its path in the folder.
        run: reads the folder and works with it; whether thoroughly.
    """

    make: Callable[[Path], None]
    mutations: dict[str, Mutation]
    run: Callable[[Path, bool], None]


def command(*words: str | Path) -> None:
    """Runs a command in this process.

    Raises:
        InputError: it ended with exit code 2; what it printed.
        RuntimeError: it ended with another code than 0.
    """
    from voxelpose.cli import run

    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()) as said,
    ):
        try:
            code = run([str(word) for word in words])
        except SystemExit as ended:
            code = ended.code
    if code == 2:
        raise InputError(said.getvalue().strip())
    if code not in (0, None):
        raise RuntimeError(f"exit code {code}: {said.getvalue()}")


@cache
def _rig() -> Rig:
    lenses = [(0.1, -0.05, 0.001, -0.002, 0.01), ()]
    return Rig(
        tuple(
            replace(camera, distortion=np.array(lens))
            for camera, lens in zip(ring(2, (320, 240)), lenses, strict=True)
        )
    )


@cache
def _motion() -> Motion:
    model = BodyModel.from_sizes(BodySizes(1.75))
    motion = perform(movements()["wave"], model).select(slice(0, 2 * _FRAMES, 2))
    frames = np.arange(_FRAMES)
    quality = {
        "part_overlap": np.full((_FRAMES, len(model.names)), 0.9),
        "part_unsupported": np.zeros((_FRAMES, len(model.names)), bool),
        "outline_agreement": np.full(_FRAMES, 0.85),
        "camera_agreement": np.full((_FRAMES, 2), 0.85),
        "joint_error_mm": np.full((_FRAMES, len(LANDMARK_NAMES)), 30.0),
        "landmark_confidence": np.full((_FRAMES, len(LANDMARK_NAMES)), 0.8),
        "right_probability": np.full(_FRAMES, 0.9),
        "unexplained": np.full(_FRAMES, 0.1),
    }
    return replace(motion, fps=25.0, frames=frames, time_s=frames / 25, quality=quality)


def _make_rig(folder: Path, name: str, style: str | None = None, pinhole: bool = False) -> None:
    rig = Rig(tuple(camera.pinhole() for camera in _rig())) if pinhole else _rig()
    notes = {"up": "z", "about": "a note"} if name.endswith("toml") else None
    write_rig(rig, folder / name, style, notes)


def _use_rig(folder: Path, thorough: bool, name: str) -> None:
    if thorough:
        out, picture = folder / "out.toml", folder / "rig.png"
        command("calibrate", "convert", folder / name, out, "--overwrite", "--picture", picture)
        return
    rig = read_rig(folder / name)
    read_up(folder / name)
    _use_cameras(rig)
    write_rig(rig, folder / "out.toml")


def _use_cameras(rig: Rig) -> None:
    for camera in rig:
        camera.project(np.array([[0, 0, 1.0], [0.5, 0.2, 1.7]]))
        camera.rays(np.array([[0.0, 0.0], [100.0, 50.0]]))


def _rig_target(name: str, mutation: Mutation, **options) -> FuzzTarget:
    make = partial(_make_rig, name=name, **options)
    return FuzzTarget(make, {name: mutation}, partial(_use_rig, name=name))


def _use_foreign(folder: Path, thorough: bool, name: str, unit: str = "m") -> None:
    """Reads a calibration that may lack unit, size and positions."""
    path = folder / name
    if thorough:
        command("calibrate", "convert", path, folder / "out.toml", "--overwrite", "--unit", unit)
        return
    for lenses in (True, False):
        rig = read_rig(path, unit, (1280, 720), lenses=lenses)
        _use_cameras(rig)
    write_rig(rig, folder / "out.toml")


def _use_lens(folder: Path, thorough: bool) -> None:
    """Reads a lens without a position."""
    _use_cameras(read_rig(folder / "rig.json", size=(1280, 720), lenses=True))


def _foreign(
    make: Callable[[Path], None], name: str, mutation: Mutation, unit: str = "m"
) -> FuzzTarget:
    return FuzzTarget(make, {name: mutation}, partial(_use_foreign, name=name, unit=unit))


def _make_folder(folder: Path) -> None:
    (folder / "cameras").mkdir()
    for camera in _rig():
        write_rig(Rig((camera,)), folder / "all.yml")
        text = (folder / "all.yml").read_text().replace(f"{camera.name}:\n", "")
        (folder / "cameras" / f"{camera.name}.yml").write_text(text.replace("\n   ", "\n"))


def _make_points(folder: Path) -> None:
    rng = np.random.default_rng(0)
    lines = ["camera,point,x_px,y_px,x_m,y_m,z_m"]
    for number, place in enumerate(rng.uniform(-0.5, 0.5, (12, 3))):
        for camera in _rig():
            x, y = camera.project(place[None])[0][0]
            metres = ",".join(f"{value:.4f}" for value in place) if number < 6 else ",,"
            lines.append(f"{camera.name},p{number},{x:.2f},{y:.2f},{metres}")
    (folder / "points.csv").write_text("\n".join(lines) + "\n")


def _use_points(folder: Path, thorough: bool) -> None:
    from calib.points import read_points

    read_points(folder / "points.csv")


def _make_bvh(folder: Path) -> None:
    from voxelpose.export.bvh import write_bvh

    write_bvh(_motion(), folder / "clip.bvh")


def _make_expmap(folder: Path) -> None:
    motion, model = _motion(), _motion().model
    parents = model.tree.parents.tolist()
    joints = model.joints_m * 100
    offsets = [joints[k] - (joints[p] if p >= 0 else 0) for k, p in enumerate(parents)]
    skeleton = {
        "parent": parents,
        "offset": np.array(offsets).round(3).tolist(),
        "fps": 25.0,
        "names": list(model.names),
        "root_scale": 1.0,
    }
    (folder / "skeleton.json").write_text(json.dumps(skeleton))
    turns = np.random.default_rng(0).normal(0, 0.1, (len(motion), 3 * len(parents)))
    rows = np.column_stack([motion.root_m * 100, turns])
    np.savetxt(folder / "clip.csv", rows, "%.5f", ",")


def _use_clip(folder: Path, thorough: bool, name: str) -> None:
    from silhouette_core.motion.mocap.load import load_motions

    for motion in load_motions([folder / name], _motion().model):
        motion.landmarks()


def _make_estimate(folder: Path) -> None:
    from voxelpose.export.tables import write_joints
    from voxelpose.export.trc import write_trc
    from voxelpose.recording.truth import write_truth

    motion = _motion()
    write_joints(motion, folder / "joints.csv")
    write_truth(folder / "truth.json", motion.landmarks(), 25.0, 1.75)
    write_trc(motion, folder / "truth.trc")
    write_joints(motion, folder / "truth.csv")


def _use_estimate(folder: Path, thorough: bool, truth: str) -> None:
    from voxelpose.evaluation import evaluate, markdown_table

    if thorough:
        command("evaluate", folder / "joints.csv", "--truth", folder / truth)
        return
    markdown_table({"a": evaluate(folder / "joints.csv", folder / truth)})


def _make_subject(folder: Path) -> None:
    text = 'stature = 1.75\nchest_girth = 0.98\nsex = "female"\nbody = "body.npz"\n'
    text += 'name = "S07"\ndate = 2026-11-28\nremarks = "barefoot"\n'
    (folder / "subject.toml").write_text(text)
    (folder / "body.npz").write_bytes(b"")


def _use_subject(folder: Path, thorough: bool) -> None:
    from voxelpose.recording.subject import read_subject

    subject = read_subject(folder / "subject.toml")
    if subject.stature_m is not None:
        BodySizes(subject.stature_m, subject.chest_girth_m, subject.sex)


def _make_recording_file(folder: Path) -> None:
    text = "cam_0 = [[[10, 20], [100.5, 20], [100, 80]], [[0, 0], [9, 0], [9, 9], [0, 9]]]"
    (folder / "recording.toml").write_text(f"[unknown]\n{text}\ncam_1 = []\n")


def _use_recording_file(folder: Path, thorough: bool) -> None:
    from voxelpose.recording.unknown_places import painted_mask, unknown_polygons

    for name, polygons in unknown_polygons(folder / "recording.toml", _rig().names).items():
        painted_mask(polygons, _rig()[name].size)


def _make_region(folder: Path) -> None:
    from voxelpose.setup_page.drawn_places import write_region
    from voxelpose.setup_page.page_requests import RegionDrawing

    drawing = RegionDrawing(True, [[(5.0, 5.0), (60.5, 5.0), (30.0, 40.2)]])
    write_region(folder, "cam_0", drawing, None, (64, 48))


def _use_region(folder: Path, thorough: bool) -> None:
    from voxelpose.recording.frame_reader import read_still
    from voxelpose.setup_page.drawn_places import read_regions

    image = read_still(folder / "regions" / "cam_0.png")
    read_regions(folder, {"cam_0": image.max(axis=2) > 127})


def _make_folder_settings(folder: Path) -> None:
    text = (
        '[fit]\nstature = 1.75\nout = "x"\nsex = "female"\nbody = "92A5"\n'
        '[calibrate.board]\npaper = "a3"\n[live]\nsend = ["vmc://a:1"]\n'
        "[carve]\nvolume = [0, 0, 0, 1, 1, 1]\n"
    )
    (folder / "voxelpose.toml").write_text(text)


def _use_folder_settings(folder: Path, thorough: bool) -> None:
    from voxelpose.cli.options import folder_settings, sections_in

    if thorough:
        command("settings", folder)
        return
    for section in sections_in(folder):
        folder_settings(section, folder)


def _make_timestamps(folder: Path) -> None:
    from voxelpose.recording.timestamps import write_timestamps

    times = {"cam_0": np.arange(30) / 25, "cam_1": np.arange(30) / 25 + 0.003}
    write_timestamps(folder / "timestamps.csv", times)


def _use_timestamps(folder: Path, thorough: bool) -> None:
    from voxelpose.recording.frame_reader import FrameReader
    from voxelpose.recording.timestamps import match_frames, read_timestamps

    path = folder / "timestamps.csv"
    reader = FrameReader(folder, (), (320, 240), 30, 25.0)
    match_frames(read_timestamps(path, {"cam_0": reader, "cam_1": reader})[0], path)


def _make_video(folder: Path, name: str) -> None:
    import imageio_ffmpeg

    coded = ["-vf", "select='not(between(n,4,6))'", "-fps_mode", "passthrough", "-bf", "2"]
    writer = imageio_ffmpeg.write_frames(
        str(folder / name), (64, 48), fps=25, output_params=coded, macro_block_size=1
    )
    writer.send(None)
    for grey in range(12):
        writer.send(np.full((48, 64, 3), grey, np.uint8))
    writer.close()


def _use_video(folder: Path, thorough: bool, name: str) -> None:
    from voxelpose.recording.ffmpeg import coded_pictures
    from voxelpose.recording.timestamps import even_numbers

    coded = coded_pictures(folder / name)
    times_s = coded.shown_s
    if times_s is not None:
        numbers, _ = even_numbers(times_s)
        assert len(numbers) == coded.count
        assert np.isfinite(times_s).all()
        assert (np.diff(numbers) > 0).all()


def _make_image(folder: Path, name: str) -> None:
    image = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    (folder / name).write_bytes(cv2.imencode(Path(name).suffix, image)[1].tobytes())


def _use_image(folder: Path, thorough: bool, name: str) -> None:
    from voxelpose.recording.frame_reader import FrameReader

    for frame in FrameReader.open(folder / name):
        frame.mean()


def _make_film(folder: Path, cover: bool) -> None:
    """Two chapters of a film; or a film behind a still picture, as its file's second track."""
    import imageio_ffmpeg

    (folder / "cam_0").mkdir()
    if not cover:
        for chapter in (1, 2):
            _make_video(folder, f"cam_0/GX0{chapter}0012.mp4")
        return
    _make_video(folder, "film.mov")
    _make_image(folder, "cover.png")
    words = ["-loglevel", "error", "-i", folder / "cover.png", "-i", folder / "film.mov"]
    words += ["-map", "0:v", "-map", "1:v", "-c", "copy", folder / "cam_0.mov"]
    subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), *words], check=True)


def _use_film(folder: Path, thorough: bool, name: str) -> None:
    from voxelpose.recording.chapters import open_camera

    for frame in open_camera(folder / name):
        frame.mean()


def _make_images(folder: Path, turned: bool) -> None:
    """Three images, one of which EXIF data turn; or whose opacity is a person's silhouette."""
    (folder / "cam_0").mkdir()
    for number in range(3):
        layers = np.random.default_rng(number).integers(0, 255, (48, 64, 4), np.uint8)
        layers[..., 3] = 0
        layers[10:40, 8 * number + 8 : 8 * number + 24, 3] = 255
        path, exif = folder / "cam_0" / f"{number}.{'jpg' if turned else 'png'}", Image.Exif()
        exif[0x0112] = 6 if number == 1 else 1
        Image.fromarray(layers[..., :3] if turned else layers).save(path, exif=exif)


def _use_images(folder: Path, thorough: bool) -> None:
    from voxelpose.recording.frame_reader import FrameReader
    from voxelpose.recording.mask_labels import cut_outs

    reader = FrameReader.open(folder / "cam_0")
    for frame in cut_outs({"cam_0": reader})[0].get("cam_0", reader):
        frame.mean()


def _make_image_names(folder: Path) -> None:
    """Names of the images of some cameras, which tell numbers and times in several ways."""
    forms = (
        lambda n: f"cam1_{n:04d}",
        lambda n: f"{1_700_000_000.35 + n / 30:.6f}",
        lambda n: f"{n}_2024-01-01T11-59-59.{33_333 * n:06d}+0200",
        lambda n: f"IMG_20240101_1159{n // 9 + 58}_{111 * (n % 9):03d}",
        lambda n: f"{n // 9}-{111_000_000 * (n % 9)}",
        lambda n: f"f_{n + 4:x}",
        lambda n: f"{1_700_000_000_000_000_000 + 33_000_000 * n}",
    )
    names = ["\n".join(map(form, range(_FRAMES))) for form in forms]
    (folder / "names.txt").write_text("\n\n".join(names))


def _use_image_names(folder: Path, thorough: bool) -> None:
    from voxelpose.recording.image_names import in_order, names_by_camera

    listed = (folder / "names.txt").read_text("utf-8", "replace").split("\n\n")
    # As long as file systems allow.
    cameras = {str(k): [n[:200] for n in names.splitlines()] for k, names in enumerate(listed)}
    ordered = {
        name: in_order([folder / "names.txt" / f"{stem}.png" for stem in stems])
        for name, stems in cameras.items()
        if stems
    }
    for name, paths in ordered.items():
        with contextlib.suppress(InputError):  # others may tell more
            names_by_camera({name: paths})
    names_by_camera(ordered)


def _make_masks(folder: Path, name: str) -> None:
    (folder / "masks" / "cam_0").mkdir(parents=True)
    for number in range(3):
        mask = np.zeros((48, 64), np.uint8)
        mask[10:40, 8 * number + 8 : 8 * number + 24] = 1
        alpha = np.dstack([mask * 90, mask * 7, mask * 200, mask * 255])
        picture = {"rgba": alpha, "float": mask.astype(np.float32)}.get(name, mask)
        suffix = ".tiff" if name == "float" else ".png"
        coded = cv2.imencode(suffix, picture)[1].tobytes()
        path = folder / "masks" / "cam_0" / f"{number}{suffix}"
        path.write_bytes(coded)
        if name == "palette":
            image = Image.fromarray(mask, "P")
            image.putpalette([0, 0, 0, 128, 0, 0])
            image.save(path)


def _use_masks(folder: Path, thorough: bool) -> None:
    from voxelpose.recording.mask_labels import open_masks
    from voxelpose.recording.masks import painted

    (path,) = (folder / "masks").iterdir()
    painted(sorted(path.iterdir())[1])
    for frame in open_masks({"cam_0": path})[0]["cam_0"]:
        frame.mean()


def _make_hypotheses(folder: Path) -> None:
    from voxelpose.export.tables import write_hypotheses

    joints = _motion().landmarks()
    poses = [(k, np.array([0.7, 0.3]), joints[[k, 0]]) for k in range(_FRAMES)]
    write_hypotheses(poses, folder / "hypotheses.csv")


def _use_hypotheses(folder: Path, thorough: bool) -> None:
    from voxelpose.export.tables import read_hypotheses

    read_hypotheses(folder / "hypotheses.csv")


def _make_names(folder: Path) -> None:
    from silhouette_core.motion.mocap.names import NEEDED

    lines = [f'{role} = ["{role}", "Other"]' for role in NEEDED]
    (folder / "names.toml").write_text("\n".join([*lines, 'toes = "{left}_toes"']) + "\n")


def _use_names(folder: Path, thorough: bool) -> None:
    from silhouette_core.motion.mocap.names import find_roles

    find_roles("clip.bvh", _motion().model.names, folder / "names.toml")


def _make_list(folder: Path) -> None:
    for name in ("one", "two"):
        (folder / name).mkdir()
        write_rig(_rig(), folder / name / "calibration.toml")
    text = "[settings]\nstature = 1.8\nsmooth = false\n"
    text += '[[recording]]\nfolder = "one"\nframes = "0:9"\n'
    text += '[[recording]]\nfolder = "two"\nname = "second"\ncommand = "track"\n'
    (folder / "list.toml").write_text(text)


def _use_list(folder: Path, thorough: bool) -> None:
    from voxelpose.batch.jobs import jobs_of

    jobs_of([folder / "list.toml"], "fit", {})


@cache
def _recorded() -> tuple:
    """Estimate and settings of a result."""
    stages = {"silhouettes": np.full(_FRAMES, 0.01), "search": np.array([0.5])}
    facts = {"voxel_size_m": 0.03, "half_turn_ratio": 2.5, "seams_mm": [12.0, None], "note": "a"}
    settings = Settings(stature_m=1.75, options={"voxel_size_m": 0.03, "tolerance": 0})
    seen = _motion().select(np.r_[0:5, 6:_FRAMES])
    return Estimate(conditioned(seen, Conditioning(gap_limit=2)), stages, facts), settings


def _make_result(folder: Path) -> None:
    from voxelpose.fitting import Output, write_estimate
    from voxelpose.recording.folder import Recording

    place = folder / "recording"
    for camera, mask in zip(_rig(), silhouettes(_rig()), strict=True):
        (place / camera.name).mkdir(parents=True)
        for number in range(_FRAMES):
            picture = np.where(mask[..., None], np.uint8(200), np.uint8([60, 70, 50]))
            coded = cv2.imencode(".png", picture)[1].tobytes()
            (place / camera.name / f"{number:03}.png").write_bytes(coded)
    write_rig(_rig(), place / "calibration.toml")
    recording = Recording.open(place, fps=25.0)
    estimate, settings = _recorded()
    write_estimate(recording, Output(folder / "out", pictures=False), estimate, settings)


def _make_given(folder: Path) -> None:
    """A motion that holds its body: no person's."""
    from examples.bodies.example_motions import example_motion
    from silhouette_core.motion.motion_file import write_motion

    write_motion(example_motion("desk_lamp", 3), folder / "given.safetensors")


def _use_given(folder: Path, thorough: bool) -> None:
    from silhouette_core.motion.motion_file import read_motion
    from voxelpose.export.formats import export_motion

    motion = read_motion(folder / "given.safetensors")
    motion.landmark_confidence()
    export_motion(motion, folder / "exported", ("bvh", "trc", "csv"), overwrite=True)


def _export(folder: Path) -> None:
    from voxelpose.export.formats import export_motion

    export_motion(_motion(), folder, ("npz",), overwrite=True)


def _use_motion(folder: Path, thorough: bool) -> None:
    from silhouette_core.motion.motion_file import read_motion
    from voxelpose.export.formats import export_motion

    out = folder / "exported"
    if thorough:
        command("export", folder / "out", "--out", out, "--overwrite")
        return
    motion = read_motion(folder / "out" / "motion.safetensors")
    motion.landmark_confidence()
    if len(motion):
        export_motion(motion, out, ("bvh", "trc", "csv"), overwrite=True)


def _use_result(folder: Path, thorough: bool) -> None:
    from voxelpose.batch.batch_tables import _lines  # the table of a batch
    from voxelpose.batch.jobs import Job
    from voxelpose.batch.run import Outcome
    from voxelpose.cli.summary import print_result
    from voxelpose.reliability import findings_of
    from voxelpose.report.page import _settings_table, _stages
    from voxelpose.report.verdict import headline
    from voxelpose.results import Result

    if thorough:
        command("report", folder / "out", "--overwrite")
        return
    result = Result.open(folder / "out")
    with contextlib.redirect_stdout(io.StringIO()):
        print_result(result)
    headline(result, findings_of(result.summary, result.motion)), _stages(result.summary["seconds"])
    _settings_table(result.settings)
    outcome = Outcome(Job("a", "b", "fit", {}), "done", "", 1.0, result.summary, {})
    _lines(outcome)


def _use_scenes(folder: Path, thorough: bool) -> None:
    from voxelpose.view.viewer.result_scenes import ResultScenes

    _use_result(folder, thorough)
    scenes = ResultScenes(folder / "out")
    try:
        if len(scenes.frames):
            scenes.bodies(int(scenes.frames[0]))
    finally:
        scenes.close()


def _make_library(folder: Path, learned: bool) -> None:
    libraries.make_library(folder / "me.vplib", _motion().model, learned=learned)


def _use_library(folder: Path, thorough: bool) -> None:
    path = folder / "me.vplib"
    if thorough:
        command("library", "info", path, "--png", folder / "sheet.png")
    else:
        libraries.use_library(path)


def _result(mutations: dict[str, Mutation], use: Callable[[Path, bool], None]) -> FuzzTarget:
    return FuzzTarget(_make_result, {f"out/{name}": one for name, one in mutations.items()}, use)


def _video(kind: str) -> FuzzTarget:
    name = f"a.{kind}"
    make, use = partial(_make_video, name=name), partial(_use_video, name=name)
    return FuzzTarget(make, {name: any_bytes}, use)


def _use_scan(folder: Path, thorough: bool) -> None:
    """Reads a scan as `evaluate --scan` does."""
    from voxelpose.scan_distance import read_scan

    read_scan(folder / "part.ply", "m", body_m=0.4)


def _urdf(mesh: str) -> FuzzTarget:
    mutations = {"arm.urdf": any_text, f"part.{mesh}": any_bytes if mesh == "stl" else any_text}
    make = partial(rigs.write_urdf, mesh=mesh)
    return FuzzTarget(make, mutations, partial(rigs.use_rig, name="arm.urdf"))


TARGETS: dict[str, FuzzTarget] = {
    "calibration-toml": _rig_target("rig.toml", any_text),
    "calibration-json": _rig_target("rig.json", any_json),
    "projections": _rig_target("rig.json", any_json, style="projections", pinhole=True),
    "qualisys": _rig_target("rig.txt", any_text),
    "opencv-yaml": _rig_target("rig.yml", any_text),
    "opencv-xml": _rig_target("rig.xml", any_text),
    "opencv-json": _rig_target("rig.json", any_json, style="opencv"),
    "opencv-folder": FuzzTarget(
        _make_folder, {"cameras/cam_0.yml": any_text}, partial(_use_rig, name="cameras")
    ),
    "easymocap": FuzzTarget(
        partial(_make_rig, name="easymocap"),
        {"easymocap/intri.yml": any_text, "easymocap/extri.yml": any_text},
        partial(_use_rig, name="easymocap"),
    ),
    "colmap": FuzzTarget(
        calibrations.write_colmap,
        {"model/cameras.txt": any_text, "model/images.txt": any_text},
        partial(_use_foreign, name="model"),
    ),
    "nerfstudio": _foreign(calibrations.write_nerfstudio, "rig.json", any_json),
    "metashape": _foreign(calibrations.write_metashape, "rig.xml", any_text),
    "theia": _foreign(calibrations.write_theia, "rig.txt", any_text, "mm"),
    "vicon": _foreign(calibrations.write_vicon, "rig.xcp", any_text, "mm"),
    "kinect": FuzzTarget(calibrations.write_kinect, {"rig.json": any_json}, _use_lens),
    "opencap": _foreign(calibrations.write_opencap, "rig.json", any_json, "mm"),
    "dannce": _foreign(calibrations.write_dannce, "rig.mat", any_bytes, "mm"),
    "points": FuzzTarget(_make_points, {"points.csv": any_table}, _use_points),
    "bvh": FuzzTarget(_make_bvh, {"clip.bvh": any_text}, partial(_use_clip, name="clip.bvh")),
    "exponential-map": FuzzTarget(
        _make_expmap,
        {"clip.csv": any_table, "skeleton.json": any_json},
        partial(_use_clip, name="clip.csv"),
    ),
    "trc": FuzzTarget(
        _make_estimate, {"truth.trc": any_text}, partial(_use_estimate, truth="truth.trc")
    ),
    "joints": FuzzTarget(
        _make_estimate, {"joints.csv": any_table}, partial(_use_estimate, truth="truth.json")
    ),
    "truth-table": FuzzTarget(
        _make_estimate, {"truth.csv": any_table}, partial(_use_estimate, truth="truth.csv")
    ),
    "truth": FuzzTarget(
        _make_estimate, {"truth.json": any_json}, partial(_use_estimate, truth="truth.json")
    ),
    "subject": FuzzTarget(_make_subject, {"subject.toml": any_text}, _use_subject),
    "recording-file": FuzzTarget(
        _make_recording_file, {"recording.toml": any_text}, _use_recording_file
    ),
    "drawn-region": FuzzTarget(_make_region, {"regions/cam_0.png": any_bytes}, _use_region),
    "folder-settings": FuzzTarget(
        _make_folder_settings, {"voxelpose.toml": any_text}, _use_folder_settings
    ),
    "hypotheses": FuzzTarget(_make_hypotheses, {"hypotheses.csv": any_table}, _use_hypotheses),
    "joint-names": FuzzTarget(_make_names, {"names.toml": any_text}, _use_names),
    "batch-list": FuzzTarget(_make_list, {"list.toml": any_text}, _use_list),
    "timestamps": FuzzTarget(_make_timestamps, {"timestamps.csv": any_table}, _use_timestamps),
    "image-names": FuzzTarget(_make_image_names, {"names.txt": any_text}, _use_image_names),
    "chapters": FuzzTarget(
        partial(_make_film, cover=False),
        {"cam_0/GX020012.mp4": any_bytes},
        partial(_use_film, name="cam_0"),
    ),
    "film-track": FuzzTarget(
        partial(_make_film, cover=True),
        {"cam_0.mov": any_bytes},
        partial(_use_film, name="cam_0.mov"),
    ),
    "exif": FuzzTarget(partial(_make_images, turned=True), {"cam_0/1.jpg": any_bytes}, _use_images),
    "alpha": FuzzTarget(
        partial(_make_images, turned=False), {"cam_0/1.png": any_bytes}, _use_images
    ),
    "times-mov": _video("mov"),
    "times-mkv": _video("mkv"),
    "times-avi": _video("avi"),
    **{
        name: FuzzTarget(
            partial(_make_image, name=f"a.{name}"),
            {f"a.{name}": any_bytes},
            partial(_use_image, name=f"a.{name}"),
        )
        for name in ("png", "jpg", "bmp", "tiff", "webp")
    },
    **{
        f"masks-{name}": FuzzTarget(
            partial(_make_masks, name=name),
            {f"masks/cam_0/1.{'tiff' if name == 'float' else 'png'}": any_bytes},
            _use_masks,
        )
        for name in ("label", "rgba", "palette", "float")
    },
    "rig-bvh": FuzzTarget(
        rigs.write_bvh_rig,
        {"leg.bvh": any_text, "leg.rig.toml": any_text},
        partial(rigs.use_rig, name="leg.bvh"),
    ),
    "rig-gltf": FuzzTarget(
        rigs.write_gltf, {"box.gltf": any_json}, partial(rigs.use_rig, name="box.gltf")
    ),
    "rig-glb": FuzzTarget(
        rigs.write_box_glb, {"box.glb": any_bytes}, partial(rigs.use_rig, name="box.glb")
    ),
    "rig-urdf-stl": _urdf("stl"),
    "rig-urdf-obj": _urdf("obj"),
    "rig-urdf-dae": _urdf("dae"),
    "rig-urdf-ply": _urdf("ply"),
    "scan": FuzzTarget(partial(rigs.write_urdf, mesh="ply"), {"part.ply": any_bytes}, _use_scan),
    "rig-makehuman": FuzzTarget(
        rigs.write_makehuman,
        {
            "body.toml": any_text,
            "data/3dobjs/base.obj": any_text,
            "data/rigs/standard/rig.two.json": any_json,
            "data/rigs/standard/weights.two.json": any_json,
            "data/targets/macrodetails/caucasian-male-young.target": any_text,
        },
        partial(rigs.use_rig, name="body.toml"),
    ),
    "motion": _result({"motion.safetensors": any_arrays}, _use_motion),
    "export-record": FuzzTarget(
        _export, {"export.json": any_json}, lambda folder, _: _export(folder)
    ),
    "given-body": FuzzTarget(_make_given, {"given.safetensors": any_arrays}, _use_given),
    "summary": _result({"summary.json": any_json}, _use_result),
    "settings": _result({"settings.toml": any_text}, _use_scenes),
    "library": FuzzTarget(
        partial(_make_library, learned=True), {"me.vplib": any_library}, _use_library
    ),
    "library-without-proposal": FuzzTarget(
        partial(_make_library, learned=False), {"me.vplib": any_library}, _use_library
    ),
}
