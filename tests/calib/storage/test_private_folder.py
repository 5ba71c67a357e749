"""The private folder of temporary files is nobody else's."""

import os
import stat
import tempfile

import pytest

from calib.errors import InputError
from calib.storage.temporary import private_folder

pytestmark = pytest.mark.skipif(os.name == "nt", reason="Windows has a folder for each user")


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_it_is_the_same_again_and_closed_to_others(temporary):
    folder = private_folder()
    assert folder == private_folder() == temporary / f"voxelpose-{os.getuid()}"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


@pytest.mark.parametrize("taken", ["open", "link", "file", "another's"])
def test_a_name_that_is_not_ours_is_not_used(temporary, taken, monkeypatch):
    place = temporary / f"voxelpose-{os.getuid()}"
    if taken == "open":
        place.mkdir()
        place.chmod(0o770)
    elif taken == "link":
        (temporary / "elsewhere").mkdir(mode=0o700)
        place.symlink_to(temporary / "elsewhere")
    elif taken == "file":
        place.touch()
    else:
        place.mkdir(mode=0o700)
        monkeypatch.setattr(os, "getuid", lambda: int(place.name.partition("-")[2]) + 1)
        place.rename(temporary / f"voxelpose-{os.getuid()}")
    folder = private_folder()
    assert folder.parent == temporary
    assert folder.name != f"voxelpose-{os.getuid()}"
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700


def test_no_temporary_files_is_one_line(temporary, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(temporary / "missing"))
    with pytest.raises(InputError, match=r"the folder of temporary files .*TMPDIR"):
        private_folder()
