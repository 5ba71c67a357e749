"""Files and folders are written whole or not at all, and nothing of anybody else is lost."""

import errno
import os
import subprocess
import sys

import pytest

from calib.errors import InputError
from calib.files import RIG_FORMATS, WRITTEN, write_rig
from calib.storage import atomic
from calib.storage.atomic import (
    FolderWriter,
    claimed,
    remove_leftovers,
    replacing,
    write_whole,
    written_paths,
)
from tests.calib.rigs import PINHOLE, some_rig

GONE = "2147483000"  # no process has this number


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def filled(folder, text="earlier"):
    folder.mkdir()
    (folder / "file").write_text(text)
    return folder


def no_space(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


def test_a_file_takes_its_name_when_it_is_complete(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text("earlier")
    with replacing(path) as partial:
        partial.write_text("new")
        assert path.read_text() == "earlier"
        assert partial.suffix == ".toml"
    assert path.read_text() == "new"
    assert names(tmp_path) == ["rig.toml"]


def test_the_earlier_file_survives_a_disk_that_is_full_when_it_is_flushed(tmp_path, monkeypatch):
    path = tmp_path / "rig.toml"
    path.write_text("earlier")
    monkeypatch.setattr(atomic.os, "fsync", no_space)
    with pytest.raises(InputError, match=r"the disk is full: .*rig\.toml was not written"):
        write_whole(path, "new")
    assert path.read_text() == "earlier"
    assert names(tmp_path) == ["rig.toml"]


def test_of_two_files_neither_is_replaced_unless_both_are_complete(tmp_path):
    paths = [tmp_path / "a", tmp_path / "missing" / "b"]
    paths[0].write_text("earlier")
    with (
        pytest.raises(InputError, match="b cannot be written"),
        replacing(paths[0]) as first,
        replacing(paths[1]) as second,
    ):
        first.write_text("new")
        second.write_text("new")
    assert paths[0].read_text() == "earlier"
    assert names(tmp_path) == ["a"]


@pytest.mark.parametrize("style", WRITTEN)
def test_no_calibration_is_lost_to_a_full_disk(tmp_path, monkeypatch, style):
    path = tmp_path / f"rig{(RIG_FORMATS[style].suffixes or ('.json',))[0]}"
    write_rig(some_rig(PINHOLE), path, style)
    before = contents(path)
    monkeypatch.setattr(atomic.os, "fsync", no_space)
    with pytest.raises(InputError, match="disk is full"):
        write_rig(some_rig(PINHOLE), path, style)
    assert contents(path) == before
    assert names(tmp_path) == [path.name]


def contents(path):
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    return {file.name: file.read_bytes() for file in files}


def test_what_killed_processes_left_of_a_file_goes_with_the_next(tmp_path):
    mine = f".rig.partial-{os.getpid()}-0123abcd.toml"
    for name in (
        f".rig.partial-{GONE}-0123abcd.toml",
        mine,
        f".other.partial-{GONE}-0123abcd.toml",
    ):
        (tmp_path / name).touch()
    write_whole(tmp_path / "rig.toml", "new")
    assert names(tmp_path) == sorted([f".other.partial-{GONE}-0123abcd.toml", mine, "rig.toml"])


def test_completed_files_are_remembered(tmp_path):
    write_whole(tmp_path / "a", "1")
    with FolderWriter(tmp_path / "folder"):
        pass
    with pytest.raises(RuntimeError), replacing(tmp_path / "b") as partial:
        partial.write_text("half")
        raise RuntimeError
    here = [path for path in written_paths() if path.is_relative_to(tmp_path)]
    assert here == [tmp_path / "a", tmp_path / "folder"]


def test_two_processes_cannot_write_one_folder(tmp_path):
    out = tmp_path / "out"
    code = (
        "import sys\nfrom calib.storage.atomic import FolderWriter\n"
        "with FolderWriter(sys.argv[1]) as folder:\n"
        "    print('in', flush=True)\n    sys.stdin.read()\n    (folder / 'file').touch()\n"
    )
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with subprocess.Popen([sys.executable, "-c", code, str(out)], **pipes) as other:
        assert other.stdout.readline() == "in\n"
        with (
            pytest.raises(InputError, match=r"another process is writing .*out"),
            FolderWriter(out),
        ):
            pass
        other.communicate("")
    assert names(tmp_path) == ["out"]
    assert names(out) == ["file"]


def test_what_appeared_meanwhile_stays_and_the_result_goes_beside(tmp_path):
    out = tmp_path / "out"
    with (
        pytest.raises(InputError, match=r"written to .*out meanwhile .* this result is in .*out-2"),
        FolderWriter(out) as folder,
    ):
        (folder / "file").write_text("new")
        filled(out, "somebody's")
    assert (out / "file").read_text() == "somebody's"
    assert (tmp_path / "out-2" / "file").read_text() == "new"
    assert names(tmp_path) == ["out", "out-2"]


def test_what_is_not_of_the_kind_stays_although_overwriting_was_meant(tmp_path):
    out = filled(tmp_path / "out")
    (tmp_path / "out-2").mkdir()
    writer = FolderWriter(out, True, lambda folder: (folder / "file").read_text() != "thesis")
    with pytest.raises(InputError, match=r"this result is in .*out-3"), writer as folder:
        (folder / "file").write_text("new")
        (out / "file").write_text("thesis")
    assert (out / "file").read_text() == "thesis"
    assert (tmp_path / "out-3" / "file").read_text() == "new"


@pytest.mark.parametrize("exchange", [True, False])
def test_an_earlier_folder_is_replaced(tmp_path, monkeypatch, exchange):
    if not exchange:
        monkeypatch.setattr(atomic, "_exchanged", lambda *_: False)
    out = filled(tmp_path / "out")
    with FolderWriter(out, overwrite=True) as folder:
        (folder / "file").write_text("new")
        assert (out / "file").read_text() == "earlier"
    assert (out / "file").read_text() == "new"
    assert names(tmp_path) == ["out"]


def test_a_kill_between_two_renames_is_recovered(tmp_path):
    filled(tmp_path / f"out.old-{GONE}-0123abcd")
    filled(tmp_path / f"out.partial-{GONE}-0123abcd", "new")
    with pytest.raises(InputError, match="out exists"), FolderWriter(tmp_path / "out"):
        pass
    assert names(tmp_path) == ["out"]
    assert (tmp_path / "out" / "file").read_text() == "earlier"


def test_leftovers_of_killed_processes_are_removed_and_nothing_else(tmp_path):
    filled(tmp_path / f"walk.partial-{GONE}-0123abcd")
    (tmp_path / ".walk.lock").touch()
    (tmp_path / f".rig.partial-{GONE}-0123abcd.toml").touch()
    filled(tmp_path / "walk.partial-of-mine")
    (tmp_path / ".thesis.lock").touch()
    with claimed(tmp_path / "busy"):
        filled(tmp_path / f"busy.partial-{GONE}-0123abcd")
        removed = remove_leftovers(tmp_path)
    assert sorted(path.name for path in removed) == [
        f".rig.partial-{GONE}-0123abcd.toml",
        f"walk.partial-{GONE}-0123abcd",
    ]
    assert names(tmp_path) == [
        ".thesis.lock",
        f"busy.partial-{GONE}-0123abcd",
        "walk.partial-of-mine",
    ]


@pytest.mark.skipif(os.name == "nt", reason="Windows locks otherwise")
@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_a_file_system_without_locks_keeps_others_away_all_the_same(tmp_path, monkeypatch, number):
    def none(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("fcntl.flock", none)
    with claimed(tmp_path / "walk"):
        with (
            pytest.raises(InputError, match=r"another process is writing .*walk"),
            claimed(tmp_path / "walk"),
        ):
            pass
        with claimed(tmp_path / "other"):
            pass
    with claimed(tmp_path / "walk"):
        pass
    assert names(tmp_path) == []


def test_a_name_that_is_too_long_is_one_line(tmp_path):
    with (
        pytest.raises(InputError, match=r"cannot be written: .*[Nn]ame too long"),
        FolderWriter(tmp_path / ("a" * 300)),
    ):
        pass
