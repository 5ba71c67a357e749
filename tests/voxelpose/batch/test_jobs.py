"""What is to be done: recordings named on the command line or in a list."""

from pathlib import Path

import pytest

from calib.errors import InputError
from silhouette_core.motion.conditioning import Conditioning
from tests.sources import ring, write_recording
from voxelpose.batch.jobs import jobs_of, read_settings


@pytest.fixture
def studio(tmp_path: Path) -> Path:
    for name in ("anna/walk", "ben/walk", "ben/run fast"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        write_recording(tmp_path / name, ring(2), 2)
    return tmp_path


def names(jobs):
    return [job.name for job in jobs]


def test_folders_of_recordings_are_opened_and_names_kept_apart(studio):
    jobs = jobs_of([studio / "anna" / "walk", studio / "ben"], "fit", {"stature": 1.7})
    assert names(jobs) == ["walk", "run_fast", "walk_2"]
    assert {Path(job.recording).name for job in jobs} == {"walk", "run fast"}
    assert all(job.estimation().settings().stature_m == 1.7 for job in jobs)
    assert jobs[0].open().rig.names == ("cam_1", "cam_2")


def test_a_list_has_settings_for_all_and_for_each(studio):
    (studio / "all.toml").write_text(
        '[settings]\nstature = 1.8\nfps = 50\n[[recording]]\nfolder = "anna/walk"\n'
        'stature = 1.62\nup = "-z"\n[[recording]]\nname = "one"\nfolder = "ben/walk"\n'
        'command = "track"\ncamera = "cam_2"\nstart = "any"\nframes = "0:1"\n'
    )
    first, second = jobs_of([studio / "all.toml"], "fit", {"sex": "female", "stature": 1.5})
    settings = first.estimation().settings()
    assert (settings.stature_m, settings.sex, settings.up) == (1.62, "female", (0, 0, -1))
    assert first.estimation().chosen_estimator == "multiview" and first.open().fps == 50
    assert second.name == "one" and second.estimation().chosen_estimator == "monocular"
    assert second.estimation().settings().options == {"start": "any"}
    opened = second.open()
    assert opened.rig.names == ("cam_2",) and opened.frame_count == 1


def test_filter_and_gaps_are_settings_of_a_job(studio):
    words = ["filter=savgol", "cutoff=5", "filter_order=2", "gap_limit=12", "gap_method=pchip"]
    (job,) = jobs_of([studio / "anna" / "walk"], "fit", read_settings(words))
    wanted = Conditioning("savgol", 5, 2, 12, "pchip")
    assert job.estimation().settings().conditioning == wanted
    (job,) = jobs_of([studio / "anna" / "walk"], "track", read_settings(["gap_limit=0.2s"]))
    assert job.estimation().settings().conditioning == Conditioning(gap_limit="0.2s")


def test_either_command_runs_any_estimator(studio):
    words = read_settings(["estimator=tree"])
    jobs = [jobs_of([studio / "anna" / "walk"], one, words)[0] for one in ("fit", "track")]
    assert [job.estimation().chosen_estimator for job in jobs] == ["tree", "tree"]


def test_settings_are_read_as_in_toml_or_as_text():
    words = ["stature=1.75", "smooth=false", "frames=0:100", 'sex="male"', "tolerance = 1"]
    typed = {"stature": 1.75, "smooth": False, "frames": "0:100", "sex": "male", "tolerance": 1}
    assert read_settings(words) == typed
    with pytest.raises(InputError, match="--set stature is not understood"):
        read_settings(["stature"])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("recording = 3", r"lists no recordings: write a table \[\[recording\]\]"),
        ("[[recording]]\nstature = 1.7", "recording 1 has no folder"),
        ('[[recording]]\nfolder = "nobody"', "recording 1: .*nobody is no recording"),
        ('[[recording]]\nfolder = "anna/walk"\nsize = 2', "fit has no setting 'size'.*stature"),
        ('[[recording]]\nfolder = "anna/walk"\nstature = "tall"', "stature = 'tall' must be a num"),
        ('[[recording]]\nfolder = "anna/walk"\ntolerance = true', "must be a whole number"),
        ('[[recording]]\nfolder = "anna/walk"\nframes = "all"', 'frames = "all" is not underst'),
        ('[[recording]]\nfolder = "anna/walk"\nup = "sky"', 'up = "sky" is no direction'),
        ('[[recording]]\nfolder = "anna/walk"\ncommand = "guess"', 'command "fit" or "track"'),
        ("[[recording", "no valid TOML"),
    ],
)
def test_a_list_that_makes_no_sense_is_refused_before_any_work(studio, content, words):
    (studio / "all.toml").write_text(content)
    with pytest.raises(InputError, match=words):
        jobs_of([studio / "all.toml"], "fit", {})


def test_what_is_not_there_is_named(studio):
    (studio / "empty").mkdir()
    with pytest.raises(InputError, match=r"there is no recording .*nobody"):
        jobs_of([studio / "nobody"], "fit", {})
    with pytest.raises(InputError, match="empty is no recording and holds none"):
        jobs_of([studio / "empty"], "fit", {})


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ('frames = "0:x"', 'recording 1: frames = "0:x" is not understood'),
        ('up = "w"', "recording 1: "),
        ('filter = "kalman"', "recording 1: fit: filter = 'kalman' must be one of auto"),
        ("gap_limit = 1.5", "gap-limit = '1.5' must be a whole number, or text"),
        ("people = 0", 'recording 1: people = "0" is no number of people'),
        ("people = 1.5", "people = '1.5' must be a whole number, or text"),
        ('gap_limit = "long"', "recording 1: gap limit 'long' is not understood"),
        ("stature = []", "recording 1: fit: stature = '[]' must be a number"),
        ("x = 1", "recording 1: fit has no setting 'x'"),
        ("x = " + "[" * 3000 + "]" * 3000, "nested more than"),
        ("stature = " + "9" * 5000, "no valid TOML"),
    ],
)
def test_a_wrong_setting_names_the_list(studio, entries, words):
    path = studio / "list.toml"
    path.write_text(f'[[recording]]\nfolder = "anna/walk"\n{entries}\n')
    with pytest.raises(InputError) as caught:
        jobs_of([path], "fit", {})
    assert words in str(caught.value) and "list.toml" in str(caught.value)
    path.write_text(f'[[recording]]\nfolder = "{"x" * 300}"\n')
    with pytest.raises(InputError, match="folder is no folder's name"):
        jobs_of([path], "fit", {})


def test_other_settings_count_where_a_job_has_none(studio):
    (job,) = jobs_of([studio / "anna" / "walk"], "fit", {"stature": 1.7})
    file = studio / "voxelpose.toml"
    file.write_text('[fit]\nstature = 1.5\nfps = 50.0\nbackend = "reference"\nthreads = 3\n')
    full = job.with_folder_settings()
    assert full.settings == {"stature": 1.7, "fps": 50.0, "backend": "reference"}
    assert full.sources == dict.fromkeys(("fps", "backend"), str(file))
    assert full.estimation().settings().backend == "reference"
    file.write_text('[fit]\nframes = "all"\n')
    with pytest.raises(InputError, match=r'voxelpose.toml: frames = "all" is not understood'):
        job.with_folder_settings()
