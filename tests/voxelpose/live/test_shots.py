import threading

import numpy as np
import pytest

from voxelpose.live.camera_source import Newest, ShotMatcher

PICTURE = np.zeros((2, 2, 3), np.uint8)


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def clock() -> Clock:
    return Clock()


def play(matcher: ShotMatcher, clock: Clock, deliveries: list[tuple[float, str]]) -> list:
    """Delivers pictures by time stamp; returns the times and cameras of the shots."""
    shots = []
    for time_s, name in sorted(deliveries):
        clock.now_s = time_s
        before = matcher.shots._item
        matcher.deliver(name, time_s, PICTURE)
        shot = matcher.shots._item
        if shot is not None and shot is not before:
            shots.append((round(shot.time_s, 3), tuple(shot.pictures)))
    return shots


def stream(name: str, fps: float, count: int, start_s: float = 0.0) -> list[tuple[float, str]]:
    """Time stamps of one camera."""
    return [(start_s + k / fps, name) for k in range(count)]


def test_cameras_out_of_step_are_matched_to_the_nearest(clock):
    matcher = ShotMatcher(["a", "b"], clock)
    shots = play(matcher, clock, stream("a", 30, 30) + stream("b", 30, 30, 0.012))
    assert len(shots) >= 28
    assert all(cameras == ("a", "b") for _, cameras in shots)
    assert np.allclose(np.diff([t for t, _ in shots]), 1 / 30, atol=2e-3)


def test_a_slow_camera_sets_the_rate(clock):
    matcher = ShotMatcher(["a", "b"], clock)
    shots = play(matcher, clock, stream("a", 30, 60) + stream("b", 15, 30, 0.004))
    assert 27 <= len(shots) <= 31
    assert all(cameras == ("a", "b") for _, cameras in shots)


def test_a_silent_camera_is_left_out_until_it_delivers_again(clock):
    matcher = ShotMatcher(["a", "b", "c"], clock)
    gone = [one for one in stream("c", 30, 90, 0.002) if not 0.5 < one[0] < 2.0]
    shots = play(matcher, clock, stream("a", 30, 90) + stream("b", 30, 90, 0.001) + gone)
    cameras = {t: names for t, names in shots}
    assert cameras[min(cameras, key=lambda t: abs(t - 1.5))] == ("a", "b")
    assert cameras[max(cameras)] == ("a", "b", "c")
    times = sorted(cameras)
    assert max(np.diff(times)) < 0.5


def test_too_few_cameras_make_no_shot(clock):
    matcher = ShotMatcher(["a", "b"], clock)
    assert play(matcher, clock, stream("a", 30, 30)) == []


def test_at_first_every_camera_is_waited_for(clock):
    matcher = ShotMatcher(["a", "b", "c"], clock)
    shots = play(matcher, clock, stream("a", 30, 90) + stream("b", 30, 90) + stream("c", 30, 60, 1))
    assert shots[0][0] >= 1.0
    assert all(len(cameras) == 3 for _, cameras in shots)
    matcher = ShotMatcher(["a", "b", "c"], clock)
    shots = play(matcher, clock, stream("a", 30, 90) + stream("b", 30, 90))
    assert shots[0][0] == pytest.approx(2.0, abs=0.05)


def test_the_newest_replaces_what_nobody_took():
    place: Newest[int] = Newest()
    place.put(1)
    place.put(2)
    assert place.take() == 2
    assert place.dropped == 1


def test_closing_wakes_whoever_waits():
    place: Newest[int] = Newest()
    taken: list[object] = []
    thread = threading.Thread(target=lambda: taken.append(place.take()))
    thread.start()
    place.close()
    thread.join(5)
    assert taken == [None]
