"""Long recordings in pieces."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from silhouette_core.motion.conditioning import Conditioning, conditioned
from tests.clips import waving
from tests.sources import ring, write_recording, write_staged
from voxelpose.batch.jobs import jobs_of
from voxelpose.batch.run import BatchSettings, joined, pieces_of, run_batch
from voxelpose.evaluation import score_motion
from voxelpose.results import Result

FPS = 25.0


@pytest.fixture(scope="module")
def motion():
    whole = waving(40, 1.7, FPS)
    return replace(whole, quality={"outside": np.arange(40.0)})


def test_pieces_of_one_motion_are_that_motion(motion):
    pieces = [motion.select(np.arange(*span)) for span in ((0, 18), (10, 30), (24, 40))]
    whole, seams_mm = joined(pieces)
    assert seams_mm == pytest.approx([0, 0], abs=1e-9)
    np.testing.assert_array_equal(whole.frames, motion.frames)
    for name in ("root_m", "root_quaternion", "angles_rad", "time_s"):
        np.testing.assert_allclose(getattr(whole, name), getattr(motion, name), atol=1e-12)
    np.testing.assert_array_equal(whole.quality["outside"], motion.quality["outside"])


def test_pieces_keep_what_was_filled_and_what_was_before(motion):
    """Frames 12 and 13 are filled in one piece only, 28 and 29 in both."""
    whole = motion.select(np.r_[0:28, 30:40])
    given = [
        whole.select(np.r_[0:12, 14:24]),
        whole.select(np.r_[10:28, 28:38]),
        whole.select(np.arange(22, 38)),
    ]
    conditioning = Conditioning("none", gap_limit=2)
    pieces = [conditioned(piece, conditioning) for piece in given]
    found, _ = joined(pieces)
    assert found.conditioning == conditioning
    np.testing.assert_array_equal(found.frames, motion.frames)
    np.testing.assert_array_equal(found.frames[found.filled], [28, 29])
    np.testing.assert_array_equal(found.unfiltered.frames, whole.frames)
    np.testing.assert_allclose(found.unfiltered.root_m, whole.root_m, atol=1e-12)


def test_pieces_that_differ_pass_into_each_other(motion):
    first, second = motion.select(np.arange(0, 25)), motion.select(np.arange(15, 40))
    second = replace(second, root_m=second.root_m + np.array([0.1, 0, 0]))
    whole, seams_mm = joined([first, second])
    assert seams_mm == pytest.approx([100])
    moved = whole.root_m[:, 0] - motion.root_m[:, 0]
    np.testing.assert_allclose(moved[:15], 0, atol=1e-12)
    np.testing.assert_allclose(moved[25:], 0.1)
    np.testing.assert_allclose(np.diff(moved[14:26]), 0.1 / 11)


def test_pieces_turn_the_short_way(motion):
    half = np.cos(np.radians(85)), 0.0, 0.0, np.sin(np.radians(85))  # 170 degrees about z
    first, second = (motion.select(np.arange(*span)) for span in ((0, 21), (10, 40)))
    first = replace(first, root_quaternion=np.tile(half, (len(first), 1)))
    second = replace(second, root_quaternion=np.tile([-1, 1, 1, 1] * np.array(half), (30, 1)))
    turned = joined([first, second])[0].root_quaternion
    assert abs(turned[15, 3]) > 0.999  # through 180 degrees


def test_where_pieces_share_no_frame_nothing_is_said_of_the_seam(motion):
    whole, seams_mm = joined([motion.select(np.arange(0, 10)), motion.select(np.arange(12, 40))])
    assert np.isnan(seams_mm).all() and len(whole) == 38


def test_only_long_recordings_are_divided(tmp_path):
    for name, frames in (("long", 100), ("short", 30)):
        write_recording(tmp_path / name, ring(2), frames)
    long, short = jobs_of([tmp_path / "long", tmp_path / "short"], "fit", {"frames": "10:100"})
    pieces = pieces_of(long, 1.0, tmp_path / "out")
    assert [piece.settings["frames"] for piece in pieces] == ["10:44", "20:67", "43:90", "66:100"]
    assert "body" not in pieces[0].settings
    assert all(str(piece.settings["body"]).endswith("long.000") for piece in pieces[1:])
    assert pieces_of(replace(short, settings={}), 1.0, tmp_path / "out") == []


@pytest.mark.slow
def test_a_recording_in_pieces_is_one_result_with_one_body(tmp_path):
    actor = waving(10, 1.72, 6.25)
    write_staged(tmp_path / "in" / "walk", actor, ring(4, (200, 160)))
    jobs = jobs_of([tmp_path / "in"], "fit", {"stature": 1.72, "sex": "male"})
    settings = BatchSettings(tmp_path / "out", 2, pictures=False, report=False, piece_s=0.8)
    told = []
    (outcome,) = run_batch(jobs, settings, lambda o, n: told.append((o.job.name, n)))
    assert outcome.status == "done" and told[-1] == ("walk", 1)
    assert {name for name, n in told if n is None} == {"walk.000", "walk.001"}
    result = Result.open(tmp_path / "out" / "walk")
    assert result.motion.frames.tolist() == list(range(10))
    assert max(result.summary["facts"]["seams_mm"]) < 15
    score = score_motion(actor.landmarks(), result.motion.landmarks())
    assert score.root_mm < 40
    assert not (tmp_path / "out" / "pieces").exists()
    assert "frames" not in json.loads((Path(result.folder) / "job.json").read_text())["settings"]
