"""Cameras that fail during a whole session; the third of three is on the network."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.sources import ring, write_staged
from tests.voxelpose.live.network_camera import NetworkCamera
from tests.voxelpose.live.sessions import MOTION, running, wait_until
from voxelpose.live.camera_source import CameraSource
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.live_input import open_input
from voxelpose.live.session import SessionSettings
from voxelpose.recording.folder import Recording
from voxelpose.recording.subject import Subject

RIG = ring(3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_staged(tmp_path_factory.mktemp("live") / "staged", MOTION, RIG)


@pytest.fixture(scope="module")
def seen(folder: Path) -> np.ndarray:
    """What the camera on the network sees."""
    _, _, frames = next(iter(Recording.open(folder)))
    return frames["cam_3"].copy()


@pytest.fixture
def camera(seen: np.ndarray) -> Iterator[NetworkCamera]:
    camera = NetworkCamera(picture=seen)
    yield camera
    camera.close()


def with_camera(folder: Path, camera: NetworkCamera) -> SessionSettings:
    settings = open_input(folder, [], None).settings(Subject(1.7))
    source = CameraSource("cam_3", camera.address)
    return replace(settings, loop=True, sources={**settings.sources, "cam_3": source})


def latest(frames: list[LiveFrame]) -> set[str]:
    """Cameras of the latest frame in which the body was found."""
    return set(frames[-1].silhouettes) if frames and frames[-1].body is not None else set()


def test_a_camera_that_was_covered_takes_part_again(folder, seen, camera):
    with running(with_camera(folder, camera)) as (_, _, frames):
        wait_until(lambda: latest(frames) == set(RIG.names))
        camera.picture = np.zeros_like(seen)
        wait_until(lambda: latest(frames) == {"cam_1", "cam_2"})
        camera.picture = seen
        wait_until(lambda: latest(frames) == set(RIG.names))


def test_a_camera_at_half_the_rate_sets_the_pace(folder, seen):
    """Every moment has all cameras; none is older than half of the faster ones' interval."""
    slow = NetworkCamera(picture=seen, interval_s=0.08)
    try:
        with running(with_camera(folder, slow)) as (session, _, frames):
            wait_until(lambda: latest(frames) == set(RIG.names))
            first = len(frames)
            wait_until(lambda: len(frames) > first + 25)
            assert session.state.cameras == dict.fromkeys(RIG.names, "ok")
            whole = [set(frame.silhouettes) == set(RIG.names) for frame in frames[first:]]
            times = np.array([frame.time_s for frame in frames[first:]])
    finally:
        slow.close()
    assert np.mean(whole) > 0.9
    assert 0.06 < np.median(np.diff(times)) < 0.13
