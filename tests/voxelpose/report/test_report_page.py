"""The report: complete, self-contained, and right."""

import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from calib.camera import Rig
from calib.files import write_rig
from silhouette_core.motion.conditioning import Conditioning, conditioned
from silhouette_core.motion.motion_file import write_motion
from tests.browsing import new_page, until
from tests.clips import walking, waving
from tests.other_bodies import write_example_result
from tests.sources import open_desk, ring, write_staged
from voxelpose.cli import run
from voxelpose.people_marks import COLOURS
from voxelpose.reliability import verdict_of
from voxelpose.report.charts import TimeChart, time_chart
from voxelpose.report.verdict import check_cameras
from voxelpose.results import Result
from voxelpose.view.viewer.result_scenes import ResultScenes

SECTIONS = "overview findings sheet angles quality cameras timings settings".split()
VOID = {"meta", "link", "img", "input", "br", "hr"}


class Page(HTMLParser):
    """Collects the references of a page, and checks the nesting of its elements."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open, self.ids, self.references, self.pictures = [], [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        self.ids += [attributes["id"]] if "id" in attributes else []
        self.references += [value for name, value in attrs if name in ("src", "href")]
        if tag == "img" or attributes.get("role") == "img":
            self.pictures.append(attributes.get("alt") or attributes.get("aria-label"))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        self.handle_endtag(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A result "out", with its report, of the recording "walk" of somebody who does not walk; the
    first frame is lost.
    """
    with pytest.MonkeyPatch.context() as patch:
        desk = open_desk(tmp_path_factory.mktemp("made"), patch)
        write_staged(desk / "walk", waving(6), ring(3, (320, 240)))
        (desk / "walk" / "subject.toml").write_text("stature = 1.7\n")
        assert run(["fit", "walk", "--out", "out", "--estimator", "standing"]) == 0
        assert run(["report", "out"]) == 0
    return desk


@pytest.fixture
def fitted(desk, made):
    """A copy of what is made."""
    for name in ("walk", "out"):
        shutil.copytree(made / name, desk / name)
    return desk


def test_one_page_without_anything_outside(fitted):
    text = (fitted / "out" / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert [name for name in page.ids if name in SECTIONS] == list(SECTIONS)
    assert len(page.ids) == len(set(page.ids))
    assert all(reference.startswith(("data:", "#")) for reference in page.references)
    assert not re.search(r"https?://|url\((?!#)|@import|\bfetch\(", text)
    targets = {reference[1:] for reference in page.references if reference.startswith("#")}
    assert targets <= set(page.ids)
    assert len(page.pictures) > 10 and all(page.pictures)
    assert text.count("data:image/webp") == 6 + 1  # every frame, and the one shown first
    assert "1 of 6 frames have no pose: frame 0." in text
    line = str(verdict_of(Result.open("out").summary))
    assert line.startswith("doubtful: ") and f"{line}. Look first" in re.sub("<[^>]*>", "", text)
    assert "<b>Filter and gaps</b>: filter not recorded." in text
    assert "gait" not in page.ids and "steps/min" not in text
    assert 'class="subject"' not in text and "Errors to be expected" not in text
    assert text.count("The fitted body at frame ") == 1


def test_missing_pictures_are_reported(fitted):
    assert run(["fit", "walk", "--out", "bare", "--estimator", "standing", "--no-pictures"]) == 0
    shutil.rmtree("walk")
    assert run(["report", "bare", "--out", "gone.html"]) == 0
    text = (fitted / "gone.html").read_text()
    Page(text)
    assert text.count("is not there any more: say where with --recording") == 2
    assert "data:image/webp" not in text


def test_mistakes(fitted, capsys, monkeypatch):
    monkeypatch.setattr("voxelpose.report.page._contents", lambda *_: {})
    monkeypatch.setattr("voxelpose.report.page.render_page", lambda *_: "")
    (fitted / "mine.txt").write_text("precious")
    for words, line in (
        (["walk"], "walk is not a result of voxelpose"),
        (["out", "--out", "mine.txt"], "mine.txt exists and is not a report"),
        (["out", "--out", "gone/report.html"], "gone/report.html cannot be written"),
    ):
        assert run(["report", *words]) == 2
        assert line in capsys.readouterr().err.splitlines()[-1]
    assert (fitted / "mine.txt").read_text() == "precious"


def test_a_camera_that_was_moved_stands_out(desk):
    motion, rig = waving(6), ring(4, (320, 240))
    write_staged(desk / "walk", motion, rig)
    assert run(["fit", "walk", "--out", "out", "--estimator", "standing", "--no-pictures"]) == 0
    check = check_cameras(ResultScenes("out"))
    lines = check.lines
    assert len(lines) == 4 and not any(line.apart for line in lines)
    assert check.summary.startswith("all 4 cameras agree") and all(
        line.outline_px < 1 for line in lines
    )
    assert all(
        line.overlap > 0.9 and line.uncovered < 0.06 and line.beyond < 0.06 for line in lines
    )
    first, *others = rig
    first = replace(first, translation=first.translation + np.array([0.15, 0, 0]))
    write_rig(Rig((first, *others)), desk / "out" / "calibration.toml")
    moved = check_cameras(ResultScenes("out"))
    assert [line.camera for line in moved.lines if line.apart] == ["cam_1"]
    assert "cam_1" in moved.summary


def test_one_page_about_several_people(couple):
    assert run(["report", "couple"]) == 0
    text = (couple / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert len(page.ids) == len(set(page.ids))
    sections = "overview findings sheet person_1 person_2 cameras timings settings".split()
    assert [name for name in page.ids if name in (*SECTIONS, *sections)] == sections
    targets = {reference[1:] for reference in page.references if reference.startswith("#")}
    assert targets <= set(page.ids)
    for name, colour in zip(("person_1", "person_2"), COLOURS, strict=False):
        dot = f"background:rgb{colour}"
        assert f'<h2 id="{name}"><span class="dot" style="{dot}"></span> Person' in text
    words = re.sub("<[^>]*>", "", text)
    assert "doubtful: person 1: its estimator states no errors" in words
    assert "Person 2: doubtful: 2 of 5 frames have no pose" in words
    assert text.count("data:image/webp") == 5 + 1  # drawn, of all frames
    assert "<td>../dance</td>" in text  # from the page's own folder
    check = check_cameras(ResultScenes("couple"))
    assert [line.moments for line in check.lines] == [3, 3, 3]  # at which both have a pose
    assert all(line.overlap > 0.9 and not line.apart for line in check.lines)


def test_a_gap_interrupts_a_curve_and_the_label_has_the_range():
    time_s = np.array([0.0, 0.1, 0.2, 0.9, 1.0])
    curves = {"left": (np.array([5.0, 60, 10, 20, 30]), "#abcdef")}
    text = time_chart(TimeChart("Knee & <more>", "degrees", curves), time_s, "one")
    assert 'aria-label="Knee &amp; &lt;more&gt; over time: left from 5 to 60 degrees"' in text
    curve = next(path for path in re.findall(r'<path d="([^"]*)"[^>]*#abcdef', text))
    assert curve.count("M") == 2 and "http" not in text and "#123456" not in text


@pytest.mark.slow
def test_the_page_plays(made):
    with new_page(900, 700) as (page, faults):
        page.goto((made / "out" / "report.html").as_uri())
        first = page.get_attribute("#preview", "src")
        cursor = page.locator("svg .cursor").first
        before = cursor.get_attribute("transform")
        page.locator("#seek").focus()
        page.keyboard.press("ArrowRight")
        assert page.text_content("#when") == "frame 4 · 0.16 s"
        assert (
            page.get_attribute("#preview", "src") != first
            and cursor.get_attribute("transform") != before
        )
        page.click("#play")
        until(page, "document.getElementById('when').textContent.startsWith('frame 1')")
        assert page.evaluate("document.documentElement.scrollWidth") == 900
        assert faults == []


@pytest.mark.parametrize("name", ["robot_arm", "quadruped"])
def test_the_report_of_a_body_that_is_no_persons(desk, name):
    truth, _ = write_example_result(desk, name)
    assert run(["report", f"{name}_fit"]) == 0
    text = (desk / f"{name}_fit" / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert set(SECTIONS) <= set(page.ids)
    words = re.sub(r"<[^>]*>|data:[^\"]*", " ", text)
    for phrase in ("person", "Anatomical", "arms and legs", "thumbs", "15 joints", "27 parts"):
        assert phrase not in words
    assert ("left side" in words) == (name == "quadruped")
    count = len({part for part, dof in truth.model.tree.dofs if not dof.fixed})
    charts = [text for text in page.pictures if text and " over time: " in text]
    assert sum("degrees" in chart for chart in charts) == count


def test_of_a_walker_gait_and_errors_are_told(desk):
    motion = walking()
    write_staged(desk / "walk", motion, ring(2, (80, 60)))
    about = "name = '<S07>'\ndate = 2026-11-28\nremarks = 'barefoot & tired'\n"
    (desk / "walk" / "subject.toml").write_text(about)
    words = ["fit", "walk", "--out", "out", "--estimator", "standing", "--no-pictures"]
    assert run(words) == 0
    write_motion(motion, desk / "out" / "motion.safetensors")
    assert run(["report", "out"]) == 0
    text = (desk / "out" / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert "gait" in page.ids and len(page.ids) == len(set(page.ids))
    assert {"#gait"} <= set(page.references)
    plain = " ".join(re.sub(r"<style.*?</style>|<[^>]*>", " ", text, flags=re.DOTALL).split())
    assert "Subject &lt;S07&gt; Recorded 2026-11-28 Remarks barefoot &amp; tired" in plain
    assert "109 steps/min cadence" in plain and "Walking over the ground: 2 strides of" in plain
    assert re.search(r"Stride time, s 1\.10 ± 0\.0\d \(n = 2\) 1\.10 ± 0\.0\d \(n = 2\)", plain)
    assert re.search(r"Stance, % 6\d ± \d \(n = 2\)", plain)
    assert re.search(r"Double support, % [12]\d ± \d \(n = 2\)", plain)
    assert "knee 10 / 10 knee flexion" in plain and "wrist 10 / 10" in plain
    cycles = [label for label in page.pictures if label and " over the stride: " in label]
    assert len(cycles) == 6
    assert cycles[0].startswith("Hip flexion over the stride: left mean from ")


def test_the_filter_is_stated_and_that_it_could_not_act(fitted, capsys):
    motion = conditioned(waving(6, fps=12.5).select(np.r_[0:2, 4:6]), Conditioning(gap_limit=2))
    write_motion(motion, fitted / "out" / "motion.safetensors")
    assert run(["report", "out"]) == 0  # replaces its own
    assert "report.html" in capsys.readouterr().out
    text = (fitted / "out" / "report.html").read_text(encoding="utf-8")
    assert "Butterworth low-pass, 7 Hz, order 2, forward and backward; not filtered: 12.5" in text
    assert "2 missing frames filled (linear, gaps up to 2 frames)" in text
    assert "choose a lower cut-off" in text
