"""The studio in a browser as narrow as a telephone: from an empty folder to an archive, with files
of one's own, and with cameras and a board.
"""

import re
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.board_scene import room
from calib.board import Board
from calib.camera import Rig
from calib.extrinsics import pose_difference
from calib.files import read_rig
from tests.browsing import firefox_page, new_page, until
from tests.clips import waving
from tests.sources import ring, write_staged
from tests.voxelpose.board_films import film_boards
from tests.voxelpose.studio.studio_scenes import opened_studio
from voxelpose.recording.folder import Recording
from voxelpose.results import is_result

SIZE = (480, 360)
WIDTH = 390
MOUSE_ALONE = """[...document.querySelectorAll("body *")].filter((each) =>
    getComputedStyle(each).cursor === "pointer" && each.offsetParent
    && !each.closest("button, a, input, select, summary, label, [tabindex]")
).map((each) => each.outerHTML)"""
REFUSED = "Failed to load resource: the server responded with a status of 400 (Bad Request)"


@pytest.mark.slow
def test_from_an_empty_folder_to_exported_motion(desk):
    files, root = write_staged(desk / "files", waving(4), ring(3, (320, 240))), desk / "root"
    root.mkdir()
    with new_page(WIDTH, 844) as (page, faults):
        with opened_studio(root) as server:
            page.goto(server.url)
            go_the_whole_way(page, files)
            # A page that is left gives up following the job; two requests are refused on purpose.
            assert [fault for fault in faults if not fault.endswith("/events")] == [REFUSED] * 2
            port = server.port
        page.locator("#lost").get_by_text("No connection: ").wait_for(timeout=3000)
        page.locator("#new_name").fill("typed")
        with opened_studio(root, port=port):
            page.locator("#lost").wait_for(state="hidden")
        assert page.locator("#new_name").input_value() == "typed"
    assert is_result(root / "anna walk_fit")


def go_the_whole_way(page, files) -> None:
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
    page.locator("#set_skeleton").select_option("mixamo")
    with page.expect_download(timeout=120_000) as download:
        page.locator("#start").click()
    fits(page)
    archive(download.value)
    page.get_by_role("link", name="Projects").click()
    page.get_by_role("link", name="anna walk_fit", exact=True).wait_for()
    change_projects(page)


@pytest.mark.slow
def test_a_folder_leads_to_the_first_picture_of_motion_in_six_clicks(desk):
    """And what is dropped anywhere comes to its place, replaces nothing unasked, is two takes."""
    root, day = desk / "root", desk / "day"
    root.mkdir()
    (root / "voxelpose.toml").write_text('[fit]\nestimator = "standing"\n')
    files = write_staged(day / "walk", waving(4), ring(4, (320, 240)))
    (files / "notes\u202etxt.mp4").write_text("no video")
    with opened_studio(root) as server, new_page(390, 844) as (page, faults):
        page.set_default_timeout(120_000)
        page.goto(server.url)
        clicks = ["Choose a folder", "the folder", "its upload"]  # two in the browser's own windows
        page.locator("[data-folder='']").set_input_files(files)
        page.locator("#read_line").get_by_text("4 cameras, 4 frames, ").wait_for()
        page.locator("#uploads").get_by_text(r"notes\u202etxt.mp4").first.wait_for()
        fits(page)
        for name in ("#to_fit", "#start", "#next"):
            page.locator(name).click()
            clicks.append(name)
        page.locator(".card img").wait_for()
        assert len(clicks) <= 6
        assert len([*(root / "walk" / "background").iterdir()]) == 4
        shutil.copytree(files, day / "run")
        ask_before_replacing(page, day / "run", root / "walk")
        drop(page, day)
        page.get_by_role("link", name="Open walk_2").wait_for()
        for name in ("run", "walk_2"):
            until(page, (root / name / "cam_4.mkv").exists, 120)
        until(page, "document.querySelector('#uploads button').textContent === 'Close'", 120)
        page.goto(f"{server.url}/check/walk/")
        page.locator(".tile").nth(2).wait_for()
        drop(page, files / "calibration.toml")
        assert page.url.endswith("/check/walk/")
        assert [fault for fault in faults if "/events" not in fault and "blob:" not in fault] == []


def drop(page, path) -> None:
    """Drops a file or folder of the disk in the middle of the page."""
    link = page.context.new_cdp_session(page)
    data = {"items": [], "files": [str(path)], "dragOperationsMask": 1}
    for kind in ("dragEnter", "dragOver", "drop"):
        asked = {"type": kind, "x": 180, "y": 500, "data": data}
        link.send("Input.dispatchDragEvent", asked)


def ask_before_replacing(page, folder, project) -> None:
    """A folder with files that are there already: both sides are shown, and may stay."""
    (folder / "cam_1.mkv").write_bytes((folder / "cam_2.mkv").read_bytes())
    before = (project / "cam_1.mkv").read_bytes()
    for answer in ("Keep what is there", "Replace"):
        assert (project / "cam_1.mkv").read_bytes() == before
        drop(page, folder)
        page.locator("dialog").get_by_text("walk has these already").wait_for()
        until(page, "document.querySelector('dialog img').naturalWidth")
        fits(page)
        page.get_by_role("button", name=answer).click()
    until(page, lambda: (project / "cam_1.mkv").read_bytes() != before, 120)


def fits(page) -> None:
    """Nothing reaches beyond the page's width, and whatever can be clicked has the keys, too."""
    assert page.evaluate("document.scrollingElement.scrollWidth - innerWidth") <= 0
    assert page.evaluate(MOUSE_ALONE) == []


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
    page.locator("#set_stature").fill("175")
    page.locator("#set_frames").fill("9:12")  # there are four
    assert page.locator("#set_stature").input_value() == "1.75"
    page.locator("#start").click()
    at_field = page.locator(".field", has=page.locator("#set_frames"))
    at_field.get_by_text("9:12 are not in the recording").wait_for(timeout=120_000)
    fits(page)
    page.locator("#set_frames").fill("")
    page.locator("#start").click()
    page.locator("#jobs li.running").wait_for()
    page.reload()  # it finds its job again
    page.locator(".verdict .tag").wait_for(timeout=120_000)
    assert page.locator(".verdict h3").text_content() == "anna walk_fit"
    fits(page)
    page.locator("#next").click()


def view(page) -> None:
    page.locator(".card img").wait_for()
    fits(page)
    with page.expect_popup() as opened:
        page.get_by_role("link", name="Open the viewer of").click()
    viewer = opened.value
    viewer.get_by_text("Frame 2,").wait_for(timeout=120_000)  # drawn, by way of its WebSocket
    assert viewer.title().startswith("anna walk_fit")
    viewer.get_by_role("link", name="Why is a pixel").wait_for(timeout=120_000)
    viewer.close()


def change_projects(page) -> None:
    page.get_by_role("button", name="Duplicate anna walk").click()
    page.get_by_label("New name of anna walk").fill("anna walk_fit")
    page.keyboard.press("Enter")
    page.locator(".fault").get_by_text("already: choose another name").wait_for()
    page.get_by_label("New name of anna walk").fill("a copy")
    page.keyboard.press("Enter")
    page.once("dialog", lambda dialog: dialog.accept())
    page.get_by_role("button", name="Delete a copy").click()
    page.locator("#bin summary").click()
    page.get_by_role("button", name="Put back a copy").click()
    page.get_by_role("link", name="Open a copy").wait_for()
    fits(page)


def archive(download) -> None:
    assert download.suggested_filename == "anna walk_fit.zip"
    with zipfile.ZipFile(download.path()) as zipped:
        names = set(zipped.namelist())
        apart = {f"export/motion.{ending}" for ending in ("bvh", "glb", "html")}
        assert apart | {"export/joints.csv", "report.html"} <= names
        with zipped.open("export/joints.csv") as table:
            lines = table.read().decode().splitlines()
        assert lines[0].startswith("frame,time_s,joint") and len(lines) > 45
        heights = [float(line.split(",")[5]) for line in lines[1:]]
        assert np.isfinite(heights).all() and max(heights) < 2.5


@pytest.mark.slow
@pytest.mark.tour
def test_firefox_imports_fits_views_and_exports(desk):
    files, root = write_staged(desk / "files", waving(4), ring(3, (320, 240))), desk / "root"
    root.mkdir()
    (root / "voxelpose.toml").write_text('[fit]\nestimator = "standing"\n')
    with opened_studio(root) as server, firefox_page() as page:
        page.set_default_timeout(120_000)
        page.goto(server.url)
        page.locator("#new_name").fill("anna walk")
        page.keyboard.press("Enter")
        bring_files(page, files)
        for name in ("#to_fit", "#start", "#next"):
            page.locator(name).click()
        view(page)
        page.get_by_role("link", name="Next: Export").click()
        page.locator("#set_skeleton").select_option("mixamo")
        with page.expect_download() as download:
            page.locator("#start").click()
        archive(download.value)


@pytest.mark.slow
@pytest.mark.tour
def test_from_cameras_and_a_board_to_exported_motion(desk):
    rig = Rig(tuple(replace(one, name=f"cam_{n}") for n, one in enumerate(room(3, 2.4, SIZE), 1)))
    root = desk / "root"
    films = write_staged(root / "films", waving(12), rig)
    for file in (films / "calibration.toml", *(films / "background").iterdir()):
        file.unlink()
    (desk / "made").mkdir()
    made = film_boards(desk / "made", rig, Board(8, 5, 0.15), np.array([-0.4, -0.3, 0]), (2.2, 3))
    with opened_studio(root) as server, new_page(WIDTH, 844) as (page, faults):
        page.goto(server.url)
        page.locator("#new_name").fill("room")
        page.keyboard.press("Enter")
        page.locator("#fault_line").wait_for()
        page.get_by_role("link", name="Record", exact=True).click()
        film(page)
        page.get_by_role("link", name="Calibrate", exact=True).click()
        board(page)
        lenses(page, made / "stills")
        positions(page, made / "walk")
        page.locator("#next").click()
        page.locator(".tile").nth(2).wait_for()
        page.locator("#next").click()
        page.get_by_text("Expert").click()
        page.locator("#set_estimator").fill("standing")
        page.locator("#start").click()
        page.locator(".verdict .tag").wait_for(timeout=120_000)
        page.locator("#next").click()
        page.get_by_role("link", name="Next: Export").click()
        with page.expect_download(timeout=120_000) as download:
            page.locator("#start").click()
        with zipfile.ZipFile(download.value.path()) as zipped:
            assert {"motion.bvh", "joints.csv", "report.html"} <= set(zipped.namelist())
        # A page that is left gives up what it has asked for.
        assert [fault for fault in faults if not fault.startswith("failed: ")] == [REFUSED]
    found = read_rig(root / "room" / "calibration.toml")
    apart = pose_difference(found["cam_3"], found["cam_1"])[0]
    assert apart == pytest.approx(pose_difference(rig["cam_3"], rig["cam_1"])[0], abs=40)
    assert len(Recording.open(root / "room").backgrounds()) == 3


def film(page) -> None:
    page.locator("#open_cameras").wait_for()
    for number in range(3):
        if number:
            page.locator("#add_camera").click()
        page.locator("[data-address]").nth(number).fill(f"films/cam_{number + 1}.mkv")
    page.locator("#record_countdown").fill("0")
    page.locator("#record_empty").fill("0.5")
    fits(page)
    page.locator("#open_cameras").click()
    shown = "[...document.querySelectorAll('.cameras img')].filter((i) => i.naturalWidth)"
    until(page, f"{shown}.length === 3")
    page.reload()  # it finds its cameras again
    until(page, f"{shown}.length === 3")
    fits(page)
    page.locator("#record").click()
    page.locator("#phase").get_by_text(re.compile(r"Recording: \d\d")).wait_for(timeout=20_000)
    page.locator("#finish").click()
    page.locator("#recorded").get_by_text("moments in").wait_for(timeout=20_000)
    fits(page)


def board(page) -> None:
    page.locator("#make_board").click()
    page.locator("#measure").get_by_text("9 squares in a row are 252 mm").wait_for()
    with page.expect_download() as download:
        page.locator("#sheet").click()
    assert download.value.path().read_bytes().startswith(b"%PDF")
    page.locator("#look_square").fill("0.15")


def lenses(page, stills) -> None:
    page.locator("#start_lenses").click()
    page.locator("#banner").get_by_text("there are no pictures of the board").wait_for()
    page.locator("input[data-folder=boards]").set_input_files(stills)
    page.locator(".card[data-camera=cam_3] img").wait_for(timeout=30_000)
    page.locator("#start_lenses").click()
    page.locator("#jobs li.running").wait_for()
    page.locator(".coverage canvas").nth(2).wait_for(timeout=120_000)
    page.locator(".card[data-camera=cam_1] .good").get_by_text("of 12 pictures").wait_for()
    fits(page)


def positions(page, walk) -> None:
    page.locator("input[data-place=board_walk]").set_input_files(sorted(walk.iterdir()))
    page.get_by_role("button", name="Remove board_walk/cam_3.avi").wait_for()
    page.locator("#rig_floor").fill("0")
    page.locator("#start_positions").click()
    page.locator("#rig_found").get_by_text("cam_1–cam_2 ").wait_for(timeout=120_000)
    page.locator("#rig_found img").wait_for()
    page.reload()
    page.locator("#rig_found img").wait_for()
    assert page.locator("#look_square").input_value() == "0.15"  # as it is kept
    fits(page)
