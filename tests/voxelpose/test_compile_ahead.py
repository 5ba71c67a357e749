"""What is compiled ahead, in one signature each; that it is what estimators call, commands show in
test_backend_calls.py.
"""

import sys

from silhouette_core.progress import SilentReporter
from voxelpose.compile_ahead import compile_kernels, kernels

ESTIMATORS = "multiview", "monocular"


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
