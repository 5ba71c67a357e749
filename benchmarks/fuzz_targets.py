"""Files of every format that the project reads, small and valid, and what is done with each.

A target makes its files in an empty folder with the project's own writers. After one of them was
mutated it reads it and works with what was read, as the commands do. Thorough runs, one in a
hundred, are the commands themselves.
"""

import contextlib
import io
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks import calibration_fuzz_targets as calibrations
from benchmarks import library_fuzz_targets as libraries
from benchmarks import motion_fuzz_targets as motions
from benchmarks import recording_fuzz_targets as recordings
from benchmarks import rig_fuzz_targets as rigs
from calib.camera import Rig
from calib.errors import InputError
from calib.files import read_rig, write_rig
from calib.files.anipose import read_up
from silhouette_core.body.sizes import BodySizes

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


def _make_rig(path: Path, style: str | None = None, pinhole: bool = False) -> None:
    rig = (
        Rig(tuple(camera.pinhole() for camera in calibrations.small_rig()))
        if pinhole
        else calibrations.small_rig()
    )
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
    for camera in calibrations.small_rig():
        own = path / f"{camera.name}.yml"
        write_rig(Rig((camera,)), own)
        text = own.read_text().replace(f"{camera.name}:\n", "")
        own.write_text(text.replace("\n   ", "\n"))


def _make_points(path: Path) -> None:
    rng = np.random.default_rng(0)
    lines = ["camera,point,x_px,y_px,x_m,y_m,z_m"]
    for number, place in enumerate(rng.uniform(-0.5, 0.5, (12, 3))):
        for camera in calibrations.small_rig():
            x, y = camera.project(place[None])[0][0]
            metres = ",".join(f"{value:.4f}" for value in place) if number < 6 else ",,"
            lines.append(f"{camera.name},p{number},{x:.2f},{y:.2f},{metres}")
    path.write_text("\n".join(lines) + "\n")


def _use_points(path: Path) -> None:
    from calib.points import read_points

    read_points(path)


def _estimate(truth: str, *mutated: str) -> FuzzTarget:
    command = "evaluate {folder}/joints.csv --truth {path}"
    return FuzzTarget(truth, motions.make_estimate, motions.use_estimate, mutated, command)


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


def _make_folder_settings(path: Path) -> None:
    text = (
        '[fit]\nstature = 1.75\nout = "x"\nsex = "female"\nbody = "92A5"\n'
        '[calibrate.board]\npaper = "a3"\n[live]\nsend = ["vmc://a:1"]\n'
        "[carve]\nvoxel = 0.02\nframe = 3\n"
    )
    path.write_text(text)


def _use_folder_settings(path: Path) -> None:
    from voxelpose.cli.options import folder_settings, sections_in

    for section in sections_in(path.parent):
        folder_settings(section, path.parent)


def _make_list(path: Path) -> None:
    for name in ("one", "two"):
        path.with_name(name).mkdir()
        write_rig(calibrations.small_rig(), path.with_name(name) / "calibration.toml")
    text = "[settings]\nstature = 1.8\nsmooth = false\n"
    text += '[[recording]]\nfolder = "one"\nframes = "0:9"\n'
    text += '[[recording]]\nfolder = "two"\nname = "second"\ncommand = "track"\n'
    path.write_text(text)


def _use_list(path: Path) -> None:
    from voxelpose.batch.jobs import jobs_of

    jobs_of([path], "fit", {})


def _library(learned: bool) -> FuzzTarget:
    def make(path: Path) -> None:
        libraries.make_library(path, motions.small_motion().model, learned=learned)

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
    "bvh": FuzzTarget("clip.bvh", motions.make_bvh, motions.use_clip),
    "exponential-map": FuzzTarget(
        "clip.csv", motions.make_expmap, motions.use_clip, ("clip.csv", "skeleton.json")
    ),
    "trc": _estimate("truth.trc"),
    "joints": _estimate("truth.json", "joints.csv"),
    "truth-table": _estimate("truth.csv"),
    "truth": _estimate("truth.json"),
    "subject": FuzzTarget("subject.toml", _make_subject, _use_subject),
    "recording-file": FuzzTarget(
        "recording.toml", recordings.make_recording_file, recordings.use_recording_file
    ),
    "drawn-region": FuzzTarget("regions/cam_0.png", recordings.make_region, recordings.use_region),
    "folder-settings": FuzzTarget(
        "voxelpose.toml", _make_folder_settings, _use_folder_settings, command="settings {folder}"
    ),
    "hypotheses": FuzzTarget("hypotheses.csv", motions.make_hypotheses, motions.use_hypotheses),
    "joint-names": FuzzTarget("names.toml", motions.make_names, motions.use_names),
    "batch-list": FuzzTarget("list.toml", _make_list, _use_list),
    "timestamps": FuzzTarget(
        "timestamps.csv", recordings.make_timestamps, recordings.use_timestamps
    ),
    "image-names": FuzzTarget("names.txt", recordings.make_image_names, recordings.use_image_names),
    "chapters": FuzzTarget(
        "cam_0", recordings.make_chapters, recordings.use_camera, ("cam_0/GX020012.mp4",)
    ),
    "interlaced": FuzzTarget("cam_0.mov", recordings.make_interlaced, recordings.use_camera),
    "film-track": FuzzTarget("cam_0.mov", recordings.make_film, recordings.use_camera),
    "exif": FuzzTarget(
        "cam_0",
        partial(recordings.make_images, turned=True),
        recordings.use_images,
        ("cam_0/1.jpg",),
    ),
    "alpha": FuzzTarget(
        "cam_0",
        partial(recordings.make_images, turned=False),
        recordings.use_images,
        ("cam_0/1.png",),
    ),
    **{
        f"times-{name}": FuzzTarget(f"a.{name}", recordings.make_video, recordings.use_video)
        for name in ("mov", "mkv", "avi")
    },
    **{
        name: FuzzTarget(f"a.{name}", recordings.make_image, recordings.use_camera)
        for name in ("png", "jpg", "bmp", "tiff", "webp")
    },
    **{
        f"masks-{name}": FuzzTarget(
            "masks/cam_0",
            partial(recordings.make_masks, kind=name),
            recordings.use_masks,
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
        lambda path: motions.make_result(path.parent),
        motions.use_motion,
        command="export {folder}/out --out {folder}/exported --overwrite",
    ),
    "corrections": FuzzTarget(
        "out",
        motions.make_corrected,
        motions.use_corrected,
        ("out/corrections.json", "out/fitted_again_1.safetensors"),
    ),
    "export-record": FuzzTarget("export.json", motions.export, motions.export),
    "given-body": FuzzTarget("given.safetensors", motions.make_given, motions.use_motion),
    "summary": FuzzTarget(
        "out", motions.make_result, motions.use_result, ("out/summary.json",), _REPORT
    ),
    "settings": FuzzTarget(
        "out", motions.make_result, motions.use_scenes, ("out/settings.toml",), _REPORT
    ),
    "library": _library(learned=True),
    "library-without-proposal": _library(learned=False),
}
