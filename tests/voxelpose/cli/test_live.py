"""voxelpose live as a process: what it sends, records and says, and how it ends."""

import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from benchmarks.live import Receiver
from tests.browsing import new_page
from tests.clips import waving
from tests.sources import ring, write_recording, write_staged
from tests.voxelpose.live.test_live_page import canvas_picture
from voxelpose.cli import run
from voxelpose.recording.folder import Recording

RIG = ring(4, (320, 240))
MOTION = waving(60)
FPS = 8


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of somebody who walks and waves."""
    return write_staged(tmp_path_factory.mktemp("live") / "studio", MOTION, RIG)


def posed(receiver: Receiver) -> list[dict]:
    """Messages with a body."""
    return [message for _, message in receiver.messages if message["body"] is not None]


@contextmanager
def living(*arguments: object) -> Iterator[subprocess.Popen]:
    """The command as a process, which does not outlive the test."""
    command = [sys.executable, "-m", "voxelpose", "live", *map(str, arguments)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def wait_until(true, process: subprocess.Popen, seconds: float = 120.0) -> None:
    """Waits for a condition while a process runs."""
    end_s = time.monotonic() + seconds
    while not true():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end_s, "it did not happen in time"
        time.sleep(0.05)


@pytest.mark.slow
def test_motion_is_sent_shown_and_recorded_until_the_interrupt(studio, tmp_path):
    take, receiver = tmp_path / "take", Receiver()
    # Slowly, so that a busy machine keeps up.
    options = ("--loop", "--no-browser", "--stature", 1.7, "--fps", FPS, "--port", 8431)
    recording = ("--record", take, "--no-record-now", "--countdown", 600)
    sending = ("--send", receiver.address, "--send", "ws://127.0.0.1:9/nobody")
    words = (studio, *options, *recording, *sending)
    with new_page(1000, 520) as (browser, faults), living(*words) as process:
        url = ""
        while not url:
            line = process.stderr.readline()  # type: ignore[union-attr]
            assert line, "the session ended"
            url = line.split()[1] if line.startswith("page: ") else ""
        browser.goto(url)
        assert browser.title() == f"{studio.name} – voxelpose live"
        browser.get_by_text("following", exact=True).first.wait_for(timeout=90_000)
        first = canvas_picture(browser)
        # The figure moves.
        wait_until(lambda: np.abs(canvas_picture(browser) - first).max() > 40, process)
        wait_until(lambda: len(posed(receiver)) > 15, process)
        check_motion(posed(receiver))
        for button, text in (
            ("Stop", "stopped"),
            ("Start", "following"),
            ("Record", "● recording"),
            ("End recording", "frames recorded"),
            ("Background", "step out of the picture"),
        ):
            browser.get_by_role("button", name=button, exact=True).click()
            browser.get_by_text(text).first.wait_for(timeout=60_000)
        process.send_signal(signal.SIGINT)
        said, progress = process.communicate(timeout=60)
        assert process.returncode == 0, progress
        assert "frames estimated" in said and "estimation" in said and "following" in progress
        assert faults == []
    receiver.close()
    recorded = Recording.open(take)
    assert len(list(recorded)) == recorded.frame_count > 0


def check_motion(messages: list[dict]) -> None:
    """A wave of half a metre is followed to a hand's breadth."""
    errors, truth = [], MOTION.landmarks()
    for message in messages[3:]:
        row = round(message["time_s"] * FPS) % len(MOTION)
        joints = np.array([joint["position_m"] for joint in message["body"]["joints"].values()])
        errors.append(np.linalg.norm(joints - truth[row], axis=1).mean())
    assert np.median(errors) < 0.06


@pytest.mark.slow
@pytest.mark.parametrize("after_s", [0.3, 3.0])
def test_sigterm_ends_it_at_any_moment(studio, tmp_path, after_s):
    take = tmp_path / "take"
    with living(studio, "--loop", "--no-page", "--record", take) as process:
        time.sleep(after_s)
        process.send_signal(signal.SIGTERM)
        _, progress = process.communicate(timeout=60)
    assert process.returncode in (0, 130, -signal.SIGINT, -signal.SIGTERM), progress
    assert "Traceback" not in progress
    if take.exists() and any((take / "cam_1").iterdir()):
        Recording.open(take)


@pytest.mark.slow
def test_nothing_outlives_a_killed_session(studio):
    with living(studio, "--loop", "--no-page", "--fps", FPS) as process:
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        if not children.exists():
            pytest.skip("this system does not list a process's children")
        wait_until(lambda: len(children.read_text().split()) > 0, process)
        pids = [int(pid) for pid in children.read_text().split()]
        process.kill()
        process.wait()
    end_s = time.monotonic() + 30
    while any(Path(f"/proc/{pid}").exists() for pid in pids):
        assert time.monotonic() < end_s, "a process was left behind"
        time.sleep(0.1)


@pytest.fixture
def room(desk: Path) -> Path:
    write_recording(desk / "walk", RIG, 3)
    return desk


def test_the_button_records_where_no_folder_is_given(room, monkeypatch):
    class Begun(Exception):
        """A session with these settings."""

    def begin(settings, _):
        raise Begun(settings)

    monkeypatch.setattr("voxelpose.live.session.LiveSession", begin)
    monkeypatch.setattr("voxelpose.live.live_input.make_estimator", lambda *_: None)
    for given, name in (([], r"live_[\d-]{10}_[\d-]{8}"), (["--record", "mine"], "mine")):
        with pytest.raises(Begun) as begun:
            run(["live", "walk", "--no-page", *given])
        assert re.fullmatch(name, str(begun.value.args[0].record))


def test_a_folder_that_is_not_there_is_refused_before_anything_is_loaded(room):
    code = """
import sys
from voxelpose.cli import run
assert run(["live", "wolk"]) == 2
print([name for name in ("cv2", "numba", "scipy") if name in sys.modules])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "give a recording folder, or --source"),
        (["walk", "--camera", "cam_9"], "cam_9"),
        (["walk", "--camera", "cam_1", "--cameras", "cam_1"], "exclude each other"),
        (["walk", "--source", "0"], "write cam_1=0"),
        (["walk", "--source", "cam_7=0"], "no camera cam_7"),
        (["--source", "a=0", "--source", "b=1"], "give the folder that holds calibration.toml"),
        (["wolk"], "there is no folder wolk"),
        (["walk", "--record", "walk"], "walk exists"),
        (["walk", "--send", "udp://1.2.3.4"], "vmc://"),
        (["walk", "--host", "0.0.0.0"], "--token"),
        (["walk", "--people", "7"], "--people 7 is no number of people"),
        (["walk", "--people", "2", "--cameras", "cam_1,cam_2"], "2 cameras are too few to tell 2"),
        (["walk", "--people", "2", "--camera", "cam_1"], "1 camera is too few"),
        (["walk", "--people", "2", "--send", "vmc://a:65535"], "2 people need 2 ports"),
        (["walk", "--duration", "0"], "--duration"),
        (["walk", "--countdown", "-1"], "--countdown"),
        (["walk", "--backend", "nope"], "no backend is called 'nope'"),
        (
            ["walk", "--camera", "cam_1", "--method", "paper", "--outline-only"],
            "no option 'outline_only'",
        ),
    ],
)
def test_mistakes_are_one_line(room, capsys, arguments, said):
    before = sorted(room.rglob("*"))
    assert run(["live", *arguments]) == 2
    error = capsys.readouterr().err.strip().splitlines()[-1]
    assert said in error
    assert sorted(room.rglob("*")) == before
