"""The viewer in a real browser, without a screen."""

import threading

import cv2
import numpy as np
import pytest
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from calib.errors import InputError
from tests.browsing import drawing, new_page
from tests.clips import waving
from tests.other_bodies import write_example_result
from tests.sources import ring, write_staged
from voxelpose.cli import run
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.result_scenes import ResultScenes
from voxelpose.view.viewer.scene import frame_html


@pytest.fixture
def served(desk):
    """A browser's server of a small result, drawing in its own thread."""
    write_staged(desk / "walk", waving(4), ring(3, (320, 240)))
    assert run(["fit", "walk", "--out", "out", "--estimator", "standing", "--no-pictures"]) == 0
    browser = Browser(ResultScenes("out", voxel_size_m=0.04), Address(port=8391), 2)
    with drawing(browser):
        yield browser


@pytest.mark.slow
def test_the_page(served, tmp_path):
    with new_page(900, 600) as (page, faults):
        page.goto(served.url)
        page.get_by_text("Frame 2,").wait_for(timeout=60_000)
        page.locator("canvas").first.wait_for()
        slider = page.get_by_role("slider").first
        assert slider.get_attribute("aria-valuenow") == "2"
        slider.focus()
        page.keyboard.press("ArrowRight")
        page.get_by_text("Frame 3,").wait_for()
        page.keyboard.press("Home")
        page.get_by_text("no pose was found in this frame").wait_for()
        page.keyboard.press("End")
        page.locator("input[value=none]").first.click()
        page.get_by_role("option", name="left thigh").click()
        page.get_by_text("Matched with").wait_for()
        page.wait_for_timeout(500)
        page.screenshot(path=str(tmp_path / "page.png"))
        assert faults == []
    picture = cv2.imread(str(tmp_path / "page.png"))
    assert picture is not None
    renderer = picture[150:, :480].astype(int)
    turquoise = (renderer[..., 0] - renderer[..., 2] > 40) & (
        renderer[..., 1] - renderer[..., 2] > 40
    )
    assert np.count_nonzero(turquoise) > 50  # the movable area is drawn


def test_a_recording_alone_is_served_and_plays(desk, capsys):
    write_staged(desk / "walk", waving(4), ring(3, (320, 240)))
    first, second = (
        Browser(ResultScenes("walk", voxel_size_m=0.05), Address(port=8395), 1) for _ in range(2)
    )
    assert first.url == "http://localhost:8395" and second.url != first.url  # the next free port
    assert first.step(1.0) and "<b>Frame 1," in first._status.content
    assert not first.step(0.01)  # no new choice
    first._play.value = True
    shown = []
    # The clip repeats: the row after six steps depends on the machine's speed.
    for _ in range(6):
        first.step(0.1)
        shown.append(first.choice.row)
    assert len(set(shown)) > 1 and int(first._slider.value) == first.choice.row
    first.close()
    second.close()
    assert capsys.readouterr().out == ""


def test_a_choice_is_drawn_once(served):
    """Without any browser: the panel's choice reaches the scene."""
    served._choose(row=1, shown=served.choice.shown - {"hull"})
    for _ in range(200):
        if served._drawn == served.choice:
            break
        threading.Event().wait(0.05)
    assert (
        served._drawn == served.choice
        and served.choice.row == 1
        and "hull" not in served.choice.shown
    )
    assert "<b>Frame 1," in served._status.content


def test_text_of_a_hostile_result_is_shown_and_not_run(served, desk):
    settings = (desk / "out" / "settings.toml").read_text()
    hostile = "<iframe srcdoc='<script>1</script>'>{alert(1)}"
    lines = [line for line in settings.splitlines() if not line.startswith("recording")]
    (desk / "out" / "settings.toml").write_text("\n".join([f'recording = "{hostile}"', *lines]))
    scenes = ResultScenes("out", voxel_size_m=0.04)
    shown = frame_html(scenes.scene(1))
    assert "<iframe" not in shown and "<script" not in shown
    assert "&lt;iframe" in shown
    scenes.close()


def test_another_site_cannot_listen(served):
    address = served.url.replace("http://", "ws://")
    with pytest.raises(InvalidStatus, match="403"):
        connect(address, origin="http://evil.example", open_timeout=5)


@pytest.mark.slow
def test_another_site_cannot_frame_the_page(served, tmp_path):
    """Its visitors would press the page's buttons."""
    frames = "".join(
        f"<iframe src='{served.url}/{path}'></iframe>" for path in ("", "silhouettes/")
    )
    (tmp_path / "site.html").write_text(f"<h1>a site</h1>{frames}")
    with new_page(900, 600) as (page, faults):
        page.goto((tmp_path / "site.html").as_uri())
        page.wait_for_timeout(1500)
        assert [frame.evaluate("document.body.innerText") for frame in page.frames[1:]] != []
        for frame in page.frames[1:]:
            assert not frame.url.startswith(served.url)
        refused = [fault for fault in faults if "frame-ancestors" in fault]
        assert len(refused) == 2


def test_other_machines_need_a_token(served):
    with pytest.raises(InputError, match="protect the page with --token"):
        Address("0.0.0.0", 8399)
    with pytest.raises(InputError, match=r"--host no\.such\.name\.invalid"):
        Browser(served.scenes, Address("no.such.name.invalid", 8399, "a long one"), 1)


@pytest.mark.slow
def test_the_page_of_an_animal(desk):
    """Its own parts are offered, and seen from as far as its size asks for."""
    _, motion = write_example_result(desk, "quadruped", pictures=False)
    browser = Browser(ResultScenes("quadruped_fit", voxel_size_m=0.04), Address(port=8392), 2)
    camera = np.array(browser.server.initial_camera.position)
    away_m = np.linalg.norm(camera - np.median(motion.root_m, axis=0))
    assert 1.5 < away_m / motion.model.extent_m < 2.2
    with drawing(browser), new_page(900, 600) as (page, faults):
        page.goto(browser.url)
        page.get_by_text("Frame 2,").wait_for(timeout=60_000)
        page.locator("canvas").first.wait_for()
        page.locator("input[value=none]").first.click()
        page.get_by_role("option", name="left hind upper").click()
        page.get_by_text("The left hind upper could be").wait_for()
        assert not faults
