"""The studio in a browser as narrow as a telephone: from an empty folder to an archive."""

import zipfile

import numpy as np
import pytest

from tests.browsing import new_page
from tests.clips import waving
from tests.sources import ring, write_staged
from tests.voxelpose.studio.studio_scenes import opened_studio
from voxelpose.results import is_result


@pytest.mark.slow
def test_from_an_empty_folder_to_exported_motion(desk):
    files, root = write_staged(desk / "files", waving(4), ring(3, (320, 240))), desk / "root"
    root.mkdir()
    with opened_studio(root) as server, new_page(420, 800) as (page, faults):
        page.goto(server.url)
        page.locator("#new_name").fill("anna walk")
        page.keyboard.press("Enter")
        bring_files(page, files)
        fits(page)
        page.get_by_role("link", name="Next: Check").click()
        page.locator(".tile").nth(2).wait_for()
        fits(page)
        page.locator("#next").click()
        fit(page)
        view(page)
        page.get_by_role("link", name="Next: Export").click()
        page.locator("#start").click()
        page.locator("#download").wait_for(timeout=60_000)
        fits(page)
        with page.expect_download() as download:
            page.locator("#download").click()
        archive(download.value)
        page.get_by_role("link", name="Projects").click()
        page.get_by_role("link", name="anna walk_fit", exact=True).wait_for()
        # A page that is left gives up following the job.
        assert [fault for fault in faults if not fault.endswith("/events")] == []
    assert is_result(root / "anna walk_fit")


def fits(page) -> None:
    """Nothing reaches beyond the page's width."""
    assert page.evaluate("document.scrollingElement.scrollWidth") <= 420


def bring_files(page, files) -> None:
    page.locator("#fault_line").get_by_text("holds no video").wait_for()

    def choose(place, paths):
        page.locator(f'input[data-place="{place}"]').set_input_files(paths)
        for path in paths:
            card = page.locator(".card", has=page.locator(f'input[data-place="{place}"]'))
            card.get_by_role("button", name=path.name).wait_for()

    choose("video", sorted(files.glob("cam_*.mkv")))
    page.locator("#fault_line").get_by_text("holds no calibration").wait_for()
    choose("background", sorted((files / "background").iterdir()))
    choose("calibration", [files / "calibration.toml"])
    page.locator("#read_line").get_by_text("3 cameras, 4 frames, ").wait_for()


def fit(page) -> None:
    page.get_by_text("Expert").click()
    page.locator("#set_estimator").fill("standing")
    page.locator("#set_stature").fill("1.75")
    page.locator("#set_frames").fill("9:12")  # there are four
    page.locator("#start").click()
    page.locator(".refused").get_by_text("frames 9:12 are not in the recording").wait_for(
        timeout=60_000
    )
    fits(page)
    page.locator("#set_frames").fill("")
    page.locator("#start").click()
    page.locator("#stop").wait_for()
    page.reload()  # it finds its job again
    page.locator(".verdict .tag").wait_for(timeout=60_000)
    assert page.locator(".verdict h3").text_content() == "anna walk_fit"
    fits(page)
    page.locator("#next").click()


def view(page) -> None:
    page.locator(".card img").wait_for()
    fits(page)
    with page.expect_popup() as opened:
        page.get_by_role("link", name="Open the viewer of").click()
    viewer = opened.value
    viewer.get_by_text("Frame 2,").wait_for(timeout=60_000)  # drawn, by way of its WebSocket
    assert viewer.title().startswith("anna walk_fit")
    viewer.get_by_role("link", name="Why is a pixel").wait_for()
    viewer.close()


def archive(download) -> None:
    assert download.suggested_filename == "anna walk_fit.zip"
    with zipfile.ZipFile(download.path()) as zipped:
        names = set(zipped.namelist())
        assert {"motion.bvh", "motion.glb", "joints.csv", "report.html"} <= names
        with zipped.open("joints.csv") as table:
            lines = table.read().decode().splitlines()
        assert lines[0].startswith("frame,time_s,joint") and len(lines) > 45
        heights = [float(line.split(",")[5]) for line in lines[1:]]
        assert np.isfinite(heights).all() and max(heights) < 2.5
