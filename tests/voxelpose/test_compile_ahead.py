"""What is compiled ahead is what estimators call, in one signature each."""

import json
import subprocess
import sys

import pytest

from silhouette_core.progress import SilentReporter
from voxelpose.compile_ahead import compile_kernels, kernels
from voxelpose.demo.room import make_recording

ESTIMATORS = "multiview", "monocular"
# Runs a command, and prints what was compiled or loaded, with its types.
WATCHED = """
import json, sys
from numba.core.dispatcher import Dispatcher
called = {}
compiled = Dispatcher.compile
def compile(self, sig):
    code, done = self.py_func, compiled(self, sig)
    called.setdefault(f"{code.__module__}.{code.__name__}", []).append(repr(tuple(sig)))
    return done
Dispatcher.compile = compile
from voxelpose.cli import run
code = run(sys.argv[1:])
print(json.dumps(called))
sys.exit(code)
"""


def listed(estimator):
    return {(f"{module}.{name}", types) for module, name, types in kernels([estimator])}


def test_each_kernel_is_listed_once_and_has_one_signature():
    both = kernels(ESTIMATORS)
    names = [(module, name) for module, name, _ in both]
    assert len(names) == len(set(names)) > 30
    one = kernels(["multiview"])
    assert kernels(["multiview"], last_first=True) == one[::-1] and both[: len(one)] == one
    assert kernels(["somebody's own"]) == []


def test_what_is_compiled_ahead_has_the_types_of_a_call():
    """Text would be another key of the cache."""
    module, name, types = kernels(["multiview"])[1]
    compile_kernels([(module, name, types)], SilentReporter())
    (signature,) = getattr(sys.modules[module], name).signatures
    assert repr(tuple(signature)) == types


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """Few frames need all kernels, too."""
    return str(make_recording(tmp_path_factory.mktemp("made") / "recording", 4))


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_run_calls_no_kernel_that_is_not_listed(recording, tmp_path, estimator):
    out = ["--out", str(tmp_path / "out"), "--no-pictures"]
    words = (
        ["fit", recording] if estimator == "multiview" else ["track", recording, "--camera=cam_2"]
    )
    ran = subprocess.run(
        [sys.executable, "-c", WATCHED, *words, *out], capture_output=True, text=True
    )
    assert ran.returncode == 0, ran.stderr
    called = json.loads(ran.stdout.splitlines()[-1])
    names = {name for name, _ in listed(estimator)}
    found = {(name, types) for name in called.keys() & names for types in called[name]}
    assert found <= listed(estimator)
