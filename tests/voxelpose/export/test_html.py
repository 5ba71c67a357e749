"""The page of a motion that needs no server."""

import base64
import json
import re
from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest

from silhouette_core.motion.kinematics import rotation_matrices, skin
from tests.browsing import new_page, until
from tests.clips import waving, waving_couple
from tests.other_bodies import write_example_result
from tests.sources import ring
from voxelpose.cli import run
from voxelpose.export.formats import export_motion
from voxelpose.export.html_player import write_html
from voxelpose.export.player_scene import CONFIDENCE, Stage, player_scene, skeleton_lines
from voxelpose.report.charts import overlap_colours
from voxelpose.view.images import canvas

RIG = ring(3, (320, 240))


def test_one_file_holds_all_and_asks_for_nothing(tmp_path):
    write_html(waving(20), tmp_path / "a.html", Stage("</script><b>", RIG))
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert len(text) < 400_000 and not re.search(
        r"https?://|src=|@import|\bimport\b[^;]*from", text
    )
    assert text.count("<script") == text.count("</script>") == 2  # the name opens none
    scene = json.loads(text.split('type="application/json">')[1].split("</script>")[0])
    assert scene["name"] == "</script><b>" and scene["count"] == 20
    assert [camera["name"] for camera in scene["cameras"]] == ["cam_1", "cam_2", "cam_3"]


@pytest.mark.slow
def test_it_opens_from_a_file_and_plays(tmp_path):
    motion = waving(20)
    write_html(motion, tmp_path / "a.html", Stage("walk", RIG))
    with new_page(900, 600) as (page, faults):
        page.goto((tmp_path / "a.html").as_uri())
        page.get_by_text("Frame 10,").wait_for()
        assert page.title() == "walk – voxelpose"
        until(page, "player.drawn > 0")
        with_body = page.locator("canvas.space").screenshot()
        page.get_by_label("Body", exact=True).uncheck()
        page.wait_for_timeout(400)
        assert page.locator("canvas.space").screenshot() != with_body
        page.keyboard.press("Home")
        page.keyboard.press("Space")
        until(page, "player.timeline.playing && player.timeline.index > 3")
        until(page, "!player.fine && player.canvas.width === player.canvas.clientWidth")
        assert page.evaluate("player.skins[0].mesh.outside === player.renderer.gl.CCW")
        page.keyboard.press("Space")
        page.keyboard.press("End")
        page.get_by_text("Frame 19,").wait_for()
        # The player's kinematics are those of the program.
        page.evaluate("player.bodies[0].place(7)")
        found = np.array(page.evaluate("player.bodies[0].skeleton().map((p) => Array.from(p))"))
        np.testing.assert_allclose(found, _points(motion, 7), atol=2e-3)
        page.get_by_role("button", name="cam_1").click()
        until(page, "player.viewpoint.pinhole && !player.viewpoint.flight")
        page.wait_for_timeout(300)
        pixel, camera = page.evaluate(_PIXEL, found[0].tolist()), RIG["cam_1"]
        expected, _ = camera.project(found[:1])
        np.testing.assert_allclose(pixel, expected[0], atol=0.5)
        assert faults == []


# Where a point is in the picture of the camera that is looked through.
_PIXEL = """(point) => {
  const { viewpoint, canvas } = player;
  const [x, y] = viewpoint.pixel(viewpoint.matrix(performance.now()), point);
  const [scale, left, top] = viewpoint.pinhole.fitted(canvas.clientWidth, canvas.clientHeight);
  return [(x - left) / scale - 0.5, (y - top) / scale - 0.5];
}"""


def test_colours_are_those_of_the_overlays_and_the_report():
    script = files("voxelpose.export").joinpath("page", "player.js").read_text(encoding="utf-8")

    def colours(name: str) -> np.ndarray:
        text = re.search(rf"const {name} = (.*);", script)
        assert text is not None
        return np.array(re.findall(r"(\d+), (\d+), (\d+)", text[1]), int)

    sides = [colour[::-1] for colour in (canvas.LEFT, canvas.RIGHT, canvas.MIDDLE)]
    assert colours("SIDES").tolist() == [list(side) for side in sides]
    assert colours("RAMP").tolist() == overlap_colours(np.array([0, 0.5, 1])).tolist()


def test_hands_feet_and_head_are_drawn_to_their_ends():
    motion = waving(3)
    model = motion.model
    parts, _, bones = skeleton_lines(model)
    ends = [model.names[parts[end]] for end in bones[:, 1] if end >= len(model.names)]
    assert {"left_fingers", "right_fingers", "left_toes", "right_toes", "head"} <= set(ends)
    rotation, origin = motion.parts()
    surface = skin(model, rotation[1], origin[1])
    points = _points(motion, 1)
    tips = points[len(model.names) :]
    away = np.linalg.norm(tips[:, None] - surface, axis=2).min(axis=1)
    assert away.max() < 0.03  # at the skin, where a limb ends
    assert points[:, 2].min() < surface[:, 2].min() + 0.06
    assert points[:, 2].max() > surface[:, 2].max() - 0.06


def test_lost_frames_are_told_from_poses():
    motion = waving(4)
    frames = np.array([1, 2, 4, 5])
    share = np.array([0.0, 0.5, np.nan, 1.0])
    motion = replace(
        motion, frames=frames, time_s=frames / 25, quality={"outline_agreement": share}
    )
    scene = player_scene([motion], 25.0, Stage(frames=(0, 7)))
    body = scene["bodies"][0]
    assert scene["count"] == 7 and scene["start_s"] == pytest.approx(0)
    assert unpacked(body["rows"]).tolist() == [-1, 0, 1, -1, 2, 3, -1]
    assert unpacked(body["confidence"]).tolist() == [0, 125, 255, 250]  # 255: nobody knows
    assert body["measure"] == CONFIDENCE["outline_agreement"]
    assert player_scene([waving(2)], 25.0, Stage())["bodies"][0]["confidence"] is None


def test_what_is_sent_is_what_is_fitted():
    """Parts placed by the rotations and the root that are sent are where the motion has them."""
    motion = waving(5)
    model = motion.model
    body = player_scene([motion], 25.0, Stage())["bodies"][0]
    turn = unpacked(body["turn"]).reshape(5, -1, 4) / 32767
    rotation = rotation_matrices(turn[3] / np.linalg.norm(turn[3], axis=1, keepdims=True))
    joints = unpacked(body["joints"]).reshape(-1, 3)
    origin = [unpacked(body["root"]).reshape(-1, 3)[3]]
    for part, parent in enumerate(body["parents"][1:], 1):
        origin.append(origin[parent] + rotation[parent] @ (joints[part] - joints[parent]))
    vertices = skin(
        replace(model, vertices_m=unpacked(body["vertices"]).reshape(-1, 3).astype(float)),
        rotation,
        np.array(origin, float),
    )
    expected = skin(model, *(array[3] for array in motion.parts()))
    assert np.linalg.norm(vertices - expected, axis=1).max() < 5e-4
    weights = unpacked(body["skin_weights"]).reshape(-1, 4)
    assert (weights.astype(int).sum(axis=1) == 255).all()
    assert abs(weights / 255 - model.skin_weights).max() < 0.01


def test_people_stand_on_the_floor_that_is_drawn():
    motion = waving(3)
    lifted = replace(motion, root_m=motion.root_m + np.array([0, 0, 2.0]))
    floors = [player_scene([one], 25.0, Stage())["floor_m"] for one in (motion, lifted)]
    lowest = skin(motion.model, *(array[1] for array in motion.parts()))[:, 2].min()
    assert floors[0] == motion.floor_m  # the calibration's
    assert floors[1] == pytest.approx(lowest + 2, abs=0.05)  # that one has none


def test_results_stand_side_by_side_under_their_names():
    motions = [waving(3), *waving_couple(3)]
    stage = Stage("a", RIG, results=(("a", 1), ("b", 2)))
    scene = player_scene(motions, 25.0, stage)
    assert [body["name"] for body in scene["bodies"]] == ["a", "b person_1", "b person_2"]
    assert [body["result"] for body in scene["bodies"]] == [0, 1, 1]
    view, apart = np.subtract(scene["look_at"], scene["eye"]), np.array(scene["apart"])
    assert abs(view @ apart) < 1e-6 and 0.8 < np.linalg.norm(apart) < 4
    # To the right, as whoever looks has it.
    assert np.cross(view, [0, 0, 1]) @ apart > 0


def test_several_people_are_in_one_page(tmp_path):
    paths = export_motion(waving_couple(4), tmp_path / "out", ["html", "bvh"])
    names = {path.relative_to(tmp_path / "out").as_posix() for path in paths}
    assert "motion.html" in names and "person_1/motion.html" not in names
    text = (tmp_path / "out" / "motion.html").read_text(encoding="utf-8")
    assert '"person_1"' in text and '"person_2"' in text


@pytest.mark.slow
def test_a_body_that_is_no_persons(desk):
    _, motion = write_example_result(desk, "quadruped", pictures=False)
    assert run(["export", "quadruped_fit", "--to", "html"]) == 0
    with new_page(900, 600) as (page, faults):
        page.goto((desk / "quadruped_fit" / "motion.html").as_uri())
        until(page, "player.drawn > 0")
        assert page.title() == "quadruped_fit – voxelpose" and faults == []
        count = page.evaluate("player.bodies[0].bones.length / 2")
        assert count == len(motion.model.tree.landmark_bones)


def _points(motion, row):
    """Points of the skeleton in a row of a motion."""
    parts, local, _ = skeleton_lines(motion.model)
    rotation, origin = motion.parts()
    return origin[row, parts] + np.einsum("nij,nj->ni", rotation[row, parts], local)


def unpacked(sent):
    return np.frombuffer(base64.b64decode(sent["data"]), sent["type"])
