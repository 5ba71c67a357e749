"""Names of images: counters, times, both, and names that are asked about."""

import random
from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from tests.voxelpose.recording.test_folder import numbers, picture, write_calibration
from voxelpose.recording.folder import Recording
from voxelpose.recording.image_names import in_order, names_by_camera

EPOCH_S = 1_700_000_000.35
COUNT = 60
LOST = (4, 5, 40)
KEPT = [n for n in range(COUNT) if n not in LOST]


def moment(number: int) -> datetime:
    return datetime(2024, 1, 1, 11, 59, 59, 300000) + timedelta(seconds=number / 30)


def stamp(form: str) -> Callable[[int], str]:
    return lambda number: moment(number).strftime(form)


def seconds(number: int) -> float:
    return EPOCH_S + number / 30


def parts(number: int) -> tuple[int, int]:
    """Seconds and microseconds."""
    return divmod(round(seconds(number) * 10**6), 10**6)


TIMES: dict[str, Callable[[int], str]] = {
    "decimals": lambda n: f"{seconds(n):.6f}",
    "decimals without trailing zeros": lambda n: repr(round(seconds(n), 4)),
    "from 0, as short as can be": lambda n: f"{n / 30:.6g}",
    "negative": lambda n: f"{(n - 10) / 30:.4f}",
    "a comma": lambda n: f"{seconds(n):.4f}".replace(".", ","),
    "padded microseconds": lambda n: "cam1_{}_{:06d}".format(*parts(n)),
    "microseconds": lambda n: "{}_{}".format(*parts(n)),
    "microseconds after a point": lambda n: "{}.{}".format(*parts(n)),
    "milliseconds of an epoch": lambda n: f"{round(seconds(n) * 10**3)}",
    "microseconds of an epoch": lambda n: f"img{round(seconds(n) * 10**6)}",
    "nanoseconds of an epoch": lambda n: f"{round(seconds(n) * 10**9)}_left",
    "counter and time": lambda n: f"{KEPT.index(n):04d}_{seconds(n):.6f}",
    "unpadded counter and time": lambda n: f"{KEPT.index(n)}_{seconds(n):.6f}",
    "time and counter": lambda n: f"{seconds(n):.6f}_{KEPT.index(n)}",
    "counter of the camera and time": lambda n: f"{n}_{seconds(n):.6f}",
    "date and time": stamp("%Y-%m-%dT%H-%M-%S.%f"),
    "as isoformat writes it": lambda n: moment(n).isoformat().replace(":", "_"),
    "UTC": stamp("%Y-%m-%dT%H-%M-%S.%fZ"),
    "in a time zone": stamp("%Y-%m-%d %H.%M.%S.%f+0200"),
    "compact": stamp("IMG_%Y%m%d_%H%M%S_%f"),
    "digits alone": stamp("%Y%m%d%H%M%S%f"),
    "unpadded": lambda n: f"1-1-{moment(n):%Y-%m-%d_%H-%M-%S}-{moment(n).microsecond // 1000}",
    "time of day": stamp("%H-%M-%S.%f"),
    "compact time of day": stamp("cam1_%H%M%S_%f"),
    "hours, minutes, seconds": stamp("%Hh%Mm%Ss%f"),
    "a German date": stamp("%d.%m.%Y_%H-%M-%S-%f"),
    "a date without its century": stamp("%y%m%d_%H%M%S_%f"),
    "half days": lambda n: f"{moment(n):%m-%d-%Y at %I.%M.%S.%f} {'ap'[n > 20]}m",
    "past one": lambda n: f"{moment(n) + timedelta(hours=1):%Y-%m-%d at %I.%M.%S.%f} PM",
    "Basler's": lambda n: f"acA__230__{moment(n):%Y%m%d_%H%M%S%f}_{KEPT.index(n):04d}",
    "timecode": lambda n: f"01_00_{(n + 70) // 30:02d}_{(n + 70) % 30:02d}",
    "over midnight": lambda n: f"{moment(n) + timedelta(hours=12):%H_%M_%S_%f}",
}


def read(names: list[str]):
    """Names in their order, and what they tell."""
    shuffled = [Path(f"cam_1/{name}.png") for name in names]
    random.Random(1).shuffle(shuffled)
    ordered = in_order(shuffled)
    return [path.stem for path in ordered], names_by_camera({"cam_1": ordered})["cam_1"]


@pytest.mark.parametrize("case", TIMES)
def test_times_are_read(case: str):
    names = [TIMES[case](n) for n in KEPT]
    ordered, reading = read(names)
    assert ordered == names
    assert reading is not None and reading.kind == "time"
    passed = reading.values - reading.values[0]
    np.testing.assert_allclose(passed, np.array(KEPT) / 30, atol=0.0011)
    assert reading.lost.sum() == len(LOST)


@pytest.mark.parametrize("form", ["%Y-%m-%d_%H-%M-%S.%f", "%H%M%S_%f"])
@pytest.mark.parametrize("hours", [1, -1])
def test_clocks_that_are_put_on_or_back_go_on(form: str, hours: int):
    moments = [moment(n) + timedelta(hours=hours * (n > COUNT // 2)) for n in KEPT]
    names = [f"{when:{form}}" for when in moments]
    ordered, reading = read(names)
    assert ordered == names
    assert reading is not None and reading.lost.sum() == len(LOST)


COUNTERS: dict[str, Callable[[int], str]] = {
    "padded": lambda n: f"a_{n:04d}",
    "unpadded": lambda n: f"img_{n}",
    "after a camera's number": lambda n: f"cam1.{n:03d}",
    "after a take's number": lambda n: f"take1.{n}",
    "after a take's number, past ten": lambda n: f"take1.{n + 8}",
    "negative": lambda n: f"{n - 10}",
    "after a dash": lambda n: f"frame-{n}",
    "hexadecimal": lambda n: f"f_{n:04x}",
    "hexadecimal, upper case, unpadded": lambda n: f"cam_{n:X}_left",
    "letters that are digits": lambda n: f"face{n:02d}",
    "beside a date": lambda n: stamp("%Y%m%d_%H%M%S_")(n) + f"{n:04d}",
    "before a date": lambda n: f"{n}_" + stamp("%Y-%m-%d %H.%M.%S")(n),
    "beside the number of the stored image": lambda n: f"{KEPT.index(n):06d}_{n:06d}",
    "beside a random number": lambda n: f"{random.Random(n).randrange(10**4)}_{n:03d}",
    "on a clock of unknown unit": lambda n: f"{(77 * 30 + n) * 10**6 // 30}",
    "milliseconds with decimals": lambda n: f"cam1_{n * 1000 / 30:.3f}ms",
    "a part of a second": lambda n: (
        f"cam1_{round(n * 1000 / 30) % 1000:03d}" if n < 29 else f"cam1_{round(n * 1000 / 30)}"
    ),
}


@pytest.mark.parametrize("case", COUNTERS)
def test_counters_are_read(case: str):
    names = [COUNTERS[case](n) for n in KEPT]
    ordered, reading = read(names)
    assert ordered == names
    assert reading is not None and reading.kind in ("number", "ticks")
    assert reading.lost.sum() == len(LOST)


@pytest.mark.parametrize(
    "names",
    [
        ["a", "b", "c"],
        ["a1", "z"],
        ["1.8", "1.9", "1.10", "2.0", "2.1"],
        ["1a", "1b", "2a", "2b"],
        [f"{n // 60:02d}m{n % 60:02d}.{n % 7}s" for n in range(50, 80)],
        ["seq1_8", "seq1_9", "seq2_0", "seq2_1"],
        ["##1", "1#2", "a#b"],
        ["9" * 30, "99"],
        [f"{random.Random(n).getrandbits(64):016x}" for n in range(40)],
        ["²1³2", "x"],
    ],
)
def test_other_names_tell_nothing(names: list[str]):
    assert read(names)[1] is None


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (["1", "2", "preview", "3"], r"holds preview\.png among images .* named as 1\.png: move"),
        (["01", "1", "2"], "holds 2 images of the number 1: remove"),
        ([f"{n:04d}_{EPOCH_S + k / 30:.3f}" for k, n in enumerate(KEPT)], "the number .*disagree"),
    ],
)
def test_what_may_be_read_otherwise_is_asked_about(names: list[str], words: str):
    with pytest.raises(InputError, match=words) as refused:
        read(names)
    assert "\n" not in str(refused.value)


def images(folder: Path, names: dict[str, list[str]], suffix: str = ".png") -> Path:
    """Writes images that tell their number, of the cameras' frames with these names."""
    write_calibration(folder / "calibration.toml")
    for camera, stems in names.items():
        (folder / camera).mkdir()
        for number, stem in enumerate(stems):
            if stem:
                cv2.imwrite(str(folder / camera / f"{stem}{suffix}"), picture(number))
    return folder


def test_frames_are_paired_by_the_times_in_their_names(tmp_path: Path):
    def stems(lost: int, late_s: float) -> list[str]:
        names = [f"{EPOCH_S + n / 10 + late_s:.4f}" for n in range(20)]
        return [*names[:lost], "", "", *names[lost + 2 :]]

    folder = images(tmp_path, {"cam_1": stems(3, 0), "cam_2": stems(9, 0.004)}, ".JPG")
    for fps in (None, 10):
        recording = Recording.open(folder, fps=fps)
        left = [n for n in range(20) if n not in (3, 4, 9, 10)]
        assert numbers(recording) == [(n, [n, n]) for n in left]
        assert recording.fps == pytest.approx(10)
        words = "by the times in the names of the images, cam_1, cam_2 lost 2 images: frames are"
        assert recording.notes[0].startswith(words)
    notes = Recording.open(folder, fps=20).notes
    assert notes[0].endswith("10 were taken per second: --fps 20 is used")


def test_times_within_one_second_are_of_the_clock_that_others_tell(tmp_path: Path):
    stems = [f"{8.5 + n / 20:.2f}" for n in range(16)]
    folder = images(tmp_path, {"cam_1": stems[4:], "cam_2": stems[:8]})
    with pytest.raises(InputError, match="did not stop together"):
        Recording.open(folder)
    recording = Recording.open(folder, frames=(0, 8))
    assert numbers(recording) == [(n, [n - 4, n]) for n in range(4, 8)]


def test_cameras_whose_names_tell_different_things(tmp_path: Path):
    plain = [f"{n:03d}" for n in range(8)]
    folder = images(tmp_path, {"cam_1": [f"{8 + n / 4:.2f}" for n in range(8)], "cam_2": plain})
    assert "paired in the order of the names" in Recording.open(folder, fps=4).notes[0]
    (folder / "cam_1" / "8.75.png").unlink()
    (folder / "cam_2" / "007.png").unlink()
    with pytest.raises(InputError, match=r"by theirs cam_1 lost some: name them alike"):
        Recording.open(folder, fps=4)


def test_names_that_tell_nothing_are_paired_by_order_and_said(tmp_path: Path):
    folder = images(tmp_path, {"cam_1": ["ab", "cd", "x"], "cam_2": ["a", "b", "c"]})
    (note,) = Recording.open(folder, fps=4).notes
    assert "cam_1, cam_2 tell neither numbers nor times: frames are taken in the order" in note


@pytest.mark.parametrize(("first", "words"), [(2, "number each camera's from 0"), (500, "")])
def test_counters_that_begin_apart(tmp_path: Path, first: int, words: str):
    names = [f"{n:03d}" for n in range(8)], [f"{n + first:03d}" for n in range(8)]
    folder = images(tmp_path, dict(zip(("cam_1", "cam_2"), names, strict=True)))
    if words:
        with pytest.raises(InputError, match=words):
            Recording.open(folder, fps=4)
        return
    (note,) = Recording.open(folder, fps=4).notes
    assert "(cam_1 from 0, cam_2 from 500): the first ones are taken to belong together" in note


def test_two_images_of_one_name_are_asked_about(tmp_path: Path):
    folder = images(tmp_path, {"cam_1": ["0", "1"], "cam_2": ["0", "1"]})
    cv2.imwrite(str(folder / "cam_2" / "1.jpg"), picture(1))
    with pytest.raises(InputError, match=r"cam_2 holds 1\.jpg and 1\.png: remove one"):
        Recording.open(folder, fps=4)
