"""The default library: made once, opened afterwards."""

from dataclasses import replace

import pytest

from silhouette_core.body.sizes import BodySizes
from silhouette_core.library import default
from silhouette_core.progress import SilentReporter
from tests.silhouette_core.library.small_library import SETTINGS, swaying


class Listener(SilentReporter):
    def __init__(self):
        self.notes = []

    def note(self, text):
        self.notes.append(text)


@pytest.fixture
def small(monkeypatch):
    """A short keypose_motions and few poses."""
    monkeypatch.setattr(
        "silhouette_core.motion.keyposes.keypose_motions",
        lambda model: {"sway": swaying(0, 60, model.sizes.stature_m)},
    )
    monkeypatch.setattr(default, "SETTINGS", replace(SETTINGS, poses=24))


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


def test_a_damaged_one_is_made_again(small, tmp_path):
    default.default_library(BodySizes(1.75), None, tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:-100])
    listener = Listener()
    assert len(default.default_library(BodySizes(1.75), listener, tmp_path))
    assert "truncated" in listener.notes[0] and "made again" in listener.notes[0]
