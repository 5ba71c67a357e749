import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from calib.errors import InputError
from tests.sources import ring, write_recording
from tests.voxelpose.live.network_camera import NetworkCamera
from tests.voxelpose.live.sessions import wait_until
from voxelpose.live.camera_source import CameraReader, CameraSource

SIZE = (160, 120)


class Deliveries:
    """Keeps what a reader delivers."""

    def __init__(self) -> None:
        self.times_s: list[float] = []
        self.sizes: set[tuple[int, ...]] = set()

    def __call__(self, name: str, time_s: float, picture: np.ndarray) -> None:
        self.times_s.append(time_s)
        self.sizes.add(picture.shape[1::-1])


@contextmanager
def reading(address: str, size: tuple[int, int] | None = SIZE, **options) -> Iterator[tuple]:
    """A reader at work, and what it has delivered."""
    started_s, deliveries = time.monotonic(), Deliveries()
    reader = CameraReader(
        CameraSource("cam_1", address),
        size,
        deliveries,
        lambda: time.monotonic() - started_s,
        **options,
    )
    reader.start()
    try:
        yield reader, deliveries
    finally:
        reader.stop()
        reader.join()


@pytest.mark.parametrize(
    ("text", "name", "address", "kind"),
    [
        ("0", "", "0", "webcam"),
        ("cam_1=2", "cam_1", "2", "webcam"),
        (
            "cam_1=rtsp://10.0.0.2/live?channel=1",
            "cam_1",
            "rtsp://10.0.0.2/live?channel=1",
            "stream",
        ),
        ("http://10.0.0.2/video?a=b", "", "http://10.0.0.2/video?a=b", "stream"),
    ],
)
def test_addresses(text, name, address, kind):
    source = CameraSource.parse(text)
    assert (source.name, source.address, source.kind) == (name, address, kind)


@pytest.mark.parametrize("text", ["", "cam_1=", "cam_1=nowhere.mp4", "nowhere.mp4"])
def test_what_is_no_camera_is_refused(text):
    with pytest.raises(InputError):
        CameraSource.parse(text)


def test_a_file_is_played_at_its_rate_and_ends(tmp_path):
    # At 20 a second a busy machine is late by two pictures, which are then left out.
    video = write_recording(tmp_path / "r", ring(1), 6, 5.0) / "cam_1.mp4"
    with reading(str(video)) as (reader, deliveries):
        wait_until(lambda: reader.state == "ended")
    assert np.allclose(deliveries.times_s, np.arange(6) / 5)


def test_a_file_begins_again(tmp_path):
    video = write_recording(tmp_path / "r", ring(1), 4, 50.0) / "cam_1.mp4"
    with reading(str(video), loop=True) as (_, deliveries):
        wait_until(lambda: len(deliveries.times_s) > 9)
    steps = np.diff(deliveries.times_s)
    assert (steps > 0).all()
    assert np.allclose(steps % (1 / 50), 0, atol=1e-6) or np.isclose(steps.min(), 1 / 50)


def test_a_stream_that_goes_is_tried_again_until_it_is_back():
    stream = NetworkCamera()
    with reading(stream.address) as (reader, deliveries):
        wait_until(lambda: len(deliveries.times_s) > 5)
        assert reader.state == "ok"
        stream.close()
        wait_until(lambda: "trying again" in reader.state)
        before = len(deliveries.times_s)
        stream = NetworkCamera(stream.port)
        wait_until(lambda: len(deliveries.times_s) > before + 5)
        assert reader.state == "ok"
    stream.close()


@pytest.mark.parametrize(
    ("options", "said"), [({"grey": 0}, "black"), ({"size": (160, 160)}, "calibrated at 160 x 120")]
)
def test_useless_pictures_are_said_and_not_delivered(options, said):
    stream = NetworkCamera(**options)
    with reading(stream.address) as (reader, deliveries):
        wait_until(lambda: said in reader.state)
        assert not deliveries.times_s
    stream.close()


def test_a_larger_picture_of_the_same_shape_is_scaled():
    stream = NetworkCamera(size=(320, 240))
    with reading(stream.address) as (_, deliveries):
        wait_until(lambda: len(deliveries.times_s) > 2)
    assert deliveries.sizes == {SIZE}
    stream.close()


def test_without_a_calibration_pictures_are_taken_as_they_come(tmp_path):
    walk = write_recording(tmp_path / "walk", ring(1, (200, 120)))
    with reading(str(walk / "cam_1.mp4"), None) as (reader, deliveries):
        wait_until(lambda: reader.state == "ended")
    assert deliveries.sizes == {(200, 120)}
