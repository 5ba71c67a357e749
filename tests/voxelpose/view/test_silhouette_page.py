"""The page of silhouettes beside the viewer: what is said of them is what the fit did."""

import json
import threading
from dataclasses import dataclass

import cv2
import numpy as np
import pytest

from silhouette_core.image.foreground import SoftSilhouette
from silhouette_core.image.silhouettes import UndistortedView, as_recorded
from tests.browsing import new_page, until
from tests.clips import waving
from tests.sources import ring, write_staged
from tests.voxelpose.setup_page.setup_scenes import ask
from voxelpose.cli import run
from voxelpose.view.images.figure import body_parts
from voxelpose.view.serving.gate import Address
from voxelpose.view.serving.page_answers import parse_request
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.previews import StageAsked
from voxelpose.view.viewer.result_scenes import ResultScenes
from voxelpose.view.viewer.silhouette_page import FitSilhouette, FitSilhouettes, SilhouettePage

SIZE, LENS = (320, 240), (-0.2, 0.05, 0.0, 0.0)
PIXEL = [SIZE[0] / 2, SIZE[1] / 2]


def write_result(desk, cameras=3, **changes) -> None:
    """A result "out" of a recording "walk"; settings and facts are then changed."""
    write_staged(desk / "walk", waving(6), ring(cameras, SIZE))
    words = "fit walk --out out --estimator standing --no-pictures --fps 25"
    assert run(words.split()) == 0
    estimator = changes.pop("estimator", "standing")
    path = desk / "out" / "settings.toml"
    path.write_text(path.read_text().replace('"standing"', f'"{estimator}"'))
    path = desk / "out" / "summary.json"
    summary = json.loads(path.read_text())
    summary["facts"] = {**summary.get("facts", {}), **changes}
    path.write_text(json.dumps(summary))


@dataclass
class Told:
    """Silhouettes that somebody wrote down, and where else the picture differs."""

    masks: dict
    tint: dict

    def of(self, frames, step=None):
        return {name: self.masks[name] for name in frames}

    def soft(self, frames, step=None):
        nowhere = np.zeros(SIZE[::-1], bool)
        return {
            name: SoftSilhouette(self.masks[name], self.tint.get(name, nowhere)) for name in frames
        }


def bodies_of(scenes, frame) -> dict:
    """The silhouettes (h, w) bool of the fitted body by camera name."""
    model, (body,) = scenes.motions[0].model, scenes.bodies(frame)
    return {camera.name: body_parts(model, body.vertices_m, camera) > 0 for camera in scenes.rig}


def asked(page, **what) -> dict:
    """The answer to a request for a stage, once the backgrounds are learned."""
    request = json.dumps({"moment": 3, "camera": "cam_1"} | what).encode()
    while not (answer := page.stage(parse_request(request, StageAsked)))["ready"]:
        threading.Event().wait(0.05)
    return answer


def image_of(answer) -> np.ndarray:
    data = np.frombuffer(answer["png"], np.uint8)
    return cv2.imdecode(data, cv2.IMREAD_UNCHANGED)


def test_a_lens_shows_again_what_was_undistorted():
    camera = ring(1, (1280, 960), (-0.3, 0.1, 0.0, 0.0)).cameras[0]
    mask = np.zeros((240, 320), np.uint8)
    cv2.circle(mask, (230, 90), 60, 1, -1)
    seen = UndistortedView.from_camera(camera, 320).undistort(mask > 0)
    again = as_recorded(seen.astype(np.float32), camera) > 0.5
    assert (seen ^ (mask > 0)).sum() > 300 > 10 * (again ^ (mask > 0)).sum()


def test_other_cameras_add_what_one_misses(desk):
    write_result(desk, 4, estimator="multiview")
    scenes = ResultScenes("out", voxel_size_m=0.03)
    fit, bodies = FitSilhouettes(scenes), bodies_of(scenes, 3)
    gap = np.zeros(SIZE[::-1], bool)
    middle = np.argwhere(bodies["cam_2"]).mean(axis=0).astype(int)
    gap[middle[0] - 20 : middle[0] - 5] = True
    gap &= bodies["cam_2"]
    told = Told(bodies | {"cam_2": bodies["cam_2"] & ~gap}, {"cam_2": gap})
    found = fit.of(3, scenes.recording.backgrounds(), told)
    one = found["cam_2"]
    assert (one.used & gap).sum() > 0.8 * gap.sum()
    for name, body in bodies.items():
        assert (found[name].used & ~body).sum() < 0.1 * gap.sum()
    assert "added: other cameras show it" in one.summary() and "taken out" not in one.summary()
    at = tuple(np.argwhere(one.used & gap)[0])
    told_before = {"person": False, "why": "its colours say so", "measures": ["odds"]}
    explained = one.explained(told_before, at)
    assert explained["person"] and explained["why"] == "added: other cameras show it"
    assert explained["measures"] == ["odds", "inside the body"]
    outside = one.explained(told_before | {"person": False}, (0, 0))
    assert outside["why"] == "its colours say so" and "outside the body" in outside["measures"]


def test_of_one_camera_only_pieces_of_the_person_are_used(desk):
    write_result(desk, 1, estimator="monocular")
    scenes = ResultScenes("out")
    (body,) = bodies_of(scenes, 3).values()
    other = np.zeros_like(body)
    other[5:45, 5:35] = True
    told = Told({"cam_1": body | other}, {})
    one = FitSilhouettes(scenes).of(3, scenes.recording.backgrounds(), told)["cam_1"]
    assert np.array_equal(one.used, body) and "taken out: no piece of the person" in one.summary()


def test_what_an_unknown_estimator_used_is_not_claimed(desk):
    write_result(desk, 2)
    scenes = ResultScenes("out")
    bodies = bodies_of(scenes, 3)
    frames = scenes.recording.backgrounds()
    one = FitSilhouettes(scenes).of(3, frames, Told(bodies, {}))["cam_1"]
    assert one.summary() == "silhouette and body have 100 % in common"


def test_kept_added_and_taken_out_have_their_colours():
    alone, used, body = (np.zeros((60, 80), bool) for _ in range(3))
    alone[:, :40], used[:, 20:60], body[10:50, 65:75] = True, True, True
    one = FitSilhouette(alone, used, body, ("added here", "taken out here"))
    image = cv2.imdecode(np.frombuffer(one.picture(), np.uint8), cv2.IMREAD_UNCHANGED)
    taken, kept, added, line = (image[30, x] for x in (10, 30, 50, 65))
    assert taken[2] > 200 > taken[1] and added[1] > 200 > added[2] and kept[0] > 200 > kept[2]
    assert line[1] > 150 < line[2] and line[0] < 100 and not image[30, 70, 3]
    assert one.summary().startswith("33.3 % added here; 33.3 % taken out here")


def test_cameras_that_the_fit_put_in_step_are_shown_in_step(desk):
    write_result(desk, 2, late_frames={"cam_2": 2})
    page = SilhouettePage(ResultScenes("out"))
    frames = page._frames(1)
    first, late = (page._moments.frames(moment) for moment in (1, 3))
    assert np.array_equal(frames["cam_1"], first["cam_1"])
    assert np.array_equal(frames["cam_2"], late["cam_2"])
    assert not np.array_equal(frames["cam_2"], first["cam_2"])
    assert np.array_equal(page._frames(5)["cam_2"], page._moments.frames(5)["cam_2"])


def test_a_recording_alone_has_no_body(desk):
    write_staged(desk / "walk", waving(6), ring(2, SIZE))
    page = SilhouettePage(ResultScenes("walk"))
    state = page.state()
    assert state["name"] == "walk" and not state["fitted"] and state["moments"] == 6
    shown = image_of(asked(page, stage="silhouette"))
    assert shown[120, 160, 3] and not shown[2, 2, 3]
    explained = asked(page, pixel=PIXEL)["explained"]
    assert explained["person"] and explained["background"] == [50, 60, 70]
    for damaged, words in (
        ({"stage": "body"}, "nothing is fitted yet"),
        ({"camera": "cam_9"}, "there is no camera"),
        ({"moment": 99}, "there is no moment 99"),
        ({"stage": "other"}, "not understood"),
    ):
        with pytest.raises(Exception, match=words):
            asked(page, **damaged)


def test_one_camera_without_a_calibration_is_shown(desk):
    write_staged(desk / "walk", waving(3), ring(1, SIZE))
    (desk / "walk" / "calibration.toml").unlink()
    scenes = ResultScenes("walk")
    assert scenes.rig.names == ("cam_1",) and scenes.scene(1).camera_frames[0].mask is not None


def test_masks_are_shown_with_the_body_over_them(desk):
    write_result(desk, 2)
    for name, body in bodies_of(ResultScenes("out"), 3).items():
        folder = desk / "walk" / "masks" / name
        folder.mkdir(parents=True)
        (desk / "walk" / f"{name}.mkv").unlink()
        for number in range(6):
            cv2.imwrite(str(folder / f"{number}.png"), 255 * body.astype(np.uint8))
    page = SilhouettePage(ResultScenes("out"))
    assert page.state()["masks_only"]
    assert image_of(asked(page, stage="body"))[120, 160, 3]


@pytest.mark.slow
def test_the_page_explains_the_pixel_under_the_mouse(desk):
    write_result(desk, 2, estimator="multiview")
    browser = Browser(
        ResultScenes("out", voxel_size_m=0.04), Address("127.0.0.1", 0, "a word <b>"), 2
    )
    with new_page(1100, 800) as (viewer, faults):
        viewer.goto(browser.url)
        viewer.get_by_text("Frame 2,").wait_for(timeout=60_000)
        assert viewer.title() == "out – voxelpose view"
        with viewer.context.expect_page() as opened:
            viewer.get_by_text("Silhouettes step by step").click()
        page = opened.value
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda said: faults.append(said.text) if said.type == "error" else None)
        assert page.url.endswith("/silhouettes/?frame=2")
        page.get_by_text("frame 2 ").wait_for()
        page.locator('[data-camera="cam_1"] canvas').click()
        for stage in ("background", "odds", "first", "silhouette", "body"):
            page.locator(f'[data-stage="{stage}"]').click()
            shown = f"[...app.views.values()].every((view) => view.staged?.stage === '{stage}')"
            until(page, shown, 60.0)
        page.get_by_text("silhouette and body have").wait_for()
        box = page.locator(".tile.large canvas").bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        line = page.locator("#pixel")
        line.locator("b").get_by_text("person", exact=True).wait_for()
        assert "inside the body" in line.inner_text()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 4)
        line.locator("b").get_by_text("background", exact=True).wait_for()
        page.locator('[data-stage="picture"]').click()
        page.locator("#forward").click()
        page.get_by_text("frame 3 ").wait_for()
        assert faults == []
    browser.close()


def test_only_the_page_beside_takes_json(desk):
    write_staged(desk / "walk", waving(3), ring(2, SIZE))
    browser = Browser(ResultScenes("walk"), Address("127.0.0.1", 0), 1)
    try:
        assert b"main.js" in ask(browser, "/silhouettes/?frame=2")[1]
        assert ask(browser, "/silhouettes/api/stage", {})[0] == 400
        for target in ("/", "/silhouettes", "/silhouettes2/", "//silhouettes/"):
            assert ask(browser, f"{target}api/stage", {})[0] == 404
    finally:
        browser.close()
