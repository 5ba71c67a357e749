"""Somebody who lies on the floor, legs in the air: right, or what is wrong is not called known."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from benchmarks.lying import FALSE_MM, LIMBS, limb_errors_mm
from silhouette_core.estimator import Settings
from voxelpose.fitting import Output, fit
from voxelpose.recording.folder import Recording
from voxelpose.recording.truth import read_truth
from voxelpose.reliability import verdict_of


@pytest.mark.accuracy
def test_the_shared_case_of_a_lying_person(shared: Path, tmp_path: Path):
    script = shared / "cases" / "scripts" / "lying_arm" / "scenes.py"
    if not script.exists():
        pytest.skip(f"no {script}")
    drawn = tmp_path / "lying"
    subprocess.run([sys.executable, script, drawn, "lying", "5"], check=True)
    settings = Settings(stature_m=1.74, network="off")
    result = fit(Recording.open(drawn), Output(tmp_path / "out", pictures=False), settings)
    off_mm = limb_errors_mm(result, read_truth(drawn / "truth.json"))
    known = result.motion.quality["landmark_confidence"][:, LIMBS] >= 0.5
    assert not (known & (off_mm > FALSE_MM)).any() or verdict_of(result.summary).level != "reliable"
    assert np.median(off_mm) < 40
