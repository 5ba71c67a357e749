"""Recordings made here, good and bad."""

import datetime
import threading
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from tests.sources import write_film
from voxelpose.recording.folder import Recording
from voxelpose.recording.frame_reader import FrameReader
from voxelpose.recording.timestamps import write_timestamps

WIDTH, HEIGHT = 96, 64


def picture(number: int, size: tuple[int, int] = (WIDTH, HEIGHT)) -> np.ndarray:
    """A frame that tells its number by its brightness."""
    return np.full((size[1], size[0], 3), 20 + 10 * number, np.uint8)


def write_video(
    path: Path, count: int = 8, fps: float = 25.0, size: tuple[int, int] = (WIDTH, HEIGHT)
) -> None:
    write_film(path, (picture(number, size) for number in range(count)), fps)


def write_stills(folder: Path, count: int = 8, suffix: str = ".png") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for number in range(count):
        cv2.imwrite(str(folder / f"frame_{number}{suffix}"), picture(number))


def write_calibration(
    path: Path, names: tuple[str, ...] = ("cam_1", "cam_2"), unit: str | None = "m"
) -> None:
    text = "".join(
        f'[{name}]\nname = "{name}"\nsize = [{WIDTH}, {HEIGHT}]\nmatrix = [[90.0, 0, 48], [0, 90.0,'
        " 32], [0, 0, 1]]\ndistortions = [0, 0, 0, 0, 0]\nrotation = [1.5, 0.1,"
        f" {index}]\ntranslation = [0, 1, 4]\n"
        for index, name in enumerate(names)
    )
    path.write_text(text + (f'[metadata]\nunit = "{unit}"\n' if unit else ""))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two cameras, eight frames at 25 frames per second, a background video for the first and a
    still for the second.
    """
    write_calibration(tmp_path / "calibration.toml")
    for name in ("cam_1", "cam_2"):
        write_video(tmp_path / f"{name}.avi")
    write_video(tmp_path / "background/cam_1.avi", 3)
    cv2.imwrite(str(tmp_path / "background/cam_2.png"), picture(0))
    return tmp_path


def number_of(frame: np.ndarray) -> int:
    return round((float(frame.mean()) - 20) / 10)


def numbers(recording: Recording) -> list[tuple[int, list[int]]]:
    return [
        (index, [number_of(frame) for frame in frames.values()]) for index, _, frames in recording
    ]


def test_frames_come_in_order_from_every_camera(folder: Path):
    recording = Recording.open(folder)
    assert recording.rig.names == ("cam_1", "cam_2")
    assert (recording.fps, recording.frame_count) == (25.0, 8)
    assert numbers(recording) == [(n, [n, n]) for n in range(8)]
    assert numbers(recording) == [(n, [n, n]) for n in range(8)]  # a second time
    np.testing.assert_allclose([time for _, time, _ in recording], np.arange(8) / 25)


def test_a_range_of_frames_keeps_their_numbers_and_times(folder: Path):
    recording = Recording.open(folder, frames=(3, 6))
    assert numbers(recording) == [(n, [n, n]) for n in (3, 4, 5)]
    assert [time for _, time, _ in recording] == pytest.approx([0.12, 0.16, 0.2])
    assert Recording.open(folder, frames=(6, None)).frame_count == 2


def test_backgrounds_are_videos_or_stills_or_missing(folder: Path):
    backgrounds = Recording.open(folder).backgrounds()
    assert {name: len(list(one)) for name, one in backgrounds.items()} == {"cam_1": 3, "cam_2": 1}
    (folder / "background/cam_2.png").unlink()
    assert list(Recording.open(folder).backgrounds()) == ["cam_1"]


def test_a_folder_of_frames_is_sorted_by_number(folder: Path):
    for name in ("cam_1", "cam_2"):
        (folder / f"{name}.avi").unlink()
        write_stills(folder / name, 12)
    recording = Recording.open(folder, fps=10)
    assert numbers(recording) == [(n, [n, n]) for n in range(12)]
    assert recording.fps == 10
    with pytest.raises(InputError, match="--fps"):
        Recording.open(folder)


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_images_of_more_than_eight_bits_keep_the_upper_eight(tmp_path: Path, bits: int):
    dim, bright = (np.full((HEIGHT, WIDTH), level << (bits - 8), np.uint16) for level in (70, 200))
    for number, image in enumerate((dim, bright)):
        cv2.imwrite(str(tmp_path / f"{number}.png"), image)
    assert [frame.max() for frame in FrameReader.open(tmp_path)] == [70, 200]


def test_some_cameras(folder: Path):
    write_video(folder / "cam_9.avi", 5)
    assert Recording.open(folder, cameras=["cam_2"]).rig.names == ("cam_2",)


def test_a_body_of_the_subject_is_a_name_or_a_file_beside_it(folder: Path):
    (folder / "subject.toml").write_text('body = "92A5"\n')
    assert Recording.open(folder).subject.body == "92A5"
    (folder / "subject.toml").write_text('body = "me.toml"\n')
    with pytest.raises(InputError, match=r"body file .*me\.toml is missing"):
        Recording.open(folder)
    (folder / "me.toml").touch()
    assert Recording.open(folder).subject.body == str((folder / "me.toml").resolve())


@pytest.mark.parametrize("date", ["2026-11-28", '"2026-11-28"', "2026-11-28T10:30:00Z"])
def test_who_when_and_remarks_are_handed_on(folder: Path, date: str):
    text = f'name = "S07"\ndate = {date}\nremarks = """\nbarefoot;\nleft knee operated"""\n'
    (folder / "subject.toml").write_text(text)
    subject = Recording.open(folder).subject
    assert (subject.name, subject.date) == ("S07", datetime.date(2026, 11, 28))
    assert subject.remarks == "barefoot;\nleft knee operated"
    (folder / "subject.toml").write_text('remarks = " "\n')
    assert Recording.open(folder).subject.remarks is None


def test_subject_and_regions(folder: Path):
    (folder / "subject.toml").write_text('stature = 1.62\nchest_girth = 0.9\nsex = "female"\n')
    (folder / "regions").mkdir()
    region = np.zeros((HEIGHT, WIDTH), np.uint8)
    region[:, 20:] = 255
    cv2.imwrite(str(folder / "regions/cam_1.png"), region)
    recording = Recording.open(folder)
    subject = recording.subject
    assert (subject.stature_m, subject.chest_girth_m, subject.sex) == (1.62, 0.9, "female")
    regions = recording.regions()
    assert list(regions) == ["cam_1"]
    np.testing.assert_array_equal(regions["cam_1"], region > 0)


def test_timestamps_give_rate_and_times(folder: Path):
    write_times(folder, {k: [100 + n / 20 + 0.001 * k for n in range(8)] for k in (1, 2)})
    recording = Recording.open(folder)
    assert recording.fps == pytest.approx(20)
    np.testing.assert_allclose(recording.times_s, np.arange(8) / 20)


def write_times(folder: Path, times: dict[str, list[float]] | dict[int, list[float]]) -> None:
    """A table of the times in seconds of cameras, by their names or numbers."""
    seconds = {str(camera): np.array(one) for camera, one in times.items()}
    write_timestamps(folder / "timestamps.csv", seconds)


def test_timestamps_put_a_late_camera_in_step(folder: Path):
    write_times(
        folder, {"cam_1": [n / 25 for n in range(8)], "cam_2": [(n + 2.3) / 25 for n in range(8)]}
    )
    recording = Recording.open(folder)
    assert numbers(recording) == [(step, [step + 2, step]) for step in range(6)]
    np.testing.assert_allclose(recording.times_s, np.arange(6) / 25)
    assert numbers(Recording.open(folder, frames=(2, 4))) == [(2, [4, 2]), (3, [5, 3])]
    assert [number_of(frames["cam_1"]) for frames in recording.at([1, 4])] == [3, 6]


def test_timestamps_put_cameras_of_different_rates_and_lengths_in_step(folder: Path):
    write_video(folder / "cam_2.avi", 5, fps=12.5)
    write_times(
        folder, {"cam_1": [n / 25 for n in range(8)], "cam_2": [0.015 + n / 12.5 for n in range(5)]}
    )
    recording = Recording.open(folder)
    assert recording.fps == pytest.approx(12.5)
    assert numbers(recording) == [(0, [0, 0]), (1, [2, 1]), (2, [4, 2]), (3, [6, 3])]


def test_a_frame_that_comes_twice_is_not_drawn_on_twice(folder: Path):
    frames = []
    for frame in Recording.open(folder).readers["cam_1"].select([1, 1, 4]):
        frames.append(number_of(frame))
        frame[:] = 255
    assert frames == [1, 1, 4]


def written(name: str, text: str) -> Callable[[Path], object]:
    """Writes a text into a file of the folder."""
    return lambda folder: (folder / name).write_text(text)


BAD: dict[str, tuple[Callable[[Path], object], str]] = {
    "no folder": (lambda f: f.rename(f.with_name("moved")), "is not a recording"),
    "no videos": (lambda f: [path.unlink() for path in f.glob("*.avi")], "holds no video"),
    "video missing": (lambda f: (f / "cam_2.avi").unlink(), "camera cam_2 of .* has no video"),
    "video unreadable": (
        lambda f: (f / "cam_2.avi").write_bytes((f / "cam_2.avi").read_bytes()[:100]),
        "cam_2.avi cannot be read as a video",
    ),
    "calibration missing": (
        lambda f: (f / "calibration.toml").unlink(),
        "holds no calibration.*beginning with `voxelpose calibrate board`",
    ),
    "neither calibration nor a second camera": (
        lambda f: [(f / name).unlink() for name in ("calibration.toml", "cam_2.avi")],
        "holds no calibration: one camera needs none.*`voxelpose track .* --camera cam_1`",
    ),
    "camera not calibrated": (
        lambda f: write_calibration(f / "calibration.toml", ("cam_1",)),
        "camera cam_2 has no calibration",
    ),
    "unit unknown": (lambda f: write_calibration(f / "calibration.toml", unit=None), "unit"),
    "other size": (
        lambda f: write_video(f / "cam_2.avi", size=(64, 48)),
        "64 x 48 px, but camera cam_2 was calibrated at 96 x 64",
    ),
    "other length": (
        lambda f: write_video(f / "cam_2.avi", 5),
        r"cam_1 8, cam_2 5 frames\).*--frames 0:5",
    ),
    "other rate": (
        lambda f: write_video(f / "cam_2.avi", fps=30),
        "differ in rate .*cam_1 25, cam_2 30",
    ),
    "name that is no text": (
        lambda f: (f / "cam_1.avi").rename(f / "cam_\udcff.avi"),
        "is not UTF-8: rename it",
    ),
    "two of one name": (lambda f: write_stills(f / "cam_2"), "both cam_2 and cam_2.avi"),
    "late camera": (
        lambda f: write_times(f, {k: [n / 20 + 3 * k for n in range(8)] for k in (1, 2)}),
        "at no moment all cameras filmed",
    ),
    "too few times": (
        written("timestamps.csv", "cam_id,frame_time\n1,0\n"),
        "1 times for camera cam_1",
    ),
    "no table of times": (written("timestamps.csv", "a,b\n1,0\n"), "no column cam_id"),
    "subject misspelt": (written("subject.toml", "statue = 1.7"), "statue is not known"),
    "subject in centimetres": (
        written("subject.toml", "stature = 170"),
        "stature = 170 is impossible",
    ),
    "date of nobody": (
        written("subject.toml", 'date = "28.11.2026"'),
        r"date = 28\.11\.2026 is impossible: write year, month and day",
    ),
    "date by a number": (written("subject.toml", "date = 2026"), "date = 2026 is impossible"),
    "endless remarks": (
        written("subject.toml", f'remarks = "{"a" * 4001}"'),
        "is impossible: give text of at most 4000 characters",
    ),
    "subject no toml": (written("subject.toml", "stature: 1.7"), "no valid TOML"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named_in_one_line(folder: Path, case: str):
    spoil, message = BAD[case]
    spoil(folder)
    with pytest.raises(InputError, match=message) as caught:
        Recording.open(folder)
    assert "\n" not in str(caught.value)


def test_frames_outside_the_recording(folder: Path):
    for frames in ((0, 9), (5, 5), (-1, 3)):
        with pytest.raises(InputError, match="8 frames"):
            Recording.open(folder, frames=frames)
    write_video(folder / "cam_2.avi", 5)
    assert Recording.open(folder, frames=(0, 5)).frame_count == 5
    with pytest.raises(InputError, match=r"cam_2.avi has 5 frames"):
        Recording.open(folder, frames=(0, 6))


def test_a_background_of_another_size_is_refused(folder: Path):
    write_video(folder / "background/cam_1.avi", size=(64, 48))
    with pytest.raises(InputError, match=r"background.cam_1.avi is 64 x 48 px"):
        Recording.open(folder).backgrounds()


def test_a_frame_of_another_size_is_named(folder: Path):
    for name in ("cam_1", "cam_2"):
        (folder / f"{name}.avi").unlink()
        write_stills(folder / name)
    cv2.imwrite(str(folder / "cam_2/frame_5.png"), picture(0, (30, 20)))
    with pytest.raises(InputError, match="frame 5 is 30 x 20 px"):
        list(Recording.open(folder, fps=25))


def test_stopping_early_leaves_no_thread(folder: Path):
    before = threading.active_count()
    steps = iter(Recording.open(folder))
    next(steps)
    steps.close()  # type: ignore[attr-defined]
    assert threading.active_count() == before


def test_shared_recordings_open(shared: Path):
    recording = Recording.open(shared / "data/walk4", frames=(70, 78))
    assert recording.rig.names == ("cam_0", "cam_1", "cam_2", "cam_3")
    assert sorted(recording.backgrounds()) == ["cam_0", "cam_1", "cam_2", "cam_3"]
    assert not recording.silhouettes_given
    assert [index for index, _, _ in recording] == list(range(70, 78))


def promise(path: Path, frames: int) -> None:
    """Lets the header of a video say a number of frames."""
    data = path.read_bytes()
    for chunk, offset in ((b"avih", 24), (b"strh", 40)):
        at = data.index(chunk) + offset
        data = data[:at] + frames.to_bytes(4, "little") + data[at + 4 :]
    path.write_bytes(data)


def test_the_recording_ends_with_the_frames_that_there_are(folder: Path):
    assert Recording.open(folder).notes == ()
    promise(folder / "cam_1.avi", 9)
    write_video(folder / "cam_2.avi", 9)
    write_times(folder, {name: [n / 25 for n in range(9)] for name in ("cam_1", "cam_2")})
    recording = Recording.open(folder)
    assert (recording.frame_count, sum(1 for _ in recording)) == (8, 8)
    (folder / "timestamps.csv").unlink()
    recording = Recording.open(folder)
    assert (recording.frame_count, sum(1 for _ in recording)) == (8, 8)
    assert recording.notes == (
        f"{folder / 'cam_1.avi'} promises 9 frames and holds 8: the recording ends with them",
    )
    promise(folder / "cam_1.avi", 20)
    write_video(folder / "cam_2.avi", 20)
    with pytest.raises(InputError, match=r"cam_1 8, cam_2 20 frames"):
        Recording.open(folder)
    (note,) = Recording.open(folder, frames=(0, 8)).notes
    assert note.endswith("cam_1.avi promises 20 frames and holds 8: it seems to be damaged")


def test_an_empty_piece_amid_a_video_is_no_frame(shared: Path):
    recording = Recording.open(shared / "data/le2i_c2", cameras=["cam_1"])
    assert (recording.frame_count, sum(1 for _ in recording)) == (203, 203)
    assert "promises 204 frames and holds 203" in recording.notes[0]


def test_a_camera_without_a_position_is_named_or_left_out(folder: Path):
    path = folder / "calibration.toml"
    head, second = path.read_text().split("[cam_2]")
    lens = "\n".join(line for line in second.splitlines() if "tion = " not in line)
    path.write_text(f"{head}[cam_2]{lens}")
    with pytest.raises(InputError, match=r"cam_2: has a lens and no position: .*--cameras"):
        Recording.open(folder)
    with pytest.raises(InputError, match="cam_2: has a lens and no position"):
        Recording.open(folder, cameras=["cam_2"])
    recording = Recording.open(folder, cameras=["cam_1"])
    assert recording.rig.names == ("cam_1",)
    assert recording.camera_names == ("cam_1", "cam_2")
