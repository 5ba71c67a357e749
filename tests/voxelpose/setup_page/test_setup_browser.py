"""The setup page in a browser: what is clicked is what the files then hold."""

import numpy as np
import pytest

from calib.points import read_points
from tests.browsing import new_page, until
from tests.sources import figure_masks, ring, turned, write_figure
from tests.voxelpose.setup_page.setup_scenes import SIZE, served, staged
from voxelpose.cli.options import folder_settings
from voxelpose.recording.folder import Recording


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return staged(tmp_path_factory.mktemp("browser") / "walk")


class Hand:
    """A user's mouse on the enlarged camera."""

    def __init__(self, page):
        self.page = page

    def enlarge(self, camera: str) -> None:
        self.page.locator(f'.tile[data-camera="{camera}"]').click()
        self.page.locator(f'.tile.large[data-camera="{camera}"]').wait_for()
        self.page.wait_for_timeout(150)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Place on the page of a pixel of the picture that is shown whole."""
        box = self.page.locator(".tile.large canvas").bounding_box()
        scale = min(box["width"] / SIZE[0], box["height"] / SIZE[1])
        return (
            box["x"] + box["width"] / 2 + (x + 0.5 - SIZE[0] / 2) * scale,
            box["y"] + box["height"] / 2 + (y + 0.5 - SIZE[1] / 2) * scale,
        )

    def click(self, x: float, y: float) -> None:
        self.page.mouse.move(*self.at(x, y))
        self.page.mouse.down()
        self.page.mouse.up()
        self.page.wait_for_timeout(60)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        self.page.mouse.move(*self.at(*start))
        self.page.mouse.down()
        self.page.mouse.move(*self.at(*end), steps=5)
        self.page.mouse.up()
        self.page.wait_for_timeout(60)

    def use(self, tool: str) -> None:
        self.page.locator(f'[data-tool="{tool}"]').click()
        self.page.locator(f'[data-tool="{tool}"][aria-expanded="true"]').wait_for()

    def save(self) -> str:
        self.page.locator("#save").click()
        self.page.locator("#saving.done").wait_for(timeout=10_000)
        return self.page.locator("#saving").text_content()


def doc(page) -> dict:
    return page.evaluate("window.app.store.doc")


@pytest.mark.slow
def test_what_is_drawn_and_clicked_is_saved(recorded):
    (recorded / "voxelpose.toml").write_text("# mine\n[fit]\nsmooth = false\n")
    with served(recorded) as server, new_page() as (page, faults):
        page.goto(server.url)
        hand = Hand(page)
        page.locator(".tile").nth(2).wait_for()
        draw_a_region(page, hand)
        hide_a_place(page, hand)
        click_a_point(page, hand)
        page.locator('[data-tool="silhouettes"]').click()
        page.get_by_text("Share of the picture").wait_for(timeout=60_000)
        page.locator("#fit_background").select_option("paper")
        page.locator("#fit_tolerance").fill("1")
        page.locator("#fit_tolerance").blur()
        hand.use("floor")
        page.locator("#up").select_option("-y")
        until(page, lambda: doc(page)["fit"]["up"] == "-y")
        assert page.locator("#saving").text_content() == (
            "not saved: regions, unknown places, points, settings"
        )
        assert sorted(p.name for p in recorded.glob("*.*")) == sorted(
            ["calibration.toml", "voxelpose.toml", *(f"cam_{n}.mkv" for n in (1, 2, 3))]
        )
        assert hand.save() == (
            "written: regions/cam_2.png, recording.toml, points.csv, voxelpose.toml"
        )
        assert page.locator("#save").is_disabled()
        drawn = doc(page)
        page.wait_for_load_state("networkidle")
        page.wait_for_timeout(1000)
        assert faults == []
        page.reload()  # no question: nothing is unsaved
        faults.clear()  # it may have cut a request off
        page.locator(".tile").nth(2).wait_for()
        until(page, "window.app")
        assert doc(page) == drawn
        assert faults == []
    compare(recorded, drawn)


def draw_a_region(page, hand: Hand) -> None:
    hand.enlarge("cam_2")
    for corner in ((60, 20), (260, 20), (260, 200)):
        hand.click(*corner)
    page.keyboard.press("Backspace")
    for corner in ((270, 210), (60, 210)):
        hand.click(*corner)
    hand.click(60, 20)  # closes
    assert len(doc(page)["regions"]["cam_2"]["polygons"][0]) == 4
    hand.drag((270, 210), (240, 220))
    hand.drag((160, 20), (160, 5))  # the dot between two corners
    (polygon,) = doc(page)["regions"]["cam_2"]["polygons"]
    expected = [(60, 20), (160, 5), (260, 20), (240, 220), (60, 210)]
    assert np.allclose(polygon, expected, atol=1.0)
    page.keyboard.press("Delete")
    assert len(doc(page)["regions"]["cam_2"]["polygons"][0]) == 4
    page.keyboard.press("Control+z")
    assert doc(page)["regions"]["cam_2"]["polygons"] == [polygon]
    page.keyboard.press("Control+z")
    page.keyboard.press("Control+Shift+z")
    assert doc(page)["regions"]["cam_2"]["polygons"] == [polygon]


def hide_a_place(page, hand: Hand) -> None:
    page.keyboard.press("Escape")
    hand.use("unknown")
    hand.enlarge("cam_1")
    for corner in ((10, 150), (90, 150), (90, 230), (10, 230)):
        hand.click(*corner)
    page.keyboard.press("Enter")
    for corner in ((150, 150), (180, 150), (160, 180)):
        hand.click(*corner)
    page.keyboard.press("Enter")
    assert len(doc(page)["unknown"]["cam_1"]) == 2
    page.get_by_role("button", name="Delete").nth(1).click()
    until(page, lambda: len(doc(page)["unknown"]["cam_1"]) == 1)


def click_a_point(page, hand: Hand) -> None:
    hand.use("points")
    page.locator("#new_point").click()
    page.wait_for_timeout(150)
    page.keyboard.type("tile a")  # its name is selected
    page.keyboard.press("Tab")
    until(page, lambda: doc(page)["points"][0]["name"] == "tile a")
    for axis, value in zip("xyz", ("0.3", "-0.2", "1.1"), strict=True):
        page.locator(f"#point_{axis}").fill(value)
        page.keyboard.press("Tab")
    until(page, lambda: doc(page)["points"][0]["position_m"] == [0.3, -0.2, 1.1])
    page.mouse.move(*hand.at(120, 80))
    loupe = page.locator("#loupe")
    loupe.wait_for()
    for _ in range(4):
        page.mouse.wheel(0, -100)
    page.wait_for_timeout(100)
    page.mouse.down()
    page.mouse.up()
    until(page, lambda: "cam_1" in doc(page)["points"][0]["pixels"])
    before = doc(page)["points"][0]["pixels"]["cam_1"]
    assert np.allclose(before, (120, 80), atol=0.6)
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("Shift+ArrowUp")
    after = doc(page)["points"][0]["pixels"]["cam_1"]
    assert np.allclose(np.subtract(after, before), (0.2, -1), atol=1e-6)
    assert loupe.is_visible()
    page.locator("td", has_text=" px").first.wait_for()  # off by
    page.keyboard.press("0")


def compare(folder, drawn: dict) -> None:
    recording = Recording.open(folder)
    (region,) = recording.regions().items()
    assert region[0] == "cam_2" and region[1][30, 70] and region[1][10, 160]
    assert not region[1][100, 40] and not region[1][225, 200]
    (hidden,) = recording.unknown().items()
    assert hidden[0] == "cam_1" and hidden[1][190, 50] and not hidden[1][160, 160]
    assert hidden[1].sum() == pytest.approx(81 * 81, rel=0.05)
    points = read_points(folder / "points.csv")
    assert points.known_m["tile a"].tolist() == [0.3, -0.2, 1.1]
    assert points.pixels["tile a"]["cam_1"].tolist() == drawn["points"][0]["pixels"]["cam_1"]
    found = {name: each.value for name, each in folder_settings("fit", folder).items()}
    assert found == {"smooth": False, "background": "paper", "tolerance": 1, "up": "-y"}
    assert (folder / "voxelpose.toml").read_text().startswith("# mine\n")


def asks(page) -> bool:
    """Whether the browser would ask before it leaves the page."""
    return page.evaluate("!window.dispatchEvent(new Event('beforeunload', {cancelable: true}))")


@pytest.mark.slow
def test_unsaved_work_is_asked_about_and_survives_the_end_of_the_program(tmp_path):
    walk = staged(tmp_path / "walk", 2)
    with new_page(620, 700) as (page, faults):
        with served(walk, token="open sesame") as server:
            page.goto(server.url)
            assert "sesame" not in page.url
            hand = Hand(page)
            hand.use("unknown")
            hand.enlarge("cam_1")
            for corner in ((10, 50), (90, 50), (90, 130)):
                hand.click(*corner)
            page.keyboard.press("Enter")
            assert len(doc(page)["unknown"]["cam_1"]) == 1
            assert asks(page)
            page.keyboard.press("Control+z")
            assert not asks(page)
            page.keyboard.press("Control+y")
            assert faults == []
        page.locator("#save").click()
        page.locator("#banner").get_by_text("cannot be reached").wait_for()
        assert len(doc(page)["unknown"]["cam_1"]) == 1


@pytest.mark.slow
def test_a_second_page_is_told_before_it_overwrites(tmp_path):
    with served(staged(tmp_path / "walk", 2)) as server, new_page() as (page, faults):
        other = page.context.browser.new_page()
        for each in (page, other):
            each.goto(server.url)
            each.locator('[data-tool="silhouettes"]').click()
        for each, stature in ((page, "1.7"), (other, "1.8")):
            each.locator("#fit_stature").fill(stature)
            each.locator("#fit_stature").blur()
            each.locator("#save").click()
            if each is page:
                page.locator("#saving.done").wait_for()
        other.locator("#banner").get_by_text("another page or program has changed").wait_for()
        assert "1.7" in (tmp_path / "walk" / "voxelpose.toml").read_text()
        other.locator("#save").click()
        other.locator("#saving.done").wait_for()
        assert "1.8" in (tmp_path / "walk" / "voxelpose.toml").read_text()
        assert not other.locator("#banner").is_visible() and faults == []


@pytest.mark.slow
def test_the_keyboard_reaches_every_camera_and_a_check_does_not_block_the_page(recorded):
    with served(recorded) as server, new_page() as (page, faults):
        page.goto(server.url)
        page.locator(".tile").nth(2).wait_for()
        for key, camera in (("Enter", "cam_2"), ("Space", "cam_3")):
            for _ in range(100):  # from wherever the focus is
                page.keyboard.press("Tab")
                if page.evaluate("document.activeElement.ariaLabel") == f"Enlarge {camera}":
                    break
            page.keyboard.press(key)
            page.locator(f'.tile.large[data-camera="{camera}"]').wait_for(timeout=5000)
            page.keyboard.press("Escape")
            assert page.locator(".tile.large").count() == 0
        page.locator('[data-tool="check"]').click()
        page.locator("#start_check").click()
        page.locator("#forward").click()  # goes on meanwhile
        page.get_by_text("frame 5").wait_for()
        page.locator("#check_summary").wait_for(timeout=60_000)
        page.locator(".shot").click()
        page.locator("dialog[open] img").wait_for()
        page.get_by_role("button", name="Close").click()
        assert faults == []


@pytest.mark.slow
def test_a_camera_that_was_moved_is_repaired_by_a_button(tmp_path):
    true = ring(4, (240, 180))
    films = {camera.name: figure_masks(camera, range(20)) for camera in true}
    folder = write_figure(tmp_path, turned(true, "cam_3", 2), films)
    with served(folder) as server, new_page() as (page, faults):
        page.goto(server.url)
        page.locator('[data-tool="check"]').click()
        page.locator("#start_check").click()
        page.get_by_text("cam_3 was turned by about").wait_for(timeout=60_000)
        page.locator("#repair").click()
        page.wait_for_event("load")
        page.locator('[data-tool="check"]').click()
        page.locator("#start_check", has_text="Check the cameras").wait_for()
        assert page.locator("#repair").count() == 0 and faults == []
    assert (folder / "before_repair" / "calibration.toml").is_file()
