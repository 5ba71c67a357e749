"""Many recordings: done side by side, resumed, and none stopping the others."""

import csv
import json
import os
import shutil
import signal
import threading
import time
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from silhouette_core.body.joints import LANDMARK_NAMES
from tests.other_bodies import TURNED_DEG, write_example_result
from tests.sources import ring, write_recording
from voxelpose.batch.batch_tables import write_tables
from voxelpose.batch.jobs import jobs_of
from voxelpose.batch.run import BatchSettings, Outcome, run_batch
from voxelpose.cli import run
from voxelpose.evaluation import evaluate
from voxelpose.recording.truth import TRUE_MOTION
from voxelpose.results import Result

STANDING = {"estimator": "standing"}
SAME = ("joints.csv", "motion.bvh", "motion.safetensors", "settings.toml")


@pytest.fixture
def studio(desk: Path) -> Path:
    """Three recordings, of which one lacks a camera's video."""
    for name in ("one", "two", "three"):
        write_recording(desk / "in" / name, ring(2))
    (desk / "in" / "two" / "cam_2.mp4").unlink()
    return desk


def statuses(outcomes):
    return {outcome.job.name: outcome.status for outcome in outcomes}


def test_one_that_fails_does_not_stop_the_others_and_a_second_run_does_the_rest(studio):
    jobs = jobs_of([studio / "in"], "fit", STANDING)
    settings = BatchSettings(studio / "out", 2, pictures=False, report=False)
    told = []
    outcomes = run_batch(jobs, settings, lambda outcome, n: told.append((outcome.job.name, n)))
    assert statuses(outcomes) == {"one": "done", "three": "done", "two": "failed"}
    failed = next(outcome for outcome in outcomes if outcome.status == "failed")
    assert "camera cam_2 of" in failed.message and "has no video" in failed.message
    assert sorted(n for _, n in told) == [1, 2, 3]
    assert not (studio / "out" / "two").exists()
    before = (studio / "out" / "one" / "summary.json").stat().st_mtime_ns
    # A recording that is put right, and one whose settings are others now.
    other = studio / "in" / "two"
    (other / "cam_2.mp4").write_bytes((other / "cam_1.mp4").read_bytes())
    jobs = [
        *jobs_of([studio / "in" / "one", other], "fit", STANDING),
        *jobs_of([studio / "in" / "three"], "fit", {**STANDING, "stature": 1.6}),
    ]
    again = run_batch(jobs, replace(settings, processes=1), lambda outcome, n: None)
    assert statuses(again) == {"one": "kept", "two": "done", "three": "done"}
    assert (studio / "out" / "one" / "summary.json").stat().st_mtime_ns == before
    assert again[2].summary["body"]["stature_m"] == 1.6


def test_tables_begin_with_what_is_wrong(studio):
    out = studio / "out"
    shutil.rmtree(studio / "in" / "three")
    words = ["in", "--out", str(out), "--set", "estimator=standing", "--jobs", "1"]
    assert run(["batch", *words]) == 1
    with (out / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert rows[0]["recording"] == "two" and rows[0]["verdict"] == "failed"
    assert [row["recording"] for row in rows[1:]] == ["one"]
    assert (out / "table.md").read_text().splitlines()[2].startswith("| two | failed |")
    page = (out / "index.html").read_text()
    assert page.index(">two<") < page.index(">one<")
    assert 'href="one/report.html"' in page and page.count("data:image/webp") == 1
    assert (out / "one" / "report.html").is_file()


def test_tables_hold_what_there_is_of_a_body_that_is_no_persons(desk):
    """It has no stature and its joints have no sides; its joint angles are scored."""
    write_example_result(desk / "out", "robot_arm", 3)
    (job,) = jobs_of([desk / "out" / "robot_arm"], "fit", {})
    (desk / "out" / "robot_arm_fit").rename(desk / "out" / "fit")
    (desk / "out" / "robot_arm").rename(desk / "out" / "film")
    (desk / "out" / "fit").rename(desk / "out" / "robot_arm")
    score = asdict(evaluate(desk / "out" / "robot_arm", desk / "out" / "film" / TRUE_MOTION))
    summary = Result.open(desk / "out" / "robot_arm").summary
    write_tables([Outcome(job, "done", summary=summary, score=score)], desk / "out")
    with (desk / "out" / "table.csv").open(newline="") as file:
        (row,) = csv.DictReader(file)
    assert float(row["joint_angle_deg"]) == pytest.approx(TURNED_DEG / 6, rel=0.01)
    assert "flips" not in row and "stature_m" not in row and "nan" not in str(row)
    page = (desk / "out" / "index.html").read_text()
    assert "joint_angle_deg 0.5" in page and "stature" not in page


def test_several_people_have_a_row_each_and_are_kept(desk):
    for name in ("dance", "walk"):
        write_recording(desk / "in" / name, ring(2))
    truth = [{name: [[0, 0, 1]] * 6 for name in LANDMARK_NAMES}] * 2
    people = [{"stature": 1.7, "joints": joints} for joints in truth]
    (desk / "in" / "dance" / "truth.json").write_text(json.dumps({"unit": "m", "people": people}))
    words = ["in", "--out", "out", "--set", "estimator=standing", "--set", "people=2"]
    assert run(["batch", *words, "--jobs", "1", "--no-pictures", "--no-report"]) == 0
    with (desk / "out" / "table.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    names = [f"{name}/person_{k}" for name in ("dance", "walk") for k in (1, 2)]
    assert [row["recording"] for row in rows] == names
    assert [row["frames"] for row in rows[:2]] == ["6 of 6", "4 of 6"]
    assert all(float(row["root_mm"]) > 100 for row in rows[:2]) and not rows[2]["root_mm"]
    page = (desk / "out" / "index.html").read_text()
    assert page.count("<section") == 2 and page.count("<b>dance/person_2</b>") == 1
    before = (desk / "out" / "dance" / "summary.json").stat().st_mtime_ns
    jobs = jobs_of([desk / "in"], "fit", {**STANDING, "people": 2})
    settings = BatchSettings(Path("out"), 1, pictures=False, report=False)
    dance, walk = run_batch(jobs, settings, lambda outcome, n: None)
    assert statuses([dance, walk]) == {"dance": "kept", "walk": "kept"}
    assert (desk / "out" / "dance" / "summary.json").stat().st_mtime_ns == before
    assert dance.seconds > 0 and dance.verdict.level == "doubtful"
    assert dance.verdict.reason.startswith("person_1: ")


def test_pieces_follow_one_person(desk):
    write_recording(desk / "in" / "dance", ring(2), 60)
    (job,) = jobs_of([desk / "in"], "fit", {**STANDING, "people": 2})
    settings = BatchSettings(desk / "out", 1, pictures=False, report=False, piece_s=1.0)
    (outcome,) = run_batch([job], settings, lambda outcome, n: None)
    assert outcome.status == "failed"
    assert "2 people are seen, and pieces follow one: set people = 1" in outcome.message
    assert not (desk / "out" / "dance").exists()


def test_an_interrupt_says_how_to_go_on(studio, capsys, monkeypatch):
    def interrupted(jobs, settings, told):
        raise KeyboardInterrupt

    monkeypatch.setattr("voxelpose.batch.run.run_batch", interrupted)
    assert run(["batch", "in", "--out", "out", "--set", "estimator=standing"]) == 130
    assert "interrupted after 0 of 3; results are kept" in capsys.readouterr().err


def test_names_from_files_are_no_markup(studio):
    hostile = write_recording(studio / "in" / "<script>alert(1)<", ring(2))
    jobs = jobs_of([hostile], "fit", {**STANDING, "frames": "0:99"})
    outcomes = run_batch(jobs, BatchSettings(studio / "out", 1), lambda outcome, n: None)
    assert outcomes[0].status == "failed"
    write_tables(outcomes, studio / "out")
    assert "<script" not in (studio / "out" / "index.html").read_text()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc").is_dir(), reason="processes are looked up in /proc")
def test_a_process_that_is_killed_costs_its_job_alone(studio):
    """The kill is found, the other job is done, and the one that was killed is tried again."""
    jobs = [
        *jobs_of([studio / "in" / "one"], "fit", {**STANDING, "voxel": 0.09}),
        *jobs_of([studio / "in" / "three"], "fit", STANDING),
    ]
    killed = []

    def kill() -> None:
        end = time.monotonic() + 60
        while not killed and time.monotonic() < end:
            for folder in Path("/proc").glob("[0-9]*"):
                try:
                    parent = int((folder / "stat").read_text().rsplit(")")[-1].split()[1])
                    words = (folder / "cmdline").read_bytes()
                except OSError:
                    continue
                if parent == os.getpid() and b"spawn_main" in words:
                    os.kill(int(folder.name), signal.SIGKILL)
                    killed.append(folder.name)
                    return
            time.sleep(0.01)

    thread = threading.Thread(target=kill)
    thread.start()
    settings = BatchSettings(studio / "out", 2, pictures=False, report=False)
    outcomes = run_batch(jobs, settings, lambda outcome, n: None)
    thread.join()
    assert killed
    assert statuses(outcomes) == {"one": "done", "three": "done"}


@pytest.mark.slow
def test_a_cluster_gives_the_same_bytes_though_a_machine_is_lost(studio):
    distributed = pytest.importorskip(
        "distributed", reason="Dask is not installed: pip install 'voxelpose[cluster]'"
    )
    write_recording(studio / "in" / "four", ring(2), 40)
    jobs = [job for job in jobs_of([studio / "in"], "fit", STANDING) if job.name != "two"]
    here = BatchSettings(studio / "here", 2, pictures=False, report=False)
    run_batch(jobs, here, lambda outcome, n: None)
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None
    ) as cluster:
        there = BatchSettings(studio / "there", 1, cluster.scheduler_address, False, False)
        pid = next(iter(cluster.workers.values())).pid

        def lose(outcome, n):
            if n == 1:
                os.kill(pid, signal.SIGKILL)

        outcomes = run_batch(jobs, there, lose)
    assert set(statuses(outcomes).values()) == {"done"}
    for job in jobs:
        for name in SAME:
            ours = (studio / "here" / job.name / name).read_bytes()
            assert (studio / "there" / job.name / name).read_bytes() == ours, name
        assert json.loads((studio / "there" / job.name / "job.json").read_text())


def test_a_recordings_own_settings_count_within_a_batch(studio):
    (studio / "voxelpose.toml").write_text(
        "[batch]\nreport = false\npictures = false\nout = 'out'\n"
        "[fit]\nestimator = 'standing'\nstature = 1.6\npictures = true\n"
    )
    own = studio / "in" / "three" / "voxelpose.toml"
    own.write_text("[fit]\nstature = 1.5\nfps = 12.5\n")
    words = ["batch", "in/one", "in/three", "--jobs", "1"]
    assert run(words) == 0
    one, three = (
        json.loads((studio / "out" / name / "summary.json").read_text())
        for name in ("one", "three")
    )
    assert (one["fps"], three["fps"]) == (25.0, 12.5)
    assert one["settings_from"]["stature"] == "../../voxelpose.toml"
    assert three["settings_from"]["stature"] == "../../in/three/voxelpose.toml"
    assert not (studio / "out" / "one" / "report.html").exists()
    made = (studio / "out" / "three" / "summary.json").stat().st_mtime_ns
    own.write_text("[fit]\nstature = 1.5\nfps = 12.5\nsmooth = true\n")
    assert run([*words, "--set", "stature=1.4"]) == 0
    settings = (studio / "out" / "three" / "settings.toml").read_text()
    assert "stature_m = 1.4" in settings
    assert (studio / "out" / "three" / "summary.json").stat().st_mtime_ns > made
