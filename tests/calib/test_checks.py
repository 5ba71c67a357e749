import numpy as np
import pytest

from calib.checks import check_array, float_array, image_size


@pytest.mark.parametrize(
    ("array", "shape", "dtype", "message"),
    [
        (np.zeros((3, 240)), ("H", "W"), np.bool_, r"\(H, W\) bool, got \(3, 240\) float64"),
        (np.zeros(3), ("N", 3), np.integer, r"\(N, 3\) integer, got \(3,\) float64"),
        (np.zeros((2, 4), int), ("N", 3), np.integer, r"\(N, 3\) integer, got \(2, 4\) i"),
        (np.zeros((2, 3)), (2,), None, r"\(2,\), got \(2, 3\) float64"),
        (np.array([1, np.nan]), (2,), None, r"\(2,\) finite, got NaN or infinity"),
    ],
)
def test_a_wrong_array_is_named(array, shape, dtype, message):
    # The dtype decides on the type of the error.
    wrong_type = dtype is not None and not np.issubdtype(array.dtype, dtype)
    with pytest.raises(TypeError if wrong_type else ValueError, match=f"^x must be {message}"):
        check_array("x", array, shape, dtype, finite=True)


def test_right_arrays_pass():
    check_array("x", np.zeros((2, 3), np.uint8), ("N", 3), np.uint8, finite=True)
    check_array("x", np.zeros((2, 3), np.int32), [2, 3], np.integer)
    check_array("x", np.full(2, np.nan), (2,))
    array = np.zeros((4, 2))
    assert float_array("x", array, ("N", 2), finite=True) is array
    assert float_array("x", [[1, 2]], ("N", 2)).dtype == np.float64


@pytest.mark.parametrize("size", [(0, 5), (640,), (640, 480, 3)])
def test_a_wrong_image_size_is_named(size):
    with pytest.raises(ValueError, match=r"size must be \(width, height\) of at least 1 px, got"):
        image_size("size", size)


def test_an_image_size_has_python_integers():
    assert [type(n) for n in image_size("size", np.array([640, 480]))] == [int, int]
