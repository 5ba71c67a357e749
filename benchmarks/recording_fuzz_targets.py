"""Small recordings, and files beside them, for `benchmarks.fuzz_targets`."""

import contextlib
import subprocess
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

from benchmarks.calibration_fuzz_targets import small_rig
from calib.errors import InputError


def make_recording_file(path: Path) -> None:
    text = "cam_0 = [[[10, 20], [100.5, 20], [100, 80]], [[0, 0], [9, 0], [9, 9], [0, 9]]]"
    path.write_text(f"[unknown]\n{text}\ncam_1 = []\n")


def use_recording_file(path: Path) -> None:
    from voxelpose.recording.unknown_places import painted_mask, unknown_polygons

    for name, polygons in unknown_polygons(path, small_rig().names).items():
        painted_mask(polygons, small_rig()[name].size)


def make_region(path: Path) -> None:
    from voxelpose.setup_page.drawn_places import write_region
    from voxelpose.setup_page.page_requests import RegionDrawing

    drawing = RegionDrawing(True, [[(5.0, 5.0), (60.5, 5.0), (30.0, 40.2)]])
    write_region(path.parents[1], "cam_0", drawing, None, (64, 48))


def use_region(path: Path) -> None:
    from voxelpose.recording.frame_reader import read_still
    from voxelpose.setup_page.drawn_places import read_regions

    read_regions(path.parents[1], {"cam_0": read_still(path).max(axis=2) > 127})


def make_timestamps(path: Path) -> None:
    from voxelpose.recording.timestamps import write_timestamps

    write_timestamps(path, {f"cam_{k}": np.arange(30) / 25 + 0.003 * k for k in range(2)})


def use_timestamps(path: Path) -> None:
    from voxelpose.recording.frame_reader import FrameReader
    from voxelpose.recording.timestamps import match_frames, read_timestamps

    reader = FrameReader(path.parent, (), (320, 240), 30, 25.0)
    match_frames(read_timestamps(path, {"cam_0": reader, "cam_1": reader})[0], path)


def make_video(path: Path, *words: str) -> None:
    import imageio_ffmpeg

    coded = ["-vf", "select='not(between(n,4,6))'", "-fps_mode", "passthrough", "-bf", "2", *words]
    writer = imageio_ffmpeg.write_frames(
        str(path), (64, 48), fps=25, output_params=coded, macro_block_size=1
    )
    writer.send(None)
    for grey in range(12):
        writer.send(np.full((48, 64, 3), grey, np.uint8))
    writer.close()


def use_video(path: Path) -> None:
    from voxelpose.recording.ffmpeg import coded_pictures
    from voxelpose.recording.timestamps import even_numbers

    coded = coded_pictures(path)
    times_s = coded.shown_s
    if times_s is not None:
        numbers, _ = even_numbers(times_s)
        assert len(numbers) == coded.count
        assert np.isfinite(times_s).all()
        assert (np.diff(numbers) > 0).all()


def make_image(path: Path) -> None:
    image = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    path.write_bytes(cv2.imencode(path.suffix, image)[1].tobytes())


def use_camera(path: Path) -> None:
    """Reads the pictures of a camera."""
    from voxelpose.recording.chapters import open_camera

    for frame in open_camera(path):
        frame.mean()


def make_chapters(path: Path) -> None:
    path.mkdir()
    for chapter in (1, 2):
        make_video(path / f"GX0{chapter}0012.mp4")


def make_interlaced(path: Path) -> None:
    make_video(path, "-x264-params", "tff=1")


def make_film(path: Path) -> None:
    """A film behind a still picture, as its file's second track."""
    import imageio_ffmpeg

    film, cover = path.with_name("film.mov"), path.with_name("cover.png")
    make_video(film)
    make_image(cover)
    words = ["-loglevel", "error", "-i", cover, "-i", film, "-map", "0:v", "-map", "1:v"]
    words = [imageio_ffmpeg.get_ffmpeg_exe(), *words, "-c", "copy", path]
    subprocess.run(words, check=True)


def make_images(path: Path, turned: bool) -> None:
    """Three images, one of which EXIF data turn; or whose opacity is a person's silhouette."""
    path.mkdir()
    for number in range(3):
        layers = np.random.default_rng(number).integers(0, 255, (48, 64, 4), np.uint8)
        layers[..., 3] = 0
        layers[10:40, 8 * number + 8 : 8 * number + 24, 3] = 255
        still, exif = path / f"{number}.{'jpg' if turned else 'png'}", Image.Exif()
        exif[0x0112] = 6 if number == 1 else 1
        Image.fromarray(layers[..., :3] if turned else layers).save(still, exif=exif)


def use_images(path: Path) -> None:
    from voxelpose.recording.frame_reader import FrameReader
    from voxelpose.recording.mask_labels import cut_outs

    reader = FrameReader.open(path)
    for frame in cut_outs({"cam_0": reader})[0].get("cam_0", reader):
        frame.mean()


def make_image_names(path: Path) -> None:
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
    names = ["\n".join(map(form, range(12))) for form in forms]
    path.write_text("\n\n".join(names))


def use_image_names(path: Path) -> None:
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


def make_masks(path: Path, kind: str) -> None:
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


def use_masks(path: Path) -> None:
    from voxelpose.recording.mask_labels import open_masks
    from voxelpose.recording.masks import painted

    painted(sorted(path.iterdir())[1])
    for frame in open_masks({"cam_0": path})[0]["cam_0"]:
        frame.mean()
