"""Results do not depend on the order in which a backend sums."""

import numpy as np
import pytest

from silhouette_core.estimator import Settings
from silhouette_core.scoring import backend
from silhouette_core.scoring.cpu import CpuBackend
from tests.clips import waving
from tests.silhouette_core.scoring.backward_backend import BackwardBackend
from tests.sources import ring, write_staged
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording

pytestmark = pytest.mark.slow


@pytest.fixture
def motions(tmp_path, monkeypatch):
    """Motions of a recording by the program's own backend, and with all sums backwards."""

    def of(recording, *estimator):
        found = []
        for way in (CpuBackend, BackwardBackend):
            monkeypatch.setattr(backend, "load_registered", lambda *_, way=way: way())
            backend.load_backend.cache_clear()
            assert type(backend.load_backend("cpu")) is way
            output = Output(tmp_path / way.__name__, pictures=False)
            found.append(
                fit(recording, output, Settings(stature_m=1.7, sex="male"), *estimator).motion
            )
        return found

    yield of
    backend.load_backend.cache_clear()


def assert_same(one, other):
    np.testing.assert_array_equal(one.root_m, other.root_m)
    np.testing.assert_array_equal(one.root_quaternion, other.root_quaternion)
    np.testing.assert_array_equal(one.angles_rad, other.angles_rad)


def test_several_cameras(tmp_path, motions):
    folder = write_staged(tmp_path / "walk", waving(3), ring(3, (320, 240)))
    assert_same(*motions(Recording.open(folder)))


def test_one_camera(tmp_path, motions):
    folder = write_staged(tmp_path / "walk", waving(3), ring(1, (320, 240)))
    assert_same(*motions(Recording.open(folder), "monocular"))


@pytest.mark.accuracy
def test_several_cameras_of_a_recording(shared, motions):
    """One torso of several that fit alike was chosen by the last digits: joints 0.98 mm apart."""
    assert_same(*motions(Recording.open(shared / "data" / "walk4", frames=(0, 10))))
