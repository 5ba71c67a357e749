"""Every kernel, run on its examples where indices are checked, stays within its arrays."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def plain(*words):
    """Runs Python with kernels that are not compiled."""
    environment = {key: os.environ[key] for key in os.environ if not key.startswith("PYTEST")}
    return subprocess.run(
        [sys.executable, *words], cwd=ROOT, env=environment, capture_output=True, text=True
    )


@pytest.mark.slow
def test_kernels_stay_within_their_arrays():
    plugins = "-p", "no:cacheprovider", "-p", "tests.plain_kernels"
    ended = plain("-m", "pytest", "-q", *plugins, "tests/test_kernels.py")
    assert ended.returncode == 0, ended.stdout[-3000:]


def test_a_kernel_that_leaves_its_array_is_noticed():
    code = (
        "import numpy as np, tests.plain_kernels\nfrom silhouette_core.jit import parallel_kernel\n"
        "@parallel_kernel\ndef f(a, k):\n    return a[k]\n"
        "f(np.zeros(3), 5)\n"
    )
    ended = plain("-c", code)
    assert ended.returncode == 1 and "IndexError" in ended.stderr
