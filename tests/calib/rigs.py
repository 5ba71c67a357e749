"""Rigs for tests."""

from pathlib import Path

import numpy as np
import pytest

from calib.camera import Camera, Rig
from calib.errors import InputError
from calib.files import read_rig
from calib.rotation import matrix_from_rodrigues

PINHOLE = ((), False)
BENT = ((-0.3, 0.12, 0.001, -0.002, 0.01), False)
RATIONAL = ((-0.3, 0.12, 0.001, -0.002, 0.01, 0.02, 0.01, 0.005), False)
PRISM = (
    (-0.3, 0.12, 0.001, -0.002, 0.01, 0.02, 0.01, 0.005, 0.001, -0.001, 0.002, 0.0005, 0.01, -0.02),
    False,
)
FISHEYE = ((0.05, -0.02, 0.01, -0.005), True)


def some_rig(*lenses: tuple[tuple[float, ...], bool], seed: int = 0) -> Rig:
    """Returns a rig with one camera per lens, placed at random."""
    rng = np.random.default_rng(seed)
    return Rig(
        tuple(
            Camera(
                name=f"cam_{index + 1}",
                size=(640 + index, 480),
                matrix=np.array(
                    [[600.0 + rng.random(), 0, 320], [0, 610 + rng.random(), 240], [0, 0, 1]]
                ),
                distortion=np.array(distortion),
                rotation=matrix_from_rodrigues(rng.normal(size=3)),
                translation=rng.normal(size=3) + np.array([0, 0, 4]),
                fisheye=fisheye,
            )
            for index, (distortion, fisheye) in enumerate(lenses)
        )
    )


def assert_same_rig(left: Rig, right: Rig, atol: float = 1e-14) -> None:
    """Says whether two rigs are the same to the last digits."""
    assert left.names == right.names
    for a, b in zip(left, right, strict=True):
        assert a.size == b.size
        assert a.fisheye == b.fisheye
        longest = np.zeros((2, 14))
        longest[0, : len(a.distortion)], longest[1, : len(b.distortion)] = (
            a.distortion,
            b.distortion,
        )
        np.testing.assert_allclose(longest[0], longest[1], rtol=1e-14)
        np.testing.assert_allclose(a.matrix, b.matrix, rtol=atol)
        np.testing.assert_allclose(a.rotation, b.rotation, atol=atol)
        np.testing.assert_allclose(a.translation, b.translation, atol=atol)


def refusal(path: Path, **known) -> str:
    """Returns the one line with which a file is refused."""
    with pytest.raises(InputError) as caught:
        read_rig(path, **known)
    message = str(caught.value)
    assert "\n" not in message and str(path) in message
    return message
