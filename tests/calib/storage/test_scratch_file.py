"""Scratch files hold what was written, leave nothing behind and say when the disk is full."""

import errno
import tempfile

import pytest

from calib.errors import InputError
from calib.storage.temporary import ScratchFile


def test_what_was_written_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    file = ScratchFile()
    assert [file.append(b"abc"), file.append(b"defg")] == [0, 3]
    assert file.read_at(2, 5) == b"cdefg"
    assert file.read_at(6, 10) == b"g"
    file.close()


def test_no_file_has_a_name_that_a_kill_would_leave(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    file = ScratchFile()
    file.append(b"abc")
    assert list(tmp_path.iterdir()) == []
    file.close()


def test_a_full_disk_is_one_line_that_names_the_folder(tmp_path, monkeypatch):
    class Full:
        def seek(self, start): ...

        def write(self, content):
            raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda **options: Full())
    with pytest.raises(InputError, match=f"{tmp_path} is full; .* set TMPDIR"):
        ScratchFile().append(b"abc")


def test_no_folder_of_temporary_files_is_one_line(monkeypatch):
    def none(**options):
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found")

    monkeypatch.setattr(tempfile, "TemporaryFile", none)
    with pytest.raises(InputError, match=r"folder of temporary files .* cannot be used"):
        ScratchFile()
