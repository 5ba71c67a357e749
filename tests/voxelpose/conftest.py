"""Fixtures of the application's tests."""

import shutil
from pathlib import Path

import pytest

from tests.clips import waving, waving_couple
from tests.sources import open_desk, ring, write_recording, write_staged
from voxelpose.cli import run


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder, beside which the estimator "standing" is installed (in site/)."""
    return open_desk(tmp_path, monkeypatch)


@pytest.fixture(scope="session")
def fitted_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What tests are given copies of as `fitted`."""
    with pytest.MonkeyPatch.context() as patch:
        desk = open_desk(tmp_path_factory.mktemp("fitted"), patch)
        write_recording(desk / "walk", ring(2))
        words = "fit walk --out fitted --estimator standing --stature 1.8 --no-pictures"
        assert run(words.split()) == 0
    return desk


@pytest.fixture
def fitted(desk: Path, fitted_once: Path) -> Path:
    """The result of a fit of `walk`, a recording by two cameras without a truth."""
    for name in ("walk", "fitted"):
        shutil.copytree(fitted_once / name, desk / name)
    return desk / "fitted"


@pytest.fixture(scope="session")
def staged_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What tests are given copies of as `staged`; not to be changed."""
    with pytest.MonkeyPatch.context() as patch:
        desk = open_desk(tmp_path_factory.mktemp("staged"), patch)
        write_staged(desk / "walk", waving(4), ring(4, (320, 240)))
        assert run(["fit", "walk", "--out", "out", "--estimator", "standing", "--no-pictures"]) == 0
    return desk


@pytest.fixture
def staged(desk: Path, staged_once: Path) -> Path:
    """The desk with the recording `walk` of a posed body by four cameras, and its result `out`, of
    which the first of four frames is lost.
    """
    for name in ("walk", "out"):
        shutil.copytree(staged_once / name, desk / name)
    return desk


@pytest.fixture
def standing4(shared: Path, tmp_path: Path) -> Path:
    """Recording folder of a man who stands still beside a board on the floor, in a real room."""
    source, folder = shared / "data" / "standing4", tmp_path / "standing4"
    (folder / "background").mkdir(parents=True)
    (folder / "calibration.toml").symlink_to(source / "calibration.toml")
    for number in range(1, 5):
        name, kinds = f"cam_{number}", {"": "person_and_board", "background": "background"}
        for place, kind in kinds.items():
            (folder / place / f"{name}.avi").symlink_to(source / f"{name}_{kind}.avi")
    return folder


@pytest.fixture(scope="session")
def couple_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What tests are given copies of as `couple`; not to be changed."""
    with pytest.MonkeyPatch.context() as patch:
        desk = open_desk(tmp_path_factory.mktemp("couple"), patch)
        first, second = waving_couple(5)
        write_staged(desk / "dance", first, ring(3, (320, 240)), second)
        words = "fit dance --out couple --estimator standing --people 2 --no-pictures"
        assert run(words.split()) == 0
    return desk / "couple"


@pytest.fixture
def couple(desk: Path, couple_once: Path) -> Path:
    """The result `couple` of two people of the recording `dance` by three cameras."""
    for name in ("dance", "couple"):
        shutil.copytree(couple_once.parent / name, desk / name)
    return desk / "couple"
