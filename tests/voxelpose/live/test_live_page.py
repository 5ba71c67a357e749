"""The live page: without a browser, and in one without a screen."""

import base64
import json
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import cycle
from typing import Any

import cv2
import numpy as np
import pytest

from silhouette_core.image.silhouettes import UndistortedView
from silhouette_core.motion import kinematics
from tests.browsing import new_page, until
from tests.sources import ring
from tests.voxelpose.live.fake_session import FakeControls
from tests.voxelpose.live.live_scenes import person, posed, staged_frame
from tests.voxelpose.live.sessions import wait_until
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.live_page import Page
from voxelpose.live.live_scene import LiveScene, SentBody, small_picture
from voxelpose.live.senders import ReceiverState
from voxelpose.people_marks import person_colour
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.scene import SILHOUETTE

RIG = ring(2, (320, 240), (-0.2, 0.05, 0.0, 0.0))


def waving(number: int) -> LiveFrame:
    """A frame of a body that waves with its right arm."""
    raised = 60 + 50 * np.sin(number)
    body = posed({"right_upper_arm.abduction": raised, "right_forearm.flexion": 30.0})
    other = body.joints_m + np.array([0.1, 0.0, 0.0])
    hull = np.random.default_rng(number).normal(body.joints_m[8], 0.05, (500, 3))
    body = replace(body, hypotheses=((0.6, other),), hull_m=hull.astype(np.float32))
    return staged_frame(RIG, body, number)


@contextmanager
def serving(
    token: str | None = None, receivers=tuple, people: int = 1
) -> Iterator[tuple[Page, FakeControls]]:
    """A page that leaves no thread behind, and prints nothing."""
    before = set(threading.enumerate())
    controls = FakeControls()
    page = Page(controls, RIG, Address("127.0.0.1", 0, token), receivers, people=people)
    try:
        yield page, controls
    finally:
        page.close()
        page.close()
        wait_until(lambda: set(threading.enumerate()) <= before, 3.0)


def fetched(page: Page, path: str, word: str | None = None) -> Any:
    """Content of an answer: JSON, or bytes."""
    data = None if word is None else json.dumps({"word": word}).encode()
    headers = {"Content-Type": "application/json"}
    request = urllib.request.Request(f"{page.url}{path}", data, headers)
    with urllib.request.urlopen(request, timeout=20) as answer:
        content = answer.read()
        return json.loads(content) if "json" in answer.headers["Content-Type"] else content


def events(page: Page) -> Iterator[dict]:
    with urllib.request.urlopen(f"{page.url}/events", timeout=20) as answer:
        for line in answer:
            if line.startswith(b"data: "):
                yield json.loads(line.removeprefix(b"data: "))


def array(sent: dict) -> np.ndarray:
    return np.frombuffer(base64.b64decode(sent["data"]), sent["type"])


def test_showing_costs_nothing_while_nobody_looks(capsys):
    frame = waving(0)
    with serving() as (page, _):
        begun = time.perf_counter()
        for _ in range(1000):
            page.show(frame)
        assert time.perf_counter() - begun < 2
        assert page._scene.bodies[0].content() == {}  # nothing was made
    assert capsys.readouterr().out == ""


def test_a_new_body_is_built_anew_but_not_with_every_frame():
    sent = SentBody()
    first, other = person(), person(1.85)
    assert sent.use(first) == 1 and sent.use(other) == 1  # too soon
    sent._built_s -= 2
    assert sent.use(replace(first)) == 1  # another object, the same body
    assert sent.use(other) == 2
    content = sent.content()
    assert content["version"] == 2
    vertices = array(content["vertices"]).reshape(-1, 3)
    assert np.ptp(vertices[:, 2]) == pytest.approx(1.85, abs=0.01)


def test_several_people_have_a_colour_each():
    frame = replace(waving(0), people=(None, waving(0).body))
    scene = LiveScene(RIG.cameras, 2)
    colours = scene.stage("walk")["colours"]
    assert colours == [person_colour(0), person_colour(1)] and colours[0] != colours[1]
    moment = scene.moment(frame)
    absent, there = moment["people"]
    assert absent is None and there["version"] == 1
    assert len(array(moment["hull"])) == 3 * 500 and moment["hypotheses"] == []


def test_parts_are_where_the_body_model_has_them():
    body = posed({"left_upper_arm.abduction": 50.0, "left_shin.flexion": 70.0, "neck.rotation": 30})
    scene = LiveScene(RIG.cameras)
    (place,) = scene.moment(staged_frame(RIG, body))["people"]
    turns = kinematics.rotation_matrices(array(place["turn"]).reshape(-1, 4) / 32767)
    assert np.abs(turns - body.part_rotation).max() < 1e-3
    # As the player does: each joint from its parent's.
    sent = scene.bodies[0].content()
    joints, origins = array(sent["joints"]).reshape(-1, 3), [array(place["root"])]
    for part, parent in enumerate(sent["parents"][1:], 1):
        origins.append(origins[parent] + turns[parent] @ (joints[part] - joints[parent]))
    assert np.abs(np.array(origins) - body.part_origin_m).max() < 0.002


def test_other_poses_are_those_of_one_camera():
    moment = LiveScene(RIG.cameras).moment(waving(0))
    (pose,) = moment["hypotheses"]
    assert pose["share"] == 1 and len(array(pose["ends"])) % 6 == 0


def test_a_page_is_told_what_is_new_and_its_buttons_ask():
    receivers = (ReceiverState("vmc://10.0.0.7:39539", "sending", True, 12, 0, 0.002),)
    evil = "</title><script>"
    controls = FakeControls()
    page = Page(controls, RIG, Address("127.0.0.1", 0), lambda: receivers, evil)
    try:
        assert b"<title>&lt;/title&gt;&lt;script&gt;</title>" in fetched(page, "/")
        assert [camera["name"] for camera in fetched(page, "/api/scene")["cameras"]] == [*RIG.names]
        told = events(page)
        first = next(told)
        assert first["state"]["session"]["dropped"] == 17 and "people" not in first
        assert first["state"]["receivers"][0]["sent"] == 12
        page.show(waving(0))
        moment = next(event for event in told if "people" in event)
        assert moment["people"][0]["version"] == fetched(page, "/api/body?person=0")["version"] == 1
        told.close()
        for path in ("/picture/cam_1", "/picture/cam_2?outlines=1"):
            assert fetched(page, path)[:2] == b"\xff\xd8"
        for word, call in (("record", "record"), ("end recording", "end_recording")):
            assert fetched(page, "/api/ask", word) == {} and controls.asked[-1] == call
        nobody = "/api/body?person=1", None
        for path, word in (("/api/ask", "dance"), ("/picture/cam_9", None), nobody):
            with pytest.raises(urllib.error.HTTPError, match="400"):
                fetched(page, path, word)
    finally:
        page.close()


def test_small_pictures_have_outlines_and_no_distortion():
    camera = ring(1, (1280, 960), (-0.3, 0.1, 0.0, 0.0)).cameras[0]
    view = UndistortedView.from_camera(camera, 320)
    picture = np.full((960, 1280, 3), (200, 100, 50), np.uint8)
    mask = np.zeros((240, 320), bool)
    mask[60:180, 100:220] = True
    found = small_picture(picture, mask, view)
    assert found.shape == (240, 320, 3) and found[120, 160].tolist() == [200, 100, 50]
    outline = np.abs(found.astype(int) - SILHOUETTE[::-1]).sum(2) < 90
    assert 200 < outline.sum() < 1500
    expected = view.undistort(mask).astype(np.uint8)
    edge = cv2.dilate(expected, np.ones((5, 5))) > cv2.erode(expected, np.ones((5, 5)))
    assert (outline & edge).sum() > 0.9 * outline.sum()
    assert not (
        np.abs(small_picture(picture, None, view).astype(int) - SILHOUETTE[::-1]).sum(2) < 90
    ).any()


@pytest.mark.slow
def test_the_page_in_a_browser():
    receivers = (ReceiverState("vmc://10.0.0.7:39539", "sending", True, 12, 0, 0.002),)
    stopped = threading.Event()
    with (
        new_page(1000, 520) as (browser, faults),
        serving("open sesame", receivers=lambda: receivers) as (page, controls),
    ):
        frames = [waving(number) for number in range(7)]

        def feed() -> None:
            for frame in cycle(frames):
                if stopped.wait(0.05):
                    break
                page.show(replace(frame))

        feeding = threading.Thread(target=feed)
        feeding.start()
        try:
            look(browser, page, controls)
            assert faults == []
            browser.context.close()  # before its server
        finally:
            stopped.set()
            feeding.join()


def look(browser, page: Page, controls: FakeControls) -> None:
    """What a user does, and what happens then."""
    browser.goto(page.url)
    assert "sesame" not in browser.url  # the address bar does not keep the token
    browser.get_by_text("Leave the view and press Background.").wait_for(timeout=20_000)
    until(browser, "window.live?.people[0].body && live.player.drawn > 3")
    places = set()

    def moves() -> bool:
        browser.wait_for_timeout(50)
        places.add(browser.evaluate("live.people[0].body.origins.map((p) => p[2]).join()"))
        return len(places) > 4

    wait_until(moves)
    first = canvas_picture(browser)
    assert (first[..., 0] - first[..., 2] > 50).sum() > 1000  # the figure is there
    wait_until(lambda: np.abs(canvas_picture(browser) - first).max() > 40)  # and moves
    until(browser, "live.player.cameras.every(({ texture }) => texture)")
    for name in ("vmc://10.0.0.7:39539", "cam_3", "17 dropped", "silhouettes"):
        browser.get_by_text(name).first.wait_for()
    for button, call, text in (
        ("Background", "learn_background", "Learning the empty room."),
        ("Start", "start", "Following one person."),
        ("Record", "record", "● recording"),
        ("End recording", "end_recording", "Following one person."),
        ("Stop", "stop", "The cameras go on."),
    ):
        browser.get_by_role("button", name=button, exact=True).click()
        # Not all texts change with the click.
        wait_until(
            lambda call=call: (browser.wait_for_timeout(20), controls.asked[-1:] == [call])[1]
        )
        browser.get_by_text(text).first.wait_for()
    assert len(controls.asked) == 5
    blue = figure_pixels(browser)
    browser.get_by_label("Person").first.uncheck()
    wait_until(lambda: (browser.wait_for_timeout(50), figure_pixels(browser) < blue / 2)[1])


def figure_pixels(browser) -> int:
    """Number of pixels that are as blue as a lone person."""
    shown = canvas_picture(browser)
    return int((shown[..., 0] - shown[..., 2] > 50).sum())


def canvas_picture(browser) -> np.ndarray:
    """Picture of the room, (h, w, 3) BGR."""
    data = np.frombuffer(browser.screenshot(), np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :380].astype(int)
