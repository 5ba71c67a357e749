"""Distances from a scan, of surfaces whose distance is known."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from calib.errors import InputError
from silhouette_core.motion import kinematics
from tests.clips import waving
from tests.sources import ring, write_staged
from voxelpose.cli import run
from voxelpose.results import Result
from voxelpose.scan_distance import evaluate_scan, read_scan
from voxelpose.view.open3d_import import import_open3d


@pytest.fixture
def scanned(desk):
    """The result "out" of a posed body's recording "walk", and frame 2's body as a mesh."""
    try:
        import_open3d()
    except InputError as error:
        pytest.skip(str(error))
    write_staged(desk / "walk", waving(3), ring(3))
    assert run("fit walk --out out --estimator standing --no-pictures".split()) == 0
    motion = Result.open("out").motion
    rotation, origin = motion.parts()
    assert motion.frames[-1] == 2  # and the last row
    body = kinematics.skin(motion.model, rotation[-1], origin[-1])
    return trimesh.Trimesh(body, motion.model.faces, process=False)


def test_a_body_is_at_no_distance_from_itself(scanned, capsys):
    scanned.export("body.ply")
    capsys.readouterr()
    assert run("evaluate out --scan body.ply --frame 2 --json".split()) == 0
    score = json.loads(capsys.readouterr().out)["scan"]
    assert score["frame"] == 2 and score["notes"] == []
    for way in ("body_to_scan", "scan_to_body"):
        assert score[way]["worst_mm"] < 0.01
    # The hull contains the body, but for parts of voxels at its rim.
    assert score["hull_to_scan"]["mean_mm"] > 4 > -4 > score["scan_to_hull"]["mean_mm"]
    assert score["hull_to_scan"]["worst_mm"] > score["hull_to_scan"]["p95_mm"] > 15


def test_a_body_of_another_size_is_outside(scanned):
    """Each vertex moved by 5 mm along its normal: the body lies inside by just less."""
    grown = scanned.copy()
    grown.vertices = scanned.vertices + 0.005 * scanned.vertex_normals
    grown.export("grown.ply")
    Path("walk").rename("moved")
    score = evaluate_scan("out", "grown.ply", 2)
    assert score.hull_to_scan is None and "say where with --recording" in score.notes[0]
    assert score.body_to_scan.mean_mm == pytest.approx(-4.9, abs=0.3)
    assert score.scan_to_body.mean_mm == pytest.approx(4.9, abs=0.3)
    assert evaluate_scan("out", "grown.ply", 2, recording=Path("moved")).hull_to_scan is not None
    assert score.body_to_scan.rms_mm == pytest.approx(4.9, abs=0.3)


def test_a_scan_of_any_upright_frame_is_moved_onto_the_body(scanned, capsys):
    turned = scanned.copy()
    turned.apply_transform(trimesh.transformations.rotation_matrix(2.0, [0, 0, 1]))
    turned.apply_transform(trimesh.transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    turned.apply_translation([30, -4, 2])
    turned.apply_scale(1000)
    turned.export("scanner.stl")
    assert run("evaluate out --scan scanner.stl --frame 2 --unit mm".split()) == 2
    assert "m beside the body" in capsys.readouterr().err
    assert run("evaluate out --scan scanner.stl --frame 2 --unit mm --align".split()) == 0
    said = capsys.readouterr().out
    assert "scan was moved by 30" in said
    (row,) = (line.split() for line in said.splitlines() if line.startswith("scan to body"))
    assert float(row[-1]) < 1  # the worst


def test_a_scan_that_cannot_be_compared_is_refused_in_one_line(scanned, capsys):
    holed = scanned.copy()
    holed.update_faces(np.arange(len(holed.faces)) > 0)
    holed.export("holed.ply")
    trimesh.PointCloud(scanned.vertices).export("points.ply")
    trimesh.util.concatenate([scanned, scanned.copy().apply_translation([3, 0, 0])]).export(
        "two.ply"
    )
    scanned.export("body.ply")
    scanned.copy().apply_scale(1000).export("large.ply")
    scanned.copy().apply_scale(10).export("giant.ply")
    scanned.export("body.off")
    for words, refusal in {
        "--scan holed.ply": "holed.ply is not closed: 3 of its edges bound a hole",
        "--scan points.ply": "points.ply has no surface",
        "--scan two.ply": "two.ply is in 2 pieces",
        "--scan large.ply": "is it in mm? Then say --unit mm",
        "--scan giant.ply": "whose is it?",
        "--scan body.ply --unit cm": "is it in m? Then say --unit m",
        "--scan body.off": "is none of .stl",
        "--scan none.ply": "none.ply cannot be read: No such file",
        "--scan body.ply --frame 7": "frame 7 of out has no pose",
        "--frame 2": "name it with --scan",
    }.items():
        assert run(["evaluate", "out", *words.split()]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert refusal in line
    assert run(["evaluate", "out", "out", "--scan", "body.ply"]) == 2
    assert "--scan compares one result, not 2" in capsys.readouterr().err


def test_seams_and_units_of_a_file_do_not_count(tmp_path):
    """STL keeps three corners of each triangle."""
    ball = trimesh.creation.icosphere(3, radius=850)
    ball.export(tmp_path / "ball.stl")
    vertices, faces = read_scan(tmp_path / "ball.stl", "mm", 1.7)
    assert len(vertices) == len(ball.vertices) and len(faces) == len(ball.faces)
    np.testing.assert_allclose(np.linalg.norm(vertices, axis=1), 0.85, atol=1e-6)
