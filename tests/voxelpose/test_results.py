"""A result folder is whole or not there."""

import errno
import json

import numpy as np
import pytest

from calib.errors import InputError
from voxelpose.results import SUMMARY, ResultWriter, as_json, is_result


def write(out, text="1", **options):
    with ResultWriter(out, **options) as folder:
        (folder / SUMMARY).write_text(json.dumps({"voxelpose": text}))


def text_of(out):
    return json.loads((out / SUMMARY).read_text())["voxelpose"]


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_appears_at_the_end_under_its_name(tmp_path):
    with ResultWriter(tmp_path / "a" / "out") as folder:
        (folder / SUMMARY).write_text('{"voxelpose": "1"}')
        assert names(tmp_path / "a") == [".out.lock", folder.name]
    assert names(tmp_path / "a") == ["out"]
    assert is_result(tmp_path / "a" / "out")


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, InputError, SystemExit])
def test_nothing_is_left_when_it_ends_early(tmp_path, error):
    with pytest.raises(error), ResultWriter(tmp_path / "a" / "b" / "out") as folder:
        (folder / "joints.csv").write_text("half")
        raise error("stop")
    assert names(tmp_path) == []


def test_full_disk_is_one_line_and_other_system_errors_stay_what_they_are(tmp_path):
    with pytest.raises(InputError, match="disk is full"), ResultWriter(tmp_path / "out") as folder:
        (folder / "joints.csv").write_text("half")
        raise OSError(errno.ENOSPC, "No space left on device")
    with pytest.raises(PermissionError), ResultWriter(tmp_path / "out"):
        raise PermissionError(errno.EACCES, "no")
    assert names(tmp_path) == []


def test_an_empty_folder_may_be_filled_and_a_result_is_kept_unless_told(tmp_path):
    """It survives a failed replacement, too."""
    (tmp_path / "out").mkdir()
    write(tmp_path / "out")
    with pytest.raises(InputError, match=r"out exists.*--overwrite"):
        ResultWriter(tmp_path / "out")
    with pytest.raises(KeyboardInterrupt), ResultWriter(tmp_path / "out", overwrite=True):
        raise KeyboardInterrupt
    assert text_of(tmp_path / "out") == "1" and names(tmp_path) == ["out"]
    write(tmp_path / "out", "2", overwrite=True)
    assert text_of(tmp_path / "out") == "2" and names(tmp_path) == ["out"]


def test_what_is_not_ours_is_never_replaced(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "thesis.tex").write_text("years of work")
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "out")
    for name in ("out", "file", "link"):
        with pytest.raises(InputError, match="another name"):
            ResultWriter(tmp_path / name, overwrite=True)
    assert (tmp_path / "out" / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize("inside", ["", "out", "a/b"])
def test_the_recording_itself_is_kept_clean(tmp_path, inside):
    with pytest.raises(InputError, match="lies in the recording"):
        ResultWriter(tmp_path / "walk" / inside, overwrite=True, keep_out_of=tmp_path / "walk")


def test_a_place_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match="file/out cannot be written"):
        ResultWriter(tmp_path / "file" / "out").__enter__()


def test_json_holds_what_json_can():
    b, c = (np.int64(3), np.bool_(True)), {"d": float("inf")}
    text = as_json({"a": np.array([1.5, np.nan]), "b": b, "c": c})
    assert json.loads(text) == {"a": [1.5, None], "b": [3, True], "c": {"d": None}}
