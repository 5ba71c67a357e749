"""The viewer in a real browser, without a screen."""

import json
import re
from itertools import combinations
from urllib.error import HTTPError
from urllib.request import urlopen

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from tests.browsing import new_page, until
from tests.clips import waving
from tests.other_bodies import write_example_result
from tests.sources import ring, write_staged
from voxelpose.cli import run
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.result_scenes import OtherResult, ResultScenes

FRAMES = 4


@pytest.fixture
def served(staged):
    """A browser's server of a small result."""
    browser = Browser(ResultScenes("out", voxel_size_m=0.04), Address(port=8391), 2)
    yield browser
    browser.close()


def got(browser: Browser, path: str) -> dict:
    """What the page is answered."""
    with urlopen(f"{browser.url}/{path}", timeout=60) as answer:
        return json.load(answer)


def carved(page) -> None:
    """Waits until the hull of the shown frame is there."""
    page.get_by_text(re.compile(r"^Hull \d+ litres")).wait_for(timeout=60_000)
    page.locator(".follows").wait_for(state="hidden", timeout=60_000)


def shown(page) -> np.ndarray:
    """The scene as it is drawn, (h, w, 3) int BGR."""
    until(page, "!viewer.player.wanted && viewer.player.fine && !viewer.player.viewpoint.flight")
    page.wait_for_timeout(150)
    data = page.locator("canvas.space").screenshot()
    picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None
    return picture.astype(int)


def differing(one: np.ndarray, other: np.ndarray) -> int:
    """Number of pixels that differ clearly."""
    return int(np.count_nonzero(abs(one - other).max(axis=2) > 20))


@pytest.mark.slow
def test_the_page(served):
    with new_page(900, 600) as (page, faults):
        page.goto(served.url)
        page.get_by_text("Frame 2,").wait_for(timeout=60_000)
        carved(page)
        strip = page.get_by_role("slider", name="Frame")
        assert strip.get_attribute("aria-valuenow") == "2"
        page.keyboard.press("ArrowRight")
        page.get_by_text("Frame 3,").wait_for()
        page.keyboard.press("Home")
        page.get_by_text("no pose was found in this frame").wait_for()
        page.keyboard.press("End")
        carved(page)
        page.set_viewport_size({"width": 420, "height": 800})  # as of a telephone
        space, panel = (page.locator(name).bounding_box() for name in (".space", ".panel"))
        assert space["width"] == 420 and space["height"] > 450
        assert panel["y"] >= space["y"] + space["height"]
        assert page.evaluate("document.documentElement.scrollWidth") == 420
        assert faults == []


@pytest.mark.slow
def test_it_plays_by_a_steady_clock_and_keys(served):
    """Frames pass at the recording's rate however slowly hulls come."""
    rate = served.scenes.fps / 4  # a quarter of the speed: the last frame is not passed at once
    with new_page(900, 600) as (page, faults):
        page.goto(served.url)
        carved(page)
        page.evaluate("viewer.player.timeline.faster(0.25)")
        page.keyboard.press("Home")
        script = """() => new Promise((done) => {
            const { timeline } = viewer.player, seen = [];
            const from = performance.now();
            timeline.toggle(true);
            const look = () => {
              const now = performance.now();
              timeline.tick(now);
              seen.push([now - from, timeline.index]);
              if (now - from < 1500) setTimeout(look, 20); else done(seen);
            };
            look();
        })"""
        seen = np.array(page.evaluate(script))
        due = seen[:, 0] / 1000 * rate
        late = (due - seen[:, 1] + 1) % FRAMES - 1  # of a motion that begins anew
        assert late.min() > -0.2 and late.max() < 1.2 and len(set(seen[:, 1])) == FRAMES
        assert page.get_by_role("button", name="Pause").is_visible()
        # Numbers are those of the shown frame: none while frames pass.
        assert "litres" not in page.inner_text(".told")
        page.keyboard.press("Space")
        page.get_by_role("button", name="Play").wait_for()
        page.keyboard.press("End")
        page.keyboard.press("ArrowLeft")
        page.get_by_text(f"Frame {FRAMES - 2},").wait_for()
        page.keyboard.press("Shift+ArrowLeft")
        page.get_by_text("Frame 0,").wait_for()
        assert faults == []


@pytest.mark.slow
def test_a_frame_is_gone_to_looped_and_linked(served):
    with new_page(900, 600) as (page, faults):
        page.goto(served.url)
        carved(page)
        typed = page.get_by_label("Go to a frame")
        for text, frame in (("0.12 s", 3), ("0:00.04", 1), ("2", 2)):
            typed.fill(text)
            typed.press("Enter")
            page.get_by_text(f"Frame {frame},").wait_for()
        page.keyboard.press("g")
        page.keyboard.type("99")
        page.keyboard.press("Enter")
        assert "wrong" in typed.get_attribute("class")
        typed.fill("")
        page.get_by_role("button", name="One frame back").click()
        page.get_by_text("Frame 1,").wait_for()
        page.keyboard.press("i")
        page.keyboard.press("ArrowRight")
        page.keyboard.press("o")
        until(page, "location.hash === '#frame=2&loop=1-2'")
        page.reload()
        carved(page)
        page.get_by_text("Frame 2,").wait_for()
        page.evaluate("viewer.player.timeline.toggle(true)")
        seen = set[int]()

        def look() -> bool:
            seen.add(page.evaluate("viewer.player.timeline.frame"))
            return len(seen) == 2

        until(page, look)
        assert seen == {1, 2}
        page.keyboard.press("x")
        assert page.evaluate("viewer.player.timeline.loop") == [0, FRAMES - 1]
        assert faults == []


@pytest.mark.slow
def test_the_view_follows_and_fits_the_body(served):
    middle = "viewer.player.viewpoint.target"
    with new_page(900, 600) as (page, faults):
        page.goto(served.url)
        carved(page)
        page.evaluate("viewer.player.viewpoint.pan(300, 0); viewer.player.viewpoint.zoom(3)")
        beside = page.evaluate(middle)
        page.evaluate(
            "viewer.player.bodies[0].root.forEach((_, k, root) => (root[k] += k % 3 ? 0 : 1))"
        )
        page.evaluate("viewer.player.timeline.seek(2)")
        np.testing.assert_allclose(np.subtract(page.evaluate(middle), beside), [1, 0, 0], atol=0.05)
        page.keyboard.press("f")
        until(page, "!viewer.player.viewpoint.flight")
        whole = page.evaluate("""() => {
            const { bodies, viewpoint, canvas } = viewer.player;
            const matrix = viewpoint.matrix(performance.now());
            const pixels = bodies[0].skeleton().map((point) => viewpoint.pixel(matrix, point));
            const heights = pixels.map(([, y]) => y / canvas.clientHeight);
            return [Math.min(...heights), Math.max(...heights)];
        }""")
        assert 0 < whole[0] < 0.25 and 0.75 < whole[1] < 1
        assert faults == []


@pytest.mark.slow
def test_layers_hull_and_cameras(served):
    with new_page(900, 600) as (page, faults):
        page.goto(served.url)
        carved(page)
        page.evaluate("viewer.player.viewpoint.zoom(2)")  # the cameras come into view
        views = [shown(page)]
        for name in ("Body", "Skeleton", "Hull", "Cameras"):  # each changes what is seen
            page.get_by_label(name, exact=True).uncheck()
            views.append(shown(page))
            assert differing(*views[-2:]) > 60, name
        page.get_by_label("Hull", exact=True).check()
        ways = []
        for style in ("surface", "cubes", "dots"):
            page.get_by_label("Hull as").select_option(style)
            ways.append(shown(page))
        page.get_by_label("Hull as").select_option("cubes")
        for way in ("parts", "cameras", "unexplained"):
            page.get_by_label("Colours of the hull").select_option(way)
            ways.append(shown(page))
        assert min(differing(a, b) for a, b in combinations(ways, 2)) > 200
        page.get_by_label("Cameras", exact=True).check()
        page.get_by_role("button", name="cam_2").click()
        until(page, "viewer.large?.frame === 2")
        assert differing(shown(page), views[0]) > 20_000  # its picture fills the view
        assert page.get_by_role("button", name="✕ cam_2").is_visible()
        page.keyboard.press("Escape")
        assert page.get_by_role("button", name="✕ cam_2").is_hidden()
        assert faults == []


def test_a_recording_alone_is_served(desk, capsys):
    write_staged(desk / "walk", waving(FRAMES), ring(3, (320, 240)))
    first, second = (
        Browser(ResultScenes("walk", voxel_size_m=0.05), Address(port=8395), 1) for _ in range(2)
    )
    assert first.url == "http://localhost:8395" and second.url != first.url  # the next free port
    state = got(first, "api/scene")
    assert state["bodies"] == [] and state["count"] == FRAMES and state["shown"] == 1
    assert len(state["cameras"]) == 3 and state["carved"]
    answer = got(first, "api/frame?frame=1&pictures=both")
    assert answer["hull"] and set(answer["pictures"]) == {"cam_1", "cam_2", "cam_3"}
    first.close()
    second.close()
    assert capsys.readouterr().out == ""


@pytest.mark.slow
def test_results_side_by_side(served, desk):
    assert run(["fit", "walk", "--out", "again", "--estimator", "standing", "--no-pictures"]) == 0
    other = OtherResult.open(desk / "again", 25.0)
    scenes = ResultScenes("out", voxel_size_m=0.04)
    browser = Browser(scenes, Address(port=8397), 2, [other])
    with new_page(900, 600) as (page, faults):
        page.goto(browser.url)
        carved(page)
        places = "viewer.player.bodies.map((body) => body.origins[0])"
        first, second = np.array(page.evaluate(places))
        assert np.linalg.norm(second - first) > 0.8
        apart = shown(page)
        page.get_by_label("again", exact=True).uncheck()
        assert differing(shown(page), apart) > 500
        page.get_by_label("Results side by side").uncheck()
        first, second = np.array(page.evaluate(places))
        np.testing.assert_allclose(first, second, atol=1e-6)
        assert faults == []
    browser.close()
    with pytest.raises(InputError, match="again has 25 frames per second and the first result 30"):
        OtherResult.open(desk / "again", 30.0)


def test_what_is_asked_for_wrongly_is_refused(served):
    for path, words in {
        "api/frame?frame=99": "there is no frame 99: it goes from 0 to 3",
        "api/frame?frame=x": "not understood: Expected `int`",
        "picture/cam_9?frame=1": "there is no camera 'cam_9'",
    }.items():
        with pytest.raises(HTTPError) as refused:
            got(served, path)
        assert refused.value.code == 400 and words in json.load(refused.value)["error"]
    with pytest.raises(HTTPError, match="404"):
        got(served, "nothing.js")


@pytest.mark.slow
def test_text_of_a_hostile_result_is_shown_and_not_run(served, desk):
    settings = (desk / "out" / "settings.toml").read_text()
    hostile = "<iframe srcdoc='<script>1</script>'>{alert(1)}"
    lines = [line for line in settings.splitlines() if not line.startswith("recording")]
    (desk / "out" / "settings.toml").write_text("\n".join([f'recording = "{hostile}"', *lines]))
    browser = Browser(ResultScenes("out", voxel_size_m=0.04), Address(port=8396), 1)
    with new_page(900, 600) as (page, faults):
        page.goto(browser.url)
        page.get_by_text(hostile).wait_for(timeout=60_000)
        assert page.locator("iframe").count() == 0 and faults == []
    browser.close()


def test_the_page_of_an_animal(desk):
    """It is seen from as far as its size asks for."""
    _, motion = write_example_result(desk, "quadruped", pictures=False)
    browser = Browser(ResultScenes("quadruped_fit", voxel_size_m=0.04), Address(port=8392), 2)
    away_m = np.linalg.norm(got(browser, "api/scene")["eye"] - np.median(motion.root_m, axis=0))
    assert 1.5 < away_m / motion.model.extent_m < 2.2
    browser.close()
