"""Scenes of the viewer, before they are drawn."""

import shutil

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.body.joints import LANDMARK_BONES
from silhouette_core.body.kinematic_tree import KinematicTree
from silhouette_core.body.rigid_parts import Box, body_of_parts
from silhouette_core.estimator import Estimate, Settings
from silhouette_core.motion.motion import Motion
from tests.other_bodies import write_example_result
from tests.sources import ring, write_staged
from tests.voxelpose.multiview.carving.carving_scenes import voxels_at
from voxelpose.cli import run
from voxelpose.export.tables import read_hypotheses
from voxelpose.fitting import Output, write_estimate
from voxelpose.recording.folder import Recording
from voxelpose.report.charts import overlap_colours
from voxelpose.view.serving.gate import Address
from voxelpose.view.viewer.browser import Browser
from voxelpose.view.viewer.result_scenes import ResultScenes
from voxelpose.view.viewer.scene import camera_picture, frame_lines

CAMERAS, FRAMES = 4, 4


@pytest.fixture(scope="module")
def scenes(staged_once):
    """Scenes of a result whose poses are those of the recording."""
    opened = ResultScenes(staged_once / "out", voxel_size_m=0.03)
    yield opened
    opened.close()


def test_a_scene_holds_the_silhouettes_pose_and_hull_of_the_fit(scenes):
    scene = scenes.scene(2)
    assert scene.frame == 2 and scene.time_s == pytest.approx(2 / 25) and not scene.notes
    names = [camera_frame.camera.name for camera_frame in scene.camera_frames]
    assert names == [f"cam_{k + 1}" for k in range(CAMERAS)]
    for camera_frame in scene.camera_frames:
        pixels, _ = camera_frame.camera.project(scene.bodies[0].joints_m)
        columns, rows = np.rint(pixels).astype(int).T
        # The pose lies in the silhouettes, so frames are not mixed up.
        assert camera_frame.mask[rows, columns].mean() > 0.85
        red, mask = camera_frame.picture[..., 0], camera_frame.mask
        assert red[mask].mean() > red[~mask].mean() + 80  # the person is red in RGB
    hull = scene.hull
    joints = voxels_at(hull.grid, scene.bodies[0].joints_m)
    assert hull.occupancy[tuple(joints.T)].mean() > 0.85
    assert 0 < np.count_nonzero(hull.far) < 0.5 * np.count_nonzero(hull.occupancy)
    assert not (hull.far & ~hull.occupancy).any()
    np.testing.assert_array_equal(hull.nearest.person == 0, hull.occupancy)
    assert scenes.scene(2) is scene


def test_outer_voxels_know_their_part_and_who_sees_them(staged_once, scenes):
    hull, body = scenes.scene(2).hull, scenes.bodies(2)[0]
    outer, names = hull.outer, body.part_names
    assert 0.2 < len(outer.centres_m) / np.count_nonzero(hull.occupancy) < 0.9
    assert len(outer.at_vertex) == len(hull.vertices_m)
    near = outer.centres_m[outer.at_vertex] - hull.vertices_m
    assert np.linalg.norm(near, axis=1).max() < 2 * 0.03
    # The voxels of a part are about its joint: those of the head high, of the left hand at it.
    head = outer.part == names.index("head")
    assert outer.centres_m[head, 2].mean() > outer.centres_m[:, 2].mean() + 0.4
    for side in ("left", "right"):
        number = names.index(f"{side}_hand")
        own = outer.centres_m[(outer.part == number) & (outer.distance_m < 0.05)]
        away = np.linalg.norm(own.mean(axis=0) - body.joints_m[number])
        assert len(own) > 3 and away < 0.12
    # What is not covered by something else is seen, by some of the four, never by all round it.
    assert (outer.cameras > 0).mean() > 0.8 and 1 < outer.cameras.mean() < 3.5
    alone = ResultScenes(staged_once / "walk", voxel_size_m=0.04)
    assert alone.scene(1).hull.outer.part.max() == -1


def test_frames_in_any_order_are_the_same(staged):
    first, second = ResultScenes("out", voxel_size_m=0.04), ResultScenes("out", voxel_size_m=0.04)
    forward = [first.scene(frame) for frame in (1, 2, 3)]
    backward = [second.scene(frame) for frame in (3, 2, 1)][::-1]
    for a, b in zip(forward, backward, strict=True):
        np.testing.assert_array_equal(a.camera_frames[0].picture, b.camera_frames[0].picture)
        np.testing.assert_array_equal(a.hull.occupancy, b.hull.occupancy)
    assert (forward[0].camera_frames[0].picture != forward[2].camera_frames[0].picture).any()


def test_a_lost_frame_shows_the_hull_and_says_so(scenes):
    scene = scenes.scene(0)
    assert scene.bodies == (None,) and scene.hull.occupancy.any()
    assert scene.notes == ("no pose was found in this frame",)


def test_a_missing_recording(staged):
    shutil.rmtree("walk")
    scenes = ResultScenes("out")
    scene = scenes.scene(1)
    assert scene.hull is None and any(scene.bodies) and scene.camera_frames[0].picture is None
    assert "say where with --recording" in scene.notes[0]
    assert camera_picture(scene.camera_frames[0], "both") is None


def test_the_unit_of_a_fit_is_known(staged):
    calibration = staged / "walk" / "calibration.toml"
    lines = calibration.read_text().splitlines(keepends=True)
    calibration.write_text("".join(line for line in lines if not line.startswith("unit")))
    with pytest.raises(InputError, match="in which unit"):
        ResultScenes("walk")
    assert ResultScenes("out").scene(1).hull is not None


def test_a_recording_alone(staged):
    scenes = ResultScenes("walk", voxel_size_m=0.04)
    scene = scenes.scene(1)
    assert scene.bodies == () and scene.hull.occupancy.any() and not scene.notes
    assert len(scenes.frames) == FRAMES


def test_cameras_stay_in_step_where_timestamps_say_so(staged):
    """The second camera's first picture is missing: what it shows must still be of the frame's
    moment.
    """
    cameras = range(1, CAMERAS + 1)
    lines = [f"cam_{c},{(t + (c == 2)) / 25:.4f}\n" for c in cameras for t in range(FRAMES)]
    (staged / "walk" / "timestamps.csv").write_text("".join(["cam_id,frame_time\n", *lines]))
    late = ResultScenes("walk", voxel_size_m=0.05)
    (staged / "walk" / "timestamps.csv").unlink()
    whole = ResultScenes("walk", voxel_size_m=0.05)
    assert len(late.frames) == FRAMES - 1
    first, second, *_ = (one.picture for one in late.camera_frames(1))
    np.testing.assert_array_equal(first, whole.camera_frames(2)[0].picture)
    np.testing.assert_array_equal(second, whole.camera_frames(1)[1].picture)


def test_pictures_of_cameras(scenes):
    frame = scenes.scene(1).camera_frames[0]
    kinds = "silhouette", "picture", "both"
    silhouette, plain, both = (camera_picture(frame, kind) for kind in kinds)
    assert set(np.unique(silhouette)) == {30, 255}
    assert (silhouette[..., 0] == 255).sum() == frame.mask.sum()
    np.testing.assert_array_equal(plain, frame.picture)
    assert both[~frame.mask].mean() < 0.6 * plain[~frame.mask].mean()


def test_hypotheses(staged, tmp_path):
    lines = ["frame,rank,probability,joint,x_m,y_m,z_m"]
    lines += [
        f"{frame},{rank},{0.7 if rank == 1 else 0.2},neck,{frame},{rank},1.5"
        for frame in (1, 3)
        for rank in (2, 1)
    ]
    (tmp_path / "out" / "hypotheses.csv").write_text("\n".join(lines) + "\n")
    scenes = ResultScenes("out", voxel_size_m=0.05)
    hypotheses = scenes.scene(3).hypotheses
    assert scenes.has_hypotheses and [hypothesis.rank for hypothesis in hypotheses] == [1, 2]
    assert hypotheses[0].probability == 0.7
    assert np.nansum(hypotheses[1].joints_m) == 3 + 2 + 1.5 and scenes.scene(2).hypotheses == ()
    assert (None, "Pose 2: 20 %") in frame_lines(scenes.scene(3))
    (tmp_path / "out" / "hypotheses.csv").write_text(
        "frame,rank,probability,joint,x_m,y_m,z_m\n1,1,0.5,tail,0,0,0\n"
    )
    words = r"hypotheses\.csv line 2 is damaged \(there is no joint tail\)"
    with pytest.raises(InputError, match=words):
        read_hypotheses(tmp_path / "out" / "hypotheses.csv")


def test_every_joint_of_a_hypothesis_is_drawn():
    assert set(LANDMARK_BONES.ravel()) == set(range(15))


def test_colours_tell_good_from_bad():
    bad, half, good, unknown = overlap_colours(np.array([0.0, 0.5, 1.0, np.nan])).astype(int)
    assert bad[0] > good[0] + 100 and good[2] > bad[2] + 100
    assert unknown.std() == 0 and half[1] > max(bad[1], good[1])


def test_what_is_unknown_is_told_hatched_and_not_carved(staged, scenes):
    whole = scenes.scene(2)
    (staged / "walk" / "recording.toml").write_text(
        "[unknown]\ncam_1 = [[[-1, 120], [320, 120], [320, 240], [-1, 240]]]\n"
    )
    scene = ResultScenes("out", voxel_size_m=0.03).scene(2)
    changed, marked = scene.notes
    assert changed.endswith(": unknown places") and marked == "50 % of cam_1 is marked as unknown"
    hidden = scene.camera_frames[0]
    assert hidden.unknown is not None and not (hidden.mask & hidden.unknown).any()
    assert not scene.camera_frames[1].unknown.any()
    pictures = [camera_picture(one.camera_frames[0], "picture") for one in (whole, scene)]
    changed = (pictures[0] != pictures[1]).any(axis=2)
    assert changed[130:].mean() > 0.9 and not changed[:110].any()
    assert whole.hull is not None and scene.hull is not None
    assert 0.99 < scene.hull.occupancy.sum() / whole.hull.occupancy.sum() < 1.6


def test_scenes_pictures_and_film_of_a_body_that_is_no_persons(desk):
    _, motion = write_example_result(desk, "quadruped", pictures=False)
    scenes = ResultScenes("quadruped_fit", voxel_size_m=0.04)
    scene, model = scenes.scene(2), motion.model
    assert scene.bodies[0].part_names == model.names
    assert len(scene.bodies[0].bones) == len(model.tree.landmark_bones)
    scenes.close()
    for words in (["--png", "a.png"], ["--video", "a.webm"]):
        assert run(["view", "quadruped_fit", "--voxel", "0.05", *words]) == 0
    assert (desk / "a.png").stat().st_size > 1000 and (desk / "a.webm").stat().st_size > 1000


def test_a_body_without_bones_is_shown(desk):
    """Of a rigid object there is a surface, and no line."""
    tree = KinematicTree.from_parts((("case", "", ()),))
    model = body_of_parts(tree, np.zeros((1, 3)), [[Box((-0.3, -0.2, -0.2), (0.3, 0.2, 0.2))]])
    still, root = np.tile([1.0, 0, 0, 0], (2, 1)), np.array([[0, 0, 0.9], [0.1, 0, 0.9]])
    motion = Motion(15.0, model, root, still, np.zeros((2, 0)))
    write_staged(desk / "case", motion, ring(3, (320, 240)))
    estimate = Estimate(motion, {"search": np.full(2, 0.01)}, {})
    write_estimate(Recording.open(desk / "case"), Output(desk / "out"), estimate, Settings())
    for words in (["--png", "a.png"], ["--video", "a.webm"]):
        assert run(["view", "out", "--voxel", "0.05", *words]) == 0
    assert run(["report", "out"]) == 0
    assert run(["export", "out", "--to", "html"]) == 0
    assert (desk / "out" / "motion.html").stat().st_size > 50_000
    browser = Browser(ResultScenes("out", voxel_size_m=0.05), Address(port=8393), 0)
    browser.close()
