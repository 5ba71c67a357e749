"""Checks of array arguments, with one error type and one wording for all packages.

A wrong dtype raises TypeError, a wrong shape or a number that is not finite raises ValueError, each
with the text "silhouette must be (H, W) bool, got (3, 240) float64".
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

BoolArray = NDArray[np.bool_]
ByteArray = NDArray[np.uint8]
IntArray = NDArray[np.int64]
IndexArray = NDArray[np.integer]
Float32Array = NDArray[np.float32]
FloatArray = NDArray[np.float64]
RealArray = NDArray[np.floating]


def check_array(
    name: str,
    array: NDArray[Any],
    shape: Iterable[int | str],
    dtype: type[np.generic] | None = None,
    *,
    finite: bool = False,
) -> None:
    """Raises an error where an array is not what a function needs.

    Args:
        shape: Required shape: a number, or a letter such as "N" where any number will do.
        dtype: Required dtype or its kind, such as `np.bool_` or `np.integer`; None allows any.

    Raises:
        TypeError: The dtype is another.
        ValueError: The shape is another, or a number is not finite.
    """
    shape = tuple(shape)
    typed = dtype is None or np.issubdtype(array.dtype, dtype)
    fits = len(shape) == array.ndim and all(
        isinstance(n, str) or n == m for n, m in zip(shape, array.shape, strict=True)
    )
    if not (typed and fits):
        needed = "" if dtype is None else f" {dtype.__name__.rstrip('_')}"
        got = f"{array.shape} {array.dtype}"
    elif finite and not np.isfinite(array).all():
        needed, got = " finite", "NaN or infinity"
    else:
        return
    expected = f"({', '.join(map(str, shape))}{',' * (len(shape) == 1)}){needed}"
    raise (ValueError if typed else TypeError)(f"{name} must be {expected}, got {got}")


def float_array(
    name: str, value: ArrayLike, shape: Sequence[int | str], *, finite: bool = False
) -> FloatArray:
    """Returns a value as float64 of a given shape, without a copy where possible. ValueError where
    the shape is another, or a number is not finite.
    """
    array = np.asarray(value, dtype=np.float64)
    check_array(name, array, shape, finite=finite)
    return array


def image_size(name: str, size: Sequence[int]) -> tuple[int, int]:
    """Returns an image size (width, height), px, as two Python integers. ValueError where it is not
    two numbers of at least 1.
    """
    numbers = tuple(int(n) for n in size)
    if len(numbers) != 2 or min(numbers) < 1:
        raise ValueError(f"{name} must be (width, height) of at least 1 px, got {size}")
    return numbers
