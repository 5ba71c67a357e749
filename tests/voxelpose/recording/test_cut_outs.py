"""Frames with an opacity: cut-outs are silhouettes, others pictures; doubts are questions."""

import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from calib.errors import InputError
from tests.voxelpose.recording.test_masks import (
    SIZE,
    cut_out,
    film,
    likeness,
    palette,
    person,
    write,
)
from voxelpose.recording import masks
from voxelpose.recording.folder import Recording

Picture = NDArray | Image.Image


def frames(folder: Path, make: Callable[[int], Picture], suffix: str = ".png", other=None) -> Path:
    """Writes pictures of both cameras into a recording; those of the second by `other`, if any."""
    write(folder, make, suffix)
    if other is not None:
        (folder / "other").mkdir()
        shutil.rmtree(folder / "masks" / "cam_2")
        write(folder / "other", other, suffix)
        (folder / "other" / "masks" / "cam_2").rename(folder / "masks" / "cam_2")
    for name in ("cam_1", "cam_2"):
        (folder / "masks" / name).rename(folder / name)
    return folder


def opaque(number: int) -> NDArray:
    return cut_out(number, 0 * person(number) + 255)


def deep(number: int) -> NDArray:
    return cut_out(number, person(number) * 255).astype(np.uint16) * 257


def hidden(number: int) -> NDArray:
    picture = cut_out(number, person(number) * 255)
    return picture * (picture[..., 3:] > 0)


def grey(number: int) -> Image.Image:
    picture = Image.fromarray(person(number).astype(np.uint8) * 90 + 30)
    picture.putalpha(Image.fromarray(person(number).astype(np.uint8) * 255))
    return picture


@pytest.mark.parametrize(
    ("make", "suffix"),
    [
        (hidden, ".png"),
        (lambda n: cut_out(n, person(n) * 255), ".png"),
        (lambda n: cut_out(n, person(n) * 255), ".webp"),
        (lambda n: cut_out(n, cv2.GaussianBlur(person(n) * np.uint8(255), (0, 0), 1)), ".png"),
        (deep, ".png"),
        (deep, ".tiff"),
        (grey, ".png"),
        (lambda n: palette(person(n), [0, 0, 0, 128, 60, 30], 0), ".png"),
    ],
    ids=["black", "hidden colours", "WebP", "soft", "16 bit", "TIFF", "grey", "palette"],
)
def test_the_opacity_of_cut_outs_is_the_silhouette(tmp_path: Path, make, suffix: str):
    folder = frames(tmp_path, make, suffix)
    recording = Recording.open(folder, fps=25)
    assert recording.silhouettes_given
    words = "frames are cut-outs: their opacity is used as silhouettes"
    assert recording.notes[0].startswith(words)
    assert likeness(folder) > 0.95


def test_a_video_may_have_an_opacity(tmp_path: Path):
    pixels = ("bgra", "yuva444p10le")
    film(tmp_path, lambda n: cut_out(n, person(n) * 255), ".mov", "prores_ks", pixels)
    for path in (tmp_path / "masks").iterdir():
        path.rename(tmp_path / path.name)
    assert Recording.open(tmp_path, fps=25).silhouettes_given
    assert likeness(tmp_path) > 0.95


def rounded(number: int) -> NDArray:
    alpha = np.full(SIZE[::-1], 255, np.uint8)
    alpha[:6, :6] = 0
    return cut_out(number, alpha)


def undistorted(number: int) -> NDArray:
    alpha = np.zeros(SIZE[::-1], np.uint8)
    alpha[5:-5, 5:-5] = 255
    return cut_out(number, alpha)


@pytest.mark.parametrize(
    ("make", "words"),
    [(opaque, ""), (rounded, "not transparent along"), (undistorted, "the same in all of them")],
)
def test_an_opacity_that_is_no_silhouette_leaves_pictures(tmp_path: Path, make, words: str):
    recording = Recording.open(frames(tmp_path, make), fps=25)
    assert not recording.silhouettes_given
    assert words in " ".join(recording.notes) and len(recording.notes) == 2 * bool(words)
    (_, _, pictures), *_ = recording
    np.testing.assert_array_equal(pictures["cam_1"], make(0)[..., :3])


def test_cut_outs_of_one_camera_alone_are_asked_about(tmp_path: Path):
    folder = frames(tmp_path, hidden, other=lambda n: opaque(n)[..., :3])
    with pytest.raises(InputError, match=r"of cam_1 are cut-outs, .* those of cam_2 are not: cut"):
        Recording.open(folder, fps=25)
    assert Recording.open(folder, fps=25, cameras=["cam_1"]).silhouettes_given
    assert not Recording.open(folder, fps=25, cameras=["cam_2"]).silhouettes_given


@pytest.mark.parametrize("lacking", [(0,), (3,), range(5)])
def test_frames_without_opacity_among_cut_outs_are_named(tmp_path: Path, lacking):
    folder = frames(tmp_path, lambda n: opaque(n)[..., :3] if n in lacking else hidden(n))
    with pytest.raises(InputError, match="cam_1 holds some that have no opacity, and others have"):
        Recording.open(folder, fps=25)


def test_a_frame_without_opacity_that_was_not_looked_at_is_named(tmp_path: Path, monkeypatch):
    folder = frames(tmp_path, lambda n: opaque(n)[..., :3] if n == 3 else hidden(n))
    monkeypatch.setattr(masks, "_SAMPLES", 2)
    recording = Recording.open(folder, fps=25)
    with pytest.raises(InputError, match=r"3\.png has no opacity, and others have: cut out all"):
        list(recording)
