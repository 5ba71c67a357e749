"""Files of every format that the project reads, small and valid, and what is done with each.

A target makes its files in an empty folder with the project's own writers. After one of them was
mutated it reads it and works with what was read, as the commands do. Thorough runs, one in a
hundred, are the commands themselves.
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
_REPORT = "report {path} --overwrite"
_CONVERT = "calibrate convert {path} {folder}/out.toml --overwrite"


@dataclass(frozen=True)
class FuzzTarget:
    """A reader and what stands behind it."""

    opened: str  #: the file or folder that is read, by its path in an empty folder.
    make: Callable[[Path], object]  #: writes it, and what lies beside it.
    use: Callable[[Path], object]  #: reads it and works with it.
    mutated: tuple[str, ...] = ()  #: the files that are mutated; none: what is opened.
    command: str = ""  #: a thorough run, with {path} and {folder}; "": as any other.

    @property
    def files(self) -> tuple[str, ...]:
        """The files that are mutated."""
        return self.mutated or (self.opened,)

    def run(self, folder: Path, thorough: bool) -> None:
        """Reads what was made in a folder. InputError or RuntimeError as of `run_command`."""
        path = folder / self.opened
        if thorough and self.command:
            run_command(*self.command.format(path=path, folder=folder).split())
        else:
            self.use(path)


def run_command(*words: str) -> None:
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
            code = run(words)
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


def _make_rig(path: Path, style: str | None = None, pinhole: bool = False) -> None:
    rig = Rig(tuple(camera.pinhole() for camera in _rig())) if pinhole else _rig()
    write_rig(rig, path, style, {"up": "z", "about": "a note"} if path.suffix == ".toml" else None)


def _use_rig(path: Path) -> None:
    rig = read_rig(path)
    read_up(path)
    _use_cameras(rig)
    write_rig(rig, path.with_name("out.toml"))


def _use_cameras(rig: Rig) -> None:
    for camera in rig:
        camera.project(np.array([[0, 0, 1.0], [0.5, 0.2, 1.7]]))
        camera.rays(np.array([[0.0, 0.0], [100.0, 50.0]]))


def _calibration(opened: str, *mutated: str, **options) -> FuzzTarget:
    """A calibration that is written, too."""
    make = partial(_make_rig, **options)
    command = f"{_CONVERT} --picture {{folder}}/rig.png"
    return FuzzTarget(opened, make, _use_rig, mutated, command)


def _use_foreign(path: Path, unit: str) -> None:
    """Reads a calibration that may lack unit, size and positions."""
    for lenses in (True, False):
        rig = read_rig(path, unit, (1280, 720), lenses=lenses)
        _use_cameras(rig)
    write_rig(rig, path.with_name("out.toml"))


def _foreign(
    opened: str, make: Callable[[Path], object], *mutated: str, unit: str = "m"
) -> FuzzTarget:
    use = partial(_use_foreign, unit=unit)
    return FuzzTarget(opened, make, use, mutated, f"{_CONVERT} --unit {unit}")


def _use_lens(path: Path) -> None:
    """Reads a lens without a position."""
    _use_cameras(read_rig(path, size=(1280, 720), lenses=True))


def _make_folder(path: Path) -> None:
    path.mkdir()
    for camera in _rig():
        own = path / f"{camera.name}.yml"
        write_rig(Rig((camera,)), own)
        text = own.read_text().replace(f"{camera.name}:\n", "")
        own.write_text(text.replace("\n   ", "\n"))


def _make_points(path: Path) -> None:
    rng = np.random.default_rng(0)
    lines = ["camera,point,x_px,y_px,x_m,y_m,z_m"]
    for number, place in enumerate(rng.uniform(-0.5, 0.5, (12, 3))):
        for camera in _rig():
            x, y = camera.project(place[None])[0][0]
            metres = ",".join(f"{value:.4f}" for value in place) if number < 6 else ",,"
            lines.append(f"{camera.name},p{number},{x:.2f},{y:.2f},{metres}")
    path.write_text("\n".join(lines) + "\n")


def _use_points(path: Path) -> None:
    from calib.points import read_points

    read_points(path)


def _make_bvh(path: Path) -> None:
    from voxelpose.export.bvh import write_bvh

    write_bvh(_motion(), path)


def _make_expmap(path: Path) -> None:
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
    path.with_name("skeleton.json").write_text(json.dumps(skeleton))
    turns = np.random.default_rng(0).normal(0, 0.1, (len(motion), 3 * len(parents)))
    rows = np.column_stack([motion.root_m * 100, turns])
    np.savetxt(path, rows, "%.5f", ",")


def _use_clip(path: Path) -> None:
    from silhouette_core.motion.mocap.load import load_motions

    for motion in load_motions([path], _motion().model):
        motion.landmarks()


def _make_estimate(truth: Path) -> None:
    from voxelpose.export.tables import write_joints
    from voxelpose.export.trc import write_trc
    from voxelpose.recording.truth import write_truth

    motion = _motion()
    write_joints(motion, truth.with_name("joints.csv"))
    write_truth(truth.with_suffix(".json"), motion.landmarks(), 25.0, 1.75)
    write_trc(motion, truth.with_suffix(".trc"))
    write_joints(motion, truth.with_suffix(".csv"))


def _use_estimate(truth: Path) -> None:
    from voxelpose.evaluation import evaluate, markdown_table

    markdown_table({"a": evaluate(truth.with_name("joints.csv"), truth)})


def _estimate(truth: str, *mutated: str) -> FuzzTarget:
    command = "evaluate {folder}/joints.csv --truth {path}"
    return FuzzTarget(truth, _make_estimate, _use_estimate, mutated, command)


def _make_subject(path: Path) -> None:
    text = 'stature = 1.75\nchest_girth = 0.98\nsex = "female"\nbody = "body.npz"\n'
    text += 'name = "S07"\ndate = 2026-11-28\nremarks = "barefoot"\n'
    path.write_text(text)
    path.with_name("body.npz").write_bytes(b"")


def _use_subject(path: Path) -> None:
    from voxelpose.recording.subject import read_subject

    subject = read_subject(path)
    if subject.stature_m is not None:
        BodySizes(subject.stature_m, subject.chest_girth_m, subject.sex)


def _make_recording_file(path: Path) -> None:
    text = "cam_0 = [[[10, 20], [100.5, 20], [100, 80]], [[0, 0], [9, 0], [9, 9], [0, 9]]]"
    path.write_text(f"[unknown]\n{text}\ncam_1 = []\n")


def _use_recording_file(path: Path) -> None:
    from voxelpose.recording.unknown_places import painted_mask, unknown_polygons

    for name, polygons in unknown_polygons(path, _rig().names).items():
        painted_mask(polygons, _rig()[name].size)


def _make_region(path: Path) -> None:
    from voxelpose.setup_page.drawn_places import write_region
    from voxelpose.setup_page.page_requests import RegionDrawing

    drawing = RegionDrawing(True, [[(5.0, 5.0), (60.5, 5.0), (30.0, 40.2)]])
    write_region(path.parents[1], "cam_0", drawing, None, (64, 48))


def _use_region(path: Path) -> None:
    from voxelpose.recording.frame_reader import read_still
    from voxelpose.setup_page.drawn_places import read_regions

    read_regions(path.parents[1], {"cam_0": read_still(path).max(axis=2) > 127})


def _make_folder_settings(path: Path) -> None:
    text = (
        '[fit]\nstature = 1.75\nout = "x"\nsex = "female"\nbody = "92A5"\n'
        '[calibrate.board]\npaper = "a3"\n[live]\nsend = ["vmc://a:1"]\n'
        "[carve]\nvolume = [0, 0, 0, 1, 1, 1]\n"
    )
    path.write_text(text)


def _use_folder_settings(path: Path) -> None:
    from voxelpose.cli.options import folder_settings, sections_in

    for section in sections_in(path.parent):
        folder_settings(section, path.parent)


def _make_timestamps(path: Path) -> None:
    from voxelpose.recording.timestamps import write_timestamps

    write_timestamps(path, {f"cam_{k}": np.arange(30) / 25 + 0.003 * k for k in range(2)})


def _use_timestamps(path: Path) -> None:
    from voxelpose.recording.frame_reader import FrameReader
    from voxelpose.recording.timestamps import match_frames, read_timestamps

    reader = FrameReader(path.parent, (), (320, 240), 30, 25.0)
    match_frames(read_timestamps(path, {"cam_0": reader, "cam_1": reader})[0], path)


def _make_video(path: Path) -> None:
    import imageio_ffmpeg

    coded = ["-vf", "select='not(between(n,4,6))'", "-fps_mode", "passthrough", "-bf", "2"]
    writer = imageio_ffmpeg.write_frames(
        str(path), (64, 48), fps=25, output_params=coded, macro_block_size=1
    )
    writer.send(None)
    for grey in range(12):
        writer.send(np.full((48, 64, 3), grey, np.uint8))
    writer.close()


def _use_video(path: Path) -> None:
    from voxelpose.recording.ffmpeg import coded_pictures
    from voxelpose.recording.timestamps import even_numbers

    coded = coded_pictures(path)
    times_s = coded.shown_s
    if times_s is not None:
        numbers, _ = even_numbers(times_s)
        assert len(numbers) == coded.count
        assert np.isfinite(times_s).all()
        assert (np.diff(numbers) > 0).all()


def _make_image(path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    path.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())


def _use_camera(path: Path) -> None:
    """Reads the pictures of a camera."""
    from voxelpose.recording.chapters import open_camera

    for frame in open_camera(path):
        frame.mean()


def _make_chapters(path: Path) -> None:
    path.mkdir()
    for chapter in (1, 2):
        _make_video(path / f"GX0{chapter}0012.mp4")


def _make_film(path: Path) -> None:
    """A film behind a still picture, as its file's second track."""
    import imageio_ffmpeg

    film, cover = path.with_name("film.mov"), path.with_name("cover.png")
    _make_video(film)
    _make_image(cover)
    words = ["-loglevel", "error", "-i", cover, "-i", film, "-map", "0:v", "-map", "1:v"]
    words = [imageio_ffmpeg.get_ffmpeg_exe(), *words, "-c", "copy", path]
    subprocess.run(words, check=True)


def _make_images(path: Path, turned: bool) -> None:
    """Three images, one of which EXIF data turn; or whose opacity is a person's silhouette."""
    path.mkdir()
    for number in range(3):
        layers = np.random.default_rng(number).integers(0, 255, (48, 64, 4), np.uint8)
        layers[..., 3] = 0
        layers[10:40, 8 * number + 8 : 8 * number + 24, 3] = 255
        still, exif = path / f"{number}.{'jpg' if turned else 'png'}", Image.Exif()
        exif[0x0112] = 6 if number == 1 else 1
        Image.fromarray(layers[..., :3] if turned else layers).save(still, exif=exif)


def _use_images(path: Path) -> None:
    from voxelpose.recording.frame_reader import FrameReader
    from voxelpose.recording.mask_labels import cut_outs

    reader = FrameReader.open(path)
    for frame in cut_outs({"cam_0": reader})[0].get("cam_0", reader):
        frame.mean()


def _make_image_names(path: Path) -> None:
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
    path.write_text("\n\n".join(names))


def _use_image_names(path: Path) -> None:
    from voxelpose.recording.image_names import in_order, names_by_camera

    listed = path.read_text("utf-8", "replace").split("\n\n")
    # As long as file systems allow.
    cameras = {str(k): [n[:200] for n in names.splitlines()] for k, names in enumerate(listed)}
    ordered = {
        name: in_order([path / f"{stem}.png" for stem in stems])
        for name, stems in cameras.items()
        if stems
    }
    for name, paths in ordered.items():
        with contextlib.suppress(InputError):  # others may tell more
            names_by_camera({name: paths})
    names_by_camera(ordered)


def _make_masks(path: Path, kind: str) -> None:
    path.mkdir(parents=True)
    for number in range(3):
        mask = np.zeros((48, 64), np.uint8)
        mask[10:40, 8 * number + 8 : 8 * number + 24] = 1
        alpha = np.dstack([mask * 90, mask * 7, mask * 200, mask * 255])
        picture = {"rgba": alpha, "float": mask.astype(np.float32)}.get(kind, mask)
        suffix = ".tiff" if kind == "float" else ".png"
        still = path / f"{number}{suffix}"
        still.write_bytes(cv2.imencode(suffix, picture)[1].tobytes())
        if kind == "palette":
            image = Image.fromarray(mask, "P")
            image.putpalette([0, 0, 0, 128, 0, 0])
            image.save(still)


def _use_masks(path: Path) -> None:
    from voxelpose.recording.mask_labels import open_masks
    from voxelpose.recording.masks import painted

    painted(sorted(path.iterdir())[1])
    for frame in open_masks({"cam_0": path})[0]["cam_0"]:
        frame.mean()


def _make_hypotheses(path: Path) -> None:
    from voxelpose.export.tables import write_hypotheses

    joints = _motion().landmarks()
    poses = [(k, np.array([0.7, 0.3]), joints[[k, 0]]) for k in range(_FRAMES)]
    write_hypotheses(poses, path)


def _use_hypotheses(path: Path) -> None:
    from voxelpose.export.tables import read_hypotheses

    read_hypotheses(path)


def _make_names(path: Path) -> None:
    from silhouette_core.motion.mocap.names import NEEDED

    lines = [f'{role} = ["{role}", "Other"]' for role in NEEDED]
    path.write_text("\n".join([*lines, 'toes = "{left}_toes"']) + "\n")


def _use_names(path: Path) -> None:
    from silhouette_core.motion.mocap.names import find_roles

    find_roles("clip.bvh", _motion().model.names, path)


def _make_list(path: Path) -> None:
    for name in ("one", "two"):
        path.with_name(name).mkdir()
        write_rig(_rig(), path.with_name(name) / "calibration.toml")
    text = "[settings]\nstature = 1.8\nsmooth = false\n"
    text += '[[recording]]\nfolder = "one"\nframes = "0:9"\n'
    text += '[[recording]]\nfolder = "two"\nname = "second"\ncommand = "track"\n'
    path.write_text(text)


def _use_list(path: Path) -> None:
    from voxelpose.batch.jobs import jobs_of

    jobs_of([path], "fit", {})


@cache
def _recorded() -> tuple:
    """Estimate and settings of a result."""
    stages = {"silhouettes": np.full(_FRAMES, 0.01), "search": np.array([0.5])}
    facts = {"voxel_size_m": 0.03, "half_turn_ratio": 2.5, "seams_mm": [12.0, None], "note": "a"}
    settings = Settings(stature_m=1.75, options={"voxel_size_m": 0.03, "tolerance": 0})
    seen = _motion().select(np.r_[0:5, 6:_FRAMES])
    return Estimate(conditioned(seen, Conditioning(gap_limit=2)), stages, facts), settings


def _make_result(out: Path) -> None:
    from voxelpose.fitting import Output, write_estimate
    from voxelpose.recording.folder import Recording

    place = out.with_name("recording")
    for camera, mask in zip(_rig(), silhouettes(_rig()), strict=True):
        (place / camera.name).mkdir(parents=True)
        for number in range(_FRAMES):
            picture = np.where(mask[..., None], np.uint8(200), np.uint8([60, 70, 50]))
            coded = cv2.imencode(".png", picture)[1].tobytes()
            (place / camera.name / f"{number:03}.png").write_bytes(coded)
    write_rig(_rig(), place / "calibration.toml")
    recording = Recording.open(place, fps=25.0)
    estimate, settings = _recorded()
    write_estimate(recording, Output(out, pictures=False), estimate, settings)


def _make_given(path: Path) -> None:
    """A motion that holds its body: no person's."""
    from examples.bodies.example_motions import example_motion
    from silhouette_core.motion.motion_file import write_motion

    write_motion(example_motion("desk_lamp", 3), path)


def _use_motion(path: Path) -> None:
    from silhouette_core.motion.motion_file import read_motion
    from voxelpose.export.formats import export_motion

    motion = read_motion(path)
    motion.landmark_confidence()
    if len(motion):
        formats = ("bvh", "trc", "csv")
        export_motion(motion, path.with_name("exported"), formats, overwrite=True)


def _export(path: Path) -> None:
    from voxelpose.export.formats import export_motion

    export_motion(_motion(), path.parent, ("npz",), overwrite=True)


def _use_result(out: Path) -> None:
    from voxelpose.batch.batch_tables import _lines  # the table of a batch
    from voxelpose.batch.jobs import Job
    from voxelpose.batch.run import Outcome
    from voxelpose.cli.summary import print_result
    from voxelpose.reliability import findings_of
    from voxelpose.report.page import _settings_table, _stages
    from voxelpose.report.verdict import headline
    from voxelpose.results import Result

    result = Result.open(out)
    with contextlib.redirect_stdout(io.StringIO()):
        print_result(result)
    headline(result, findings_of(result.summary, result.motion)), _stages(result.summary["seconds"])
    _settings_table(result.settings)
    outcome = Outcome(Job("a", "b", "fit", {}), "done", "", 1.0, result.summary, {})
    _lines(outcome)


def _use_scenes(out: Path) -> None:
    from voxelpose.view.viewer.result_scenes import ResultScenes

    _use_result(out)
    scenes = ResultScenes(out)
    try:
        if len(scenes.frames):
            scenes.bodies(int(scenes.frames[0]))
    finally:
        scenes.close()


def _library(learned: bool) -> FuzzTarget:
    def make(path: Path) -> None:
        libraries.make_library(path, _motion().model, learned=learned)

    command = "library info {path} --png {folder}/sheet.png"
    return FuzzTarget("me.vplib", make, libraries.use_library, command=command)


def _use_scan(path: Path) -> None:
    """Reads a scan as `evaluate --scan` does."""
    from voxelpose.scan_distance import read_scan

    read_scan(path, "m", body_m=0.4)


def _body(
    opened: str, write: Callable[..., None], *beside: str, use=rigs.use_rig, **options
) -> FuzzTarget:
    """A body, written into a folder, and files beside it that are mutated, too."""

    def make(path: Path) -> None:
        write(path.parent, **options)

    return FuzzTarget(opened, make, use, (opened, *beside))


TARGETS: dict[str, FuzzTarget] = {
    "calibration-toml": _calibration("rig.toml"),
    "calibration-json": _calibration("rig.json"),
    "projections": _calibration("rig.json", style="projections", pinhole=True),
    "qualisys": _calibration("rig.txt"),
    "opencv-yaml": _calibration("rig.yml"),
    "opencv-xml": _calibration("rig.xml"),
    "opencv-json": _calibration("rig.json", style="opencv"),
    "opencv-folder": FuzzTarget("cameras", _make_folder, _use_rig, ("cameras/cam_0.yml",)),
    "easymocap": _calibration("easymocap", "easymocap/intri.yml", "easymocap/extri.yml"),
    "colmap": _foreign("model", calibrations.write_colmap, "model/cameras.txt", "model/images.txt"),
    "nerfstudio": _foreign("rig.json", calibrations.write_nerfstudio),
    "metashape": _foreign("rig.xml", calibrations.write_metashape),
    "theia": _foreign("rig.txt", calibrations.write_theia, unit="mm"),
    "vicon": _foreign("rig.xcp", calibrations.write_vicon, unit="mm"),
    "kinect": FuzzTarget("rig.json", calibrations.write_kinect, _use_lens),
    "opencap": _foreign("rig.json", calibrations.write_opencap, unit="mm"),
    "dannce": _foreign("rig.mat", calibrations.write_dannce, unit="mm"),
    "points": FuzzTarget("points.csv", _make_points, _use_points),
    "bvh": FuzzTarget("clip.bvh", _make_bvh, _use_clip),
    "exponential-map": FuzzTarget(
        "clip.csv", _make_expmap, _use_clip, ("clip.csv", "skeleton.json")
    ),
    "trc": _estimate("truth.trc"),
    "joints": _estimate("truth.json", "joints.csv"),
    "truth-table": _estimate("truth.csv"),
    "truth": _estimate("truth.json"),
    "subject": FuzzTarget("subject.toml", _make_subject, _use_subject),
    "recording-file": FuzzTarget("recording.toml", _make_recording_file, _use_recording_file),
    "drawn-region": FuzzTarget("regions/cam_0.png", _make_region, _use_region),
    "folder-settings": FuzzTarget(
        "voxelpose.toml", _make_folder_settings, _use_folder_settings, command="settings {folder}"
    ),
    "hypotheses": FuzzTarget("hypotheses.csv", _make_hypotheses, _use_hypotheses),
    "joint-names": FuzzTarget("names.toml", _make_names, _use_names),
    "batch-list": FuzzTarget("list.toml", _make_list, _use_list),
    "timestamps": FuzzTarget("timestamps.csv", _make_timestamps, _use_timestamps),
    "image-names": FuzzTarget("names.txt", _make_image_names, _use_image_names),
    "chapters": FuzzTarget("cam_0", _make_chapters, _use_camera, ("cam_0/GX020012.mp4",)),
    "film-track": FuzzTarget("cam_0.mov", _make_film, _use_camera),
    "exif": FuzzTarget("cam_0", partial(_make_images, turned=True), _use_images, ("cam_0/1.jpg",)),
    "alpha": FuzzTarget(
        "cam_0", partial(_make_images, turned=False), _use_images, ("cam_0/1.png",)
    ),
    **{
        f"times-{name}": FuzzTarget(f"a.{name}", _make_video, _use_video)
        for name in ("mov", "mkv", "avi")
    },
    **{
        name: FuzzTarget(f"a.{name}", _make_image, _use_camera)
        for name in ("png", "jpg", "bmp", "tiff", "webp")
    },
    **{
        f"masks-{name}": FuzzTarget(
            "masks/cam_0",
            partial(_make_masks, kind=name),
            _use_masks,
            (f"masks/cam_0/1.{'tiff' if name == 'float' else 'png'}",),
        )
        for name in ("label", "rgba", "palette", "float")
    },
    "rig-bvh": _body("leg.bvh", rigs.write_bvh_rig, "leg.rig.toml"),
    "rig-gltf": _body("box.gltf", rigs.write_gltf),
    "rig-glb": _body("box.glb", rigs.write_box_glb),
    **{
        f"rig-urdf-{name}": _body("arm.urdf", rigs.write_urdf, f"part.{name}", mesh=name)
        for name in ("stl", "obj", "dae", "ply")
    },
    "scan": _body("part.ply", rigs.write_urdf, use=_use_scan, mesh="ply"),
    "rig-makehuman": _body(
        "body.toml",
        rigs.write_makehuman,
        "data/3dobjs/base.obj",
        "data/rigs/standard/rig.two.json",
        "data/rigs/standard/weights.two.json",
        "data/targets/macrodetails/caucasian-male-young.target",
    ),
    "motion": FuzzTarget(
        "out/motion.safetensors",
        lambda path: _make_result(path.parent),
        _use_motion,
        command="export {folder}/out --out {folder}/exported --overwrite",
    ),
    "export-record": FuzzTarget("export.json", _export, _export),
    "given-body": FuzzTarget("given.safetensors", _make_given, _use_motion),
    "summary": FuzzTarget("out", _make_result, _use_result, ("out/summary.json",), _REPORT),
    "settings": FuzzTarget("out", _make_result, _use_scenes, ("out/settings.toml",), _REPORT),
    "library": _library(learned=True),
    "library-without-proposal": _library(learned=False),
}
