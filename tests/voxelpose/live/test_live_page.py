"""The live page: without a browser, and in one without a screen."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import cycle

import cv2
import numpy as np
import pytest

from silhouette_core.image.silhouettes import UndistortedView
from tests.browsing import new_page
from tests.sources import ring
from tests.voxelpose.live.fake_session import FakeControls
from tests.voxelpose.live.live_scenes import person, posed, staged_frame
from voxelpose.live.live_frame import LiveFrame
from voxelpose.live.live_page import Page, links_html, status_html, timings_html
from voxelpose.live.live_scene import LAYERS, small_picture
from voxelpose.live.senders import ReceiverState
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.legend import SILHOUETTE, css_colour, person_colour

RIG = ring(2, (320, 240), (-0.2, 0.05, 0.0, 0.0))


def waving(number: int) -> LiveFrame:
    """A frame of a body that waves with its right arm."""
    raised = 60 + 50 * np.sin(number)
    body = posed({"right_upper_arm.abduction": raised, "right_forearm.flexion": 30.0})
    other = body.joints_m + np.array([0.1, 0.0, 0.0])
    hull = np.random.default_rng(number).normal(body.joints_m[8], 0.05, (500, 3))
    body = replace(body, hypotheses=((0.6, other),), hull_m=hull.astype(np.float32))
    return staged_frame(RIG, body, number)


def wait_until(true: Callable[[], bool], seconds: float = 10.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.02)


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


def test_showing_costs_nothing_while_nobody_looks(capsys):
    frame = waving(0)
    with serving() as (page, _):
        begun = time.perf_counter()
        for _ in range(1000):
            page.show(frame)
        assert time.perf_counter() - begun < 2
        time.sleep(0.3)
        assert page._scene._figures[0]._handle is None  # nothing was drawn
    assert capsys.readouterr().out == ""


def test_a_new_body_is_built_anew_but_not_with_every_frame():
    with serving() as (page, _):
        (figure,) = page._scene._figures
        first, other = posed({}), posed({}, model=person(1.85))
        figure.draw(first)
        built = figure._handle
        figure.draw(other)
        assert figure._handle is built  # too soon
        figure._built_s -= 2
        figure.draw(replace(first, model=replace(person())))  # another object, the same body
        assert figure._handle is built
        figure.draw(other)
        assert figure._handle is not built and figure._handle is not None
        assert np.ptp(figure._handle.vertices[:, 2]) == pytest.approx(1.85, abs=0.01)
        figure.draw(None)
        assert not figure._handle.visible
        figure.draw(other)
        assert figure._handle.visible


def test_several_people_have_a_colour_each():
    frame = waving(0)
    frame = replace(frame, people=(None, frame.body))
    with serving(people=2) as (page, controls):
        scene = page._scene
        scene.draw(frame, frozenset(LAYERS))
        absent, there = scene._figures
        assert absent._handle is None and there._handle is not None
        assert there._handle.color == person_colour(1) != person_colour(0)
        assert len(scene._hull.points) == 500
    text = timings_html(controls.state, frame)
    assert "person 1</span><b>–" in text and "person 2</span><b>88 %" in text
    assert css_colour(person_colour(1)) in text


def test_bones_move_the_skin_as_the_body_model_does():
    from silhouette_core.motion import kinematics
    from voxelpose.live.live_scene import _BONE_OF, _BONES

    body = posed({"left_upper_arm.abduction": 50.0, "left_shin.flexion": 70.0, "neck.rotation": 30})
    with serving() as (page, _):
        (figure,) = page._scene._figures
        figure.draw(body)
        handle = figure._handle
        assert handle is not None and len(handle.bones) == len(_BONES) < len(_BONE_OF) == 27
        turns = kinematics.rotation_matrices(np.array([bone.wxyz for bone in handle.bones]))
        places = np.array([bone.position for bone in handle.bones])
    # viser's weights are in the message only: skinned here by the parts' bones.
    model = body.model
    local = model.vertices_m[:, None] - model.joints_m[_BONES][_BONE_OF[model.skin_parts]]
    turned = np.einsum("vkij,vkj->vki", turns[_BONE_OF[model.skin_parts]], local)
    skin = ((turned + places[_BONE_OF[model.skin_parts]]) * model.skin_weights[..., None]).sum(1)
    expected = kinematics.skin(model, body.part_rotation, body.part_origin_m)
    assert np.abs(skin - expected).max() < 0.002


def test_small_pictures_have_outlines_and_no_distortion():
    camera = ring(1, (1280, 960), (-0.3, 0.1, 0.0, 0.0)).cameras[0]
    view = UndistortedView.from_camera(camera, 320)
    picture = np.full((960, 1280, 3), (200, 100, 50), np.uint8)
    mask = np.zeros((240, 320), bool)
    mask[60:180, 100:220] = True
    found = small_picture(picture, mask, view)
    assert found.shape == (240, 320, 3) and found[120, 160].tolist() == [50, 100, 200]
    outline = np.abs(found.astype(int) - SILHOUETTE).sum(2) < 90
    assert 200 < outline.sum() < 1500
    expected = view.undistort(mask).astype(np.uint8)
    edge = cv2.dilate(expected, np.ones((5, 5))) > cv2.erode(expected, np.ones((5, 5)))
    assert (outline & edge).sum() > 0.9 * outline.sum()
    assert not (
        np.abs(small_picture(picture, None, view).astype(int) - SILHOUETTE).sum(2) < 90
    ).any()


def test_texts_show_what_other_machines_say_as_text():
    controls = FakeControls()
    evil = "<script>alert(1)</script>"
    texts = (
        status_html(replace(controls.state, message=evil, recording=True), evil),
        timings_html(replace(controls.state, stage_s={evil: 0.1}), None),
        links_html({evil: "ok"}, [ReceiverState("ws://x", evil, False, 3, 4, 0.0015)]),
    )
    assert all("<script" not in text and "&lt;script" in text for text in texts)
    assert "recording" in texts[0] and "17 dropped" in texts[1]
    assert "3 sent, 4 dropped, 1.5 ms" in texts[2]


@pytest.mark.slow
def test_the_page_in_a_browser():
    receivers = (ReceiverState("vmc://10.0.0.7:39539", "sending", True, 12, 0, 0.002),)
    stopped = threading.Event()
    with (
        new_page(760, 520) as (browser, faults),
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
    browser.locator("canvas").first.wait_for()
    (figure,) = page._scene._figures
    wait_until(lambda: figure._handle is not None)
    assert figure._handle is not None
    hand = max(figure._handle.bones, key=lambda bone: -bone.position[0])
    places = set()

    def moves() -> bool:
        browser.wait_for_timeout(50)
        places.add(round(float(hand.position[2]), 3))
        return len(places) > 4

    wait_until(moves)
    first = canvas_picture(browser)
    assert (first[..., 0] - first[..., 2] > 50).sum() > 1000  # the figure is there
    wait_until(lambda: np.abs(canvas_picture(browser) - first).max() > 40)  # and moves
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
    browser.get_by_label("Person").first.uncheck()
    wait_until(lambda: (browser.wait_for_timeout(50), not figure._handle.visible)[1])  # type: ignore[union-attr]


def canvas_picture(browser) -> np.ndarray:
    """Picture of the room, (h, w, 3) BGR."""
    data = np.frombuffer(browser.screenshot(), np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_COLOR)[:, :380].astype(int)
