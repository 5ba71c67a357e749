"""Every kernel, run on its examples with bounds checked, stays within its arrays."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def checked(tmp_path, *words):
    """Runs Python where numba checks bounds, with compiled kernels of its own."""
    environment = {key: os.environ[key] for key in os.environ if not key.startswith("PYTEST")}
    environment |= {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    environment |= {"NUMBA_OPT": "0"}  # they run for moments: optimizing would take longer
    return subprocess.run(
        [sys.executable, *words], cwd=ROOT, env=environment, capture_output=True, text=True
    )


@pytest.mark.slow
def test_kernels_stay_within_their_arrays(tmp_path):
    plugins = "-p", "no:cacheprovider", "-p", "tests.serial_kernels"
    ended = checked(tmp_path, "-m", "pytest", "-q", *plugins, "tests/test_kernels.py")
    assert ended.returncode == 0, ended.stdout[-3000:]


def test_a_kernel_that_leaves_its_array_is_noticed(tmp_path):
    code = (
        "import numpy as np\nfrom numba import njit\n"
        "@njit(error_model='numpy')\ndef f(a, k):\n    return a[k]\n"
        "f(np.zeros(3), 5)\n"
    )
    ended = checked(tmp_path, "-c", code)
    assert ended.returncode == 1 and "IndexError" in ended.stderr
