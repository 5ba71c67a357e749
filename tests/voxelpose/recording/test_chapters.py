"""Films in several files: joined where one continues the other, else asked about."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from tests.voxelpose.recording.test_file_times import COUNT, ffmpeg, film
from tests.voxelpose.recording.test_folder import number_of, numbers, picture, write_calibration
from voxelpose.recording.chapters import FilmReader, open_camera
from voxelpose.recording.folder import Recording, one_camera

FPS = 25
CUT = 12  # the first frame of the second chapter


def created(seconds: float) -> tuple[str, str]:
    return "-metadata", f"creation_time=2024-01-01T12:00:{seconds:09.6f}Z"


def timecode(seconds: int, frames: int = 0) -> tuple[str, str]:
    return "-timecode", f"12:00:{seconds:02d}:{frames:02d}"


def chapters(folder: Path, words: dict[str, tuple[str, ...]], second: int = CUT) -> Path:
    """Two files of a film of twenty frames, in a folder, with options of FFmpeg for each."""
    folder.mkdir()
    parts = f"lt(n,{CUT})", f"gte(n,{second})"
    for part, (name, options) in zip(parts, words.items(), strict=True):
        film(folder / name, f"select='{part}',setpts=N/({FPS}*TB)", *options)
    return folder


@pytest.mark.parametrize(
    "words",
    [
        {"GX010012.MP4": (), "GX020012.MP4": ()},
        {"GOPR0012.MP4": (), "GP010012.MP4": ()},
        {"GX010012.MP4": created(0), "GX020012.MP4": created(0)},
        {"GH010012.mp4": timecode(1), "GH020012.mp4": timecode(1, CUT)},
        {"C0001.MP4": timecode(7), "C0002.MP4": timecode(7, CUT)},
        {"DJI_0007.mov": created(3), "DJI_0008.mov": created(4)},
        {"00000.MTS": (), "00001.MTS": ("-output_ts_offset", f"{CUT / FPS}")},
        {"DJI_0999.mp4": timecode(1), "DJI_0001.mp4": timecode(1, CUT)},
    ],
    ids=lambda words: " ".join(words),
)
def test_chapters_are_joined_where_one_continues_the_other(tmp_path: Path, words):
    reader = open_camera(chapters(tmp_path / "cam_1", words))
    assert (reader.frame_count, reader.fps) == (COUNT, FPS)
    assert [number_of(frame) for frame in reader] == list(range(COUNT))
    some = [0, CUT - 1, CUT, CUT, COUNT - 1]
    assert [number_of(frame) for frame in reader.select(some)] == some
    assert [number_of(frame) for frame in reader.frames(CUT - 2, CUT + 2)] == [10, 11, 12, 13]
    if reader.shown_s is not None:
        np.testing.assert_allclose(reader.shown_s, np.arange(COUNT) / FPS, atol=0.002)


def test_a_recording_of_chapters_is_said(tmp_path: Path):
    write_calibration(tmp_path / "calibration.toml")
    film(tmp_path / "cam_1.mp4")
    folder = chapters(tmp_path / "cam_2", {"GX010012.MP4": (), "GX020012.MP4": ()})
    for name in ("GX010012.THM", "GL010012.LRV"):
        (folder / name).write_bytes(b"x")
    cv2.imwrite(str(folder / "GX010012.jpg"), picture(0))
    recording = Recording.open(tmp_path)
    assert numbers(recording) == [(n, [n, n]) for n in range(COUNT)]
    words = "cam_2: GX010012.MP4, GX020012.MP4 are joined as the chapters of one film"
    assert recording.notes == (words,)
    times_s = recording.file_times()["cam_2"]
    np.testing.assert_allclose(times_s, np.arange(COUNT) / FPS, atol=0.002)


@pytest.mark.parametrize("many", [1, 7])
def test_pictures_that_two_chapters_have_are_shown_once(tmp_path: Path, many: int):
    words = {"C0001.MP4": timecode(7), "C0002.MP4": timecode(7, CUT - many)}
    reader = open_camera(chapters(tmp_path / "cam_1", words, CUT - many))
    assert isinstance(reader, FilmReader)
    assert [number_of(frame) for frame in reader] == list(range(COUNT))
    np.testing.assert_allclose(reader.shown_s, np.arange(COUNT) / FPS, atol=0.002)
    assert f"C0002.MP4 begins with the last {many} pictures before it" in reader.note


def test_the_only_chapter_is_the_film(tmp_path: Path):
    (tmp_path / "cam_1").mkdir()
    film(tmp_path / "cam_1" / "GX010012.MP4")
    assert open_camera(tmp_path / "cam_1").frame_count == COUNT


@pytest.mark.parametrize(
    ("words", "question"),
    [
        ({"GX010012.MP4": (), "GX030012.MP4": ()}, "cam_1 lacks chapter 2 of its film: put all"),
        ({"GX020012.MP4": (), "GX030012.MP4": ()}, "cam_1 lacks chapter 1 of its film"),
        ({"GX010012.MP4": (), "GH010012.MP4": ()}, "cam_1 holds a chapter twice"),
        ({"GX010012.MP4": (), "GX010013.MP4": ()}, "of the films 0012, 0013: leave those of one"),
        ({"C0001.MP4": (), "C0002.MP4": ()}, r"C0002\.MP4, and nothing .* join them into cam_1"),
        ({"C0001.MP4": created(0), "C0002.MP4": created(9)}, "none continues the other: leave"),
        ({"GX010012.MP4": created(0), "GX020012.MP4": created(9)}, "none continues the other"),
        ({"C0001.MP4": (), "C0002.MP4": ("-s", "48x32")}, "kinds .*48 x 32 px at 25 per"),
    ],
    ids=lambda words: " ".join(words) if isinstance(words, dict) else "",
)
def test_what_may_be_no_chapters_is_asked_about(tmp_path: Path, words, question: str):
    folder = chapters(tmp_path / "cam_1", words)
    with pytest.raises(InputError, match=question) as refused:
        open_camera(folder)
    assert "\n" not in str(refused.value)


def test_chapters_beside_each_other_belong_into_a_folder(tmp_path: Path):
    write_calibration(tmp_path / "calibration.toml")
    for name in ("GX010012.MP4", "GX020012.MP4"):
        film(tmp_path / name)
    words = "GX010012, GX020012 are chapters of one film: put them into a folder of their camera"
    with pytest.raises(InputError, match=words):
        Recording.open(tmp_path)
    with pytest.raises(InputError, match=words):
        one_camera(tmp_path)


def with_cover(path: Path, number: int, *words: str) -> None:
    """Puts a still picture before a video's track."""
    picture_file, whole = path.with_suffix(".jpg"), path.with_name("whole.mp4")
    cv2.imwrite(str(picture_file), cv2.resize(picture(number), (48, 32)))
    path.rename(whole)
    tracks = ("-map", "0:v", "-map", "1:v", "-c:v:0", "mjpeg", "-c:v:1", "copy")
    ffmpeg("-i", picture_file, "-i", whole, *tracks, *words, path)
    for file in (picture_file, whole):
        file.unlink()


@pytest.mark.parametrize("words", [(), ("-disposition:v:0", "attached_pic")])
def test_the_film_is_taken_whichever_track_it_is(tmp_path: Path, words: tuple[str, ...]):
    write_calibration(tmp_path / "calibration.toml")
    for name in ("cam_1", "cam_2"):
        film(tmp_path / f"{name}.mp4")
    with_cover(tmp_path / "cam_2.mp4", 3, *words)
    recording = Recording.open(tmp_path)
    assert numbers(recording) == [(n, [n, n]) for n in range(COUNT)]
    assert recording.fps == FPS
    assert recording.readers["cam_2"].path == tmp_path / "cam_2.mp4"
    assert list(recording.file_times()) == ["cam_1", "cam_2"]


def test_a_video_of_one_picture_is_what_it_is(tmp_path: Path):
    film(tmp_path / "cam_1.mp4", count=1)
    assert open_camera(tmp_path / "cam_1.mp4").frame_count == 1


def test_a_folder_of_several_cameras_videos_is_no_camera(tmp_path: Path):
    ffmpeg_words = ("-f", "lavfi", "-i", "color=size=96x64:rate=25", "-frames:v", "2")
    (tmp_path / "videos").mkdir()
    for name in ("cam_1.mp4", "cam_2.mp4"):
        ffmpeg(*ffmpeg_words, tmp_path / "videos" / name)
    with pytest.raises(InputError, match="videos/ holds cam_1, cam_2: move that up here"):
        Recording.open(tmp_path)
