"""The monocular estimator scores through the backend that is chosen."""

import numpy as np
import pytest

from benchmarks.silhouette_source import SilhouetteSource
from silhouette_core.estimator import Settings
from silhouette_core.monocular.monocular_estimator import MonocularEstimator
from silhouette_core.progress import SilentReporter
from tests.outside import install_backend, record_calls
from tests.silhouette_core.monocular.filming import STATURE_M, camera_at, films, performed


@pytest.mark.slow
def test_the_same_motion_by_a_backend_from_outside(tmp_path, monkeypatch):
    camera = camera_at((1.0, -3.9, 1.4), size=(240, 180))
    source = SilhouetteSource(camera, films(performed("wave"), camera, range(0, 8, 4)), 10.0)

    def joints(backend):
        settings = Settings(STATURE_M, backend=backend)
        estimate = MonocularEstimator().estimate(source, settings, SilentReporter())
        return estimate.motion.landmarks()

    expected = joints("cpu")
    install_backend(tmp_path, monkeypatch)
    called = record_calls(monkeypatch)
    np.testing.assert_allclose(joints("arrays"), expected, atol=1e-9)
    assert called == {"part_images", "drawn_weights", "silhouette_errors"}
