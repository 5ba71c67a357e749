"""Plugin of pytest: kernels run as plain Python, where NumPy raises an index out of bounds.

Compiled with bounds checked, an index out of bounds in a thread of a parallel kernel ends that
thread and is raised nowhere, and compiling takes longer than all examples do in plain Python.
"""

from silhouette_core import jit


def plain(function):
    """Stands for both decorators of kernels."""
    function.py_func = function  # by which tests/test_kernels.py knows a kernel
    return function


jit.kernel = jit.parallel_kernel = plain
