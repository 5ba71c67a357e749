"""The default library: made once, opened afterwards."""

import threading
from dataclasses import replace

import pytest

from calib.atomic_folder import claimed
from silhouette_core.body.sizes import BodySizes
from silhouette_core.monocular.making import default
from silhouette_core.progress import SilentReporter
from tests.silhouette_core.monocular.making.small_library import SETTINGS, swaying


class Listener(SilentReporter):
    def __init__(self):
        self.notes = []

    def note(self, text):
        self.notes.append(text)


@pytest.fixture
def small(monkeypatch):
    """A short keypose_motions, few poses and no proposal."""
    monkeypatch.setattr(
        "silhouette_core.motion.keyposes.keypose_motions",
        lambda model: {"sway": swaying(0, 60, model.sizes.stature_m)},
    )
    monkeypatch.setattr(default, "SETTINGS", replace(SETTINGS, poses=24))
    monkeypatch.setattr(default, "LEARNING", None)


def test_it_is_made_once_for_every_body(small, tmp_path):
    first = Listener()
    library = default.default_library(BodySizes(1.754), first, tmp_path)
    assert library.model.sizes.stature_m == 1.75 and len(library) <= 24
    assert any("once" in note for note in first.notes)
    again = Listener()
    assert len(default.default_library(BodySizes(1.748), again, tmp_path)) == len(library)
    assert not again.notes
    default.default_library(BodySizes(1.80, 1.001, "female"), again, tmp_path)
    assert len(list(tmp_path.iterdir())) == 2 and again.notes


def test_who_comes_second_waits_for_the_first(small, tmp_path):
    made = default.default_library(BodySizes(1.75), None, tmp_path)
    (path,) = tmp_path.iterdir()
    path.rename(tmp_path / "made")
    begun, ended = threading.Event(), threading.Event()

    def first():
        with claimed(path.with_name(f"{path.name}.first")):
            begun.set()
            assert ended.wait(30)
            (tmp_path / "made").rename(path)

    class Second(Listener):
        def note(self, text):
            super().note(text)
            ended.set()

    thread, second = threading.Thread(target=first), Second()
    thread.start()
    assert begun.wait(30)
    assert len(default.default_library(BodySizes(1.75), second, tmp_path)) == len(made)
    thread.join()
    assert second.notes == [
        "another process is making the pose library of this body: waiting for it"
    ]


def test_a_damaged_one_is_made_again(small, tmp_path):
    default.default_library(BodySizes(1.75), None, tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:-100])
    listener = Listener()
    assert len(default.default_library(BodySizes(1.75), listener, tmp_path))
    assert "truncated" in listener.notes[0] and "made again" in listener.notes[0]
