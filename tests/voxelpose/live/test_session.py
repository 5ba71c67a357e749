import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from silhouette_core.image import seen_people
from tests.silhouette_core.image.drawn_people import BrightPeople
from tests.sources import ring, write_staged
from tests.voxelpose.live.sessions import MOTION, STANDING, running, wait_until
from voxelpose.live.live_estimators import posed_body
from voxelpose.live.live_frame import hidden_note
from voxelpose.live.live_input import open_input
from voxelpose.live.session import SessionSettings
from voxelpose.recording.folder import Recording
from voxelpose.recording.subject import Subject

RIG = ring(2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_staged(tmp_path_factory.mktemp("live") / "staged", MOTION, RIG)


@pytest.fixture
def settings(folder: Path) -> SessionSettings:
    return open_input(folder, [], None).settings(Subject(1.7))


def test_files_are_played_to_their_end(settings):
    slowly = replace(settings, fps=10.0)  # a busy machine keeps up
    with running(slowly) as (session, _, frames):
        wait_until(lambda: session.wait(0.1))
        state = session.state
    assert state.phase == "following"
    assert len(frames) + state.dropped >= 38
    assert [frame.number for frame in frames] == sorted(frame.number for frame in frames)
    shown = [frame.time_s for frame in frames]
    assert np.allclose(np.mod(np.array(shown) * 10 + 0.5, 1), 0.5, atol=1e-6)
    last = frames[-1]
    assert last.body is not None
    assert set(last.silhouettes) == set(RIG.names)
    spent = session.times.summary()
    assert {"capture", "silhouettes", "waiting", "estimation"} <= set(spent)
    shortest, longest, *_, median, high, _ = spent["total"]
    assert 0 < shortest <= median <= high <= longest


def test_a_session_of_several_people_says_how_many_are_followed(settings):
    with running(replace(settings, people=2)) as (session, estimator, frames):
        estimator.absent = 1
        wait_until(lambda: session.state.phase == "following")
        assert "following 1 of 2 people" in session.state.message
        wait_until(lambda: frames[-1:] != [] and frames[-1].people[-1] is not None)
        assert frames[-1].body is None and frames[-1].note == ""


def test_who_is_hidden_by_others_is_said():
    body = posed_body(MOTION.model, STANDING, 0.9, np.ones(15))
    hidden = replace(body, joint_confidence=np.where(np.arange(15) < 3, 0.4, 0.9))
    assert hidden_note((body, hidden)) == "hidden in part by others: person 2"
    assert hidden_note((body, None)) == hidden_note((hidden,)) == ""


def test_stopping_and_starting(settings):
    with running(replace(settings, loop=True)) as (session, estimator, _):
        wait_until(lambda: session.state.phase == "following")
        session.stop()
        wait_until(lambda: session.state.phase == "stopped")
        time.sleep(0.2)
        seen = estimator.seen
        time.sleep(0.2)
        assert estimator.seen == seen
        session.start()
        wait_until(lambda: session.state.phase == "following")


def test_the_empty_view_is_learned_after_a_countdown(settings, monkeypatch):
    """What stands there while it is learned belongs to the background."""
    monkeypatch.setattr("voxelpose.live.session._LEARNED_FRAMES", 5)
    alone = replace(settings, empty={}, loop=True, countdown_s=0.2)
    with running(alone) as (session, estimator, frames):
        wait_until(lambda: len(frames) > 2)
        assert session.state.phase == "no background"
        assert estimator.seen == 0
        session.start()
        assert "must be learned first" in session.state.message
        session.learn_background()
        assert session.state.phase == "countdown"
        wait_until(lambda: estimator.seen > 3)
        assert session.state.phase in ("searching", "following")


def test_without_an_empty_view_the_network_tells_who_is_there(settings, monkeypatch):
    """Nobody has to step out of the picture."""
    monkeypatch.setattr("voxelpose.live.session._LEARNED_FRAMES", 5)
    monkeypatch.setattr(seen_people, "PoseNetwork", lambda _: BrightPeople(channel=2))
    alone = replace(settings, empty={}, loop=True, network=Path("network"))
    assert alone.asked == RIG.names and settings.asked == ()
    with running(alone) as (session, _, frames):
        session.learn_background()
        assert session.state.phase == "learning" and "walk about" in session.state.message
        wait_until(lambda: session.state.phase == "following", 60)
        wait_until(lambda: frames[-1].body is not None)
        last = frames[-1]
    for name, mask in last.silhouettes.items():
        true = cv2.resize(last.pictures[name][..., 2], mask.shape[::-1]) > 140
        assert (true & mask).sum() > 0.8 * (true | mask).sum()


def test_what_a_stage_raises_ends_the_session(settings):
    with running(replace(settings, loop=True)) as (session, estimator, _):
        estimator.fails_at = 4
        with pytest.raises(RuntimeError, match="a stage that fails"):
            wait_until(lambda: session.wait(0.1))


def test_recording_by_button(settings, folder, tmp_path):
    record = tmp_path / "take"
    with running(replace(settings, loop=True, record=record)) as (session, _, _):
        session.record()
        wait_until(lambda: session.times.frames > 5)
        assert session.state.recording
        session.end_recording()
        assert not session.state.recording
        assert "frames recorded" in session.state.message
        session.record()
        wait_until(lambda: len(list((tmp_path / "take_2").glob("cam_2/*.jpg"))) > 1)
    for name in ("take", "take_2"):
        recording = Recording.open(tmp_path / name)
        assert recording.rig.names == RIG.names
        assert recording.subject.stature_m == 1.7
    first = Recording.open(record)
    assert first.frame_count >= 4
    _, _, frames = next(iter(first))
    _, _, original = next(iter(Recording.open(folder)))
    assert frames["cam_1"].shape == original["cam_1"].shape


def test_recording_without_a_folder_says_so(settings):
    with running(settings) as (session, _, _):
        session.record()
        assert "--record" in session.state.message
        assert not session.state.recording
