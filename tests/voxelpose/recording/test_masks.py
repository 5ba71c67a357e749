"""Masks of every habit give the silhouettes that they mean, or a question in one line."""

from collections.abc import Callable
from pathlib import Path

import cv2
import imageio_ffmpeg
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from calib.errors import InputError
from calib.files import write_rig
from tests.sources import ring
from voxelpose.recording.folder import Recording

SIZE = (96, 64)
COUNT = 8
Mask = NDArray[np.bool_]
CAMERAS = ("cam_1", "cam_2")


def person(number: int) -> Mask:
    """A person of two pieces who walks across the picture."""
    mask, x = np.zeros(SIZE[::-1], np.uint8), 20 + 6 * number
    cv2.ellipse(mask, (x, 40), (7, 16), 0, 0, 360, 1, -1)
    cv2.circle(mask, (x, 20), 6, 1, -1)
    return mask.view(np.bool_)


def with_other(number: int, own: int, other: int, moving: bool = True) -> NDArray:
    """The person, and somebody or something else beside, as labels."""
    labels = np.zeros(SIZE[::-1], np.uint16)
    x = 4 + 3 * number if moving else 4
    labels[50:62, x : x + 9] = other
    labels[person(number)] = own
    return labels


def parts(number: int) -> NDArray:
    """The person's body in three parts."""
    rows = np.arange(SIZE[1])[:, None] // 12
    return person(number) * (rows % 3 + 1).astype(np.uint8)


def coloured(labels: NDArray, background=(0, 0, 0)) -> NDArray:
    return np.array([background, (0, 0, 255), (255, 0, 0)], np.uint8)[labels]


def cut_out(number: int, alpha: NDArray) -> NDArray:
    """Pictures of noise, and what is opaque of them."""
    noise = np.random.default_rng(number).integers(0, 255, (*SIZE[::-1], 3), np.uint8)
    return np.dstack([noise, alpha.astype(np.uint8)])


def palette(labels: NDArray, colours: list[int], transparent: int | None = None) -> Image.Image:
    image = Image.fromarray(labels.astype(np.uint8), "P")
    image.putpalette(colours)
    if transparent is not None:
        image.info["transparency"] = transparent
    return image


def times(value: float, dtype: type = np.uint8) -> Callable[[int], NDArray]:
    return lambda number: (person(number) * value).astype(dtype)


def smooth(number: int) -> NDArray:
    return cv2.GaussianBlur(person(number).astype(np.uint8) * 255, (0, 0), 1)


def write(folder: Path, make: Callable[[int], NDArray | Image.Image], suffix: str = ".png") -> Path:
    """Writes the masks of both cameras."""
    write_rig(ring(2, SIZE), folder / "calibration.toml")
    for name in CAMERAS:
        (folder / "masks" / name).mkdir(parents=True)
        for number in range(COUNT):
            image, path = make(number), folder / "masks" / name / f"{number}{suffix}"
            if isinstance(image, Image.Image):
                image.save(path)
            else:
                bytewise = image.astype(np.uint8) if image.dtype in (bool, np.int64) else image
                path.write_bytes(cv2.imencode(suffix, bytewise)[1].tobytes())
    return folder


def film(
    folder: Path, make: Callable[[int], NDArray], suffix: str, codec: str, pixels: tuple[str, str]
) -> Path:
    """Writes the masks of both cameras as videos."""
    write_rig(ring(2, SIZE), folder / "calibration.toml")
    (folder / "masks").mkdir()
    for name in CAMERAS:
        writer = imageio_ffmpeg.write_frames(
            str(folder / "masks" / f"{name}{suffix}"),
            SIZE,
            codec=codec,
            **{"pix_fmt_in": pixels[0], "pix_fmt_out": pixels[1], "macro_block_size": 1},
            **{"quality": 9, "ffmpeg_log_level": "quiet"},
        )
        writer.send(None)
        for number in range(COUNT):
            writer.send(np.ascontiguousarray(make(number)))
        writer.close()
    return folder


def likeness(folder: Path, label: str | None = None) -> float:
    """What the silhouettes and the person have in common, in the worst picture."""
    shares = []
    for number, _, frames in Recording.open(folder, fps=25, label=label):
        for frame in frames.values():
            assert set(np.unique(frame)) <= {0, 255} and frame.shape == (*SIZE[::-1], 3)
            mask, true = frame[..., 0] > 0, person(number)
            shares.append((mask & true).sum() / (mask | true).sum())
    return min(shares)


HABITS: dict[str, tuple[Callable[[int], NDArray | Image.Image], str]] = {
    "white": (times(255), ".png"),
    "label 1": (times(1), ".png"),
    "label 15": (times(15), ".png"),
    "label 100": (times(100), ".png"),
    "16 bit of 1": (times(1, np.uint16), ".png"),
    "16 bit of 255": (times(255, np.uint16), ".png"),
    "16 bit of 24001": (times(24001, np.uint16), ".png"),
    "16 bit of 65535": (times(65535, np.uint16), ".png"),
    "float of 1": (times(1, np.float32), ".tiff"),
    "float of 0.3": (times(0.3, np.float32), ".tiff"),
    "double of 255": (times(255, np.float64), ".tiff"),
    "whole numbers of 32 bit": (lambda n: Image.fromarray(person(n).astype(np.int32)), ".tiff"),
    "one bit": (lambda n: Image.fromarray(person(n)), ".png"),
    "palette in colour": (lambda n: palette(person(n), [0, 0, 0, 128, 0, 0]), ".png"),
    "palette all black": (lambda n: palette(person(n), [0] * 6), ".png"),
    "palette turned round": (lambda n: palette(~person(n), [255] * 3 + [0] * 3), ".png"),
    "palette transparent": (lambda n: palette(person(n), [0] * 6, 0), ".png"),
    "cut-out": (lambda n: cut_out(n, person(n) * 255), ".png"),
    "cut-out in WebP": (lambda n: cut_out(n, person(n) * 255), ".webp"),
    "black on transparent": (lambda n: np.dstack([0 * parts(n)] * 3 + [person(n) * 255]), ".png"),
    "opaque throughout": (
        lambda n: np.dstack([person(n) * 255] * 3 + [0 * parts(n) + 255]),
        ".png",
    ),
    "opaque nowhere": (lambda n: np.dstack([person(n) * 255] * 3 + [0 * parts(n)]), ".png"),
    "cut-out on black": (lambda n: cut_out(n, parts(n))[..., :3] * person(n)[..., None], ".png"),
    "one colour": (lambda n: coloured(person(n).astype(int)), ".png"),
    "one colour on white": (lambda n: coloured(person(n).astype(int), (255,) * 3), ".png"),
    "JPEG": (times(255), ".jpg"),
    "smooth edges": (smooth, ".png"),
    "faint and smooth": (lambda n: smooth(n) // 3, ".png"),
    "parts": (parts, ".png"),
    "a chair": (lambda n: with_other(n, 1, 2, moving=False), ".png"),
    "classes": (lambda n: with_other(n, 3, 2, moving=False) + 10, ".png"),
}


@pytest.mark.parametrize("habit", HABITS)
def test_masks_of_every_habit_are_the_person(tmp_path, habit):
    make, suffix = HABITS[habit]
    least = 0.98 if suffix == ".png" or suffix == ".tiff" else 0.9
    least = 0.9 if "smooth" in habit or "on black" in habit else least
    assert likeness(write(tmp_path, make, suffix)) >= least


@pytest.mark.parametrize(
    ("suffix", "codec", "pixels", "make"),
    [
        (".avi", "ffv1", ("gray", "gray"), times(1)),
        (".mkv", "ffv1", ("gray16le", "gray16le"), times(1, np.uint16)),
        (".mp4", "libx264", ("gray", "yuv420p"), times(255)),
        (".mp4", "libx264", ("gray", "yuv420p"), times(1)),
        (".webm", "libvpx-vp9", ("rgba", "yuva420p"), lambda n: cut_out(n, person(n) * 255)),
        (".mov", "png", ("rgba", "rgba"), lambda n: cut_out(n, person(n) * 255)),
    ],
)
def test_videos_of_masks(tmp_path, suffix, codec, pixels, make):
    # H.264 leaves of a label of 1 what it can.
    least = 0.5 if make(0).max() == 1 and codec == "libx264" else 0.9
    assert likeness(film(tmp_path, make, suffix, codec, pixels)) >= least


def question(folder: Path) -> str:
    with pytest.raises(InputError) as asked:
        Recording.open(folder, fps=25)
    said = str(asked.value)
    assert "\n" not in said and "masks" in said and "background/" not in said
    return said


@pytest.mark.parametrize(
    ("make", "labels", "names"),
    [
        (lambda n: with_other(n, 1, 2), "1", "labels 1, 2"),
        (lambda n: with_other(n, 24001, 24002), "24001", "labels 24001, 24002"),
        (lambda n: coloured(with_other(n, 1, 2)), "ff0000", "ff0000"),
        (lambda n: coloured(with_other(n, 1, 2), (255,) * 3), "FF0000", "0000ff"),
        (lambda n: palette(with_other(n, 1, 2), [0] * 3 + [128, 0, 0, 0, 128, 0]), "1", "1, 2"),
    ],
)
def test_which_of_two_people_is_asked(tmp_path, make, labels, names):
    said = question(write(tmp_path, make))
    assert names in said and "--label" in said and "several of them move" in said
    assert likeness(tmp_path, labels) == 1


def test_labels_that_there_are_not_are_refused(tmp_path):
    write(tmp_path, times(3))
    with pytest.raises(InputError, match=r"no label '7': give --label 0 or 3"):
        Recording.open(tmp_path, fps=25, label="7")


def test_the_choice_is_said(tmp_path):
    write(tmp_path, lambda n: with_other(n, 1, 2, moving=False))
    (said,) = Recording.open(tmp_path, fps=25).notes
    assert "of labels 1, 2 only 1 moves" in said and "--label" in said


def test_several_labels_may_be_asked_for(tmp_path):
    write(tmp_path, lambda n: parts(n) + with_other(n, 0, 7).astype(np.uint8) * ~person(n))
    assert likeness(tmp_path, "1,2,3") == 1


@pytest.mark.parametrize(
    "make", [lambda n: ~person(n) * np.uint8(255), lambda n: cut_out(n, ~person(n) * 255)]
)
def test_black_and_white_exchanged_is_asked(tmp_path, make):
    said = question(write(tmp_path, make))
    assert "exchanged" in said and "--label 0" in said and "--label 255" in said
    assert likeness(tmp_path, "0") == 1


def test_pictures_are_no_masks(tmp_path):
    room = np.tile(np.arange(SIZE[0], dtype=np.uint8) * 2, (SIZE[1], 1))
    assert "holds pictures, not masks" in question(write(tmp_path, lambda n: room + 9 * person(n)))


def test_masks_of_nobody_are_refused(tmp_path):
    assert "marks nobody" in question(write(tmp_path, times(0)))


def places(folder: Path, kind: str, image: NDArray) -> NDArray:
    write_rig(ring(2, SIZE), folder / "calibration.toml")
    (folder / kind).mkdir()
    cv2.imwrite(str(folder / kind / "cam_1.png"), image)
    recording = Recording.without_frames(folder)
    found = recording.regions() if kind == "regions" else recording.unknown()
    return found.get("cam_1", np.zeros(SIZE[::-1], np.bool_))


@pytest.mark.parametrize("kind", ["regions", "unknown"])
@pytest.mark.parametrize("how", ["one", "layer", "dark layer", "16 bit", "colours"])
def test_regions_and_unknown_places_are_read_likewise(tmp_path, kind, how):
    mask = np.zeros(SIZE[::-1], np.uint8)
    mask[10:50, 5:30] = 1
    image = {
        "one": mask,
        "layer": np.dstack([0 * mask + 255] * 3 + [255 * mask]),
        "dark layer": np.dstack([0 * mask] * 3 + [255 * mask]),
        "16 bit": mask.astype(np.uint16) * 300,
        "colours": np.dstack([mask * 10, mask * 200, mask * 90]),
    }[how]
    np.testing.assert_array_equal(places(tmp_path, kind, image), mask > 0)


def test_a_layer_on_which_nothing_is_painted_marks_nothing(tmp_path):
    layer = np.full((*SIZE[::-1], 4), (255, 255, 255, 0), np.uint8)
    assert not places(tmp_path, "unknown", layer).any()
