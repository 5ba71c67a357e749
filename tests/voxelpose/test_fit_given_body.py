"""`voxelpose fit --body` with bodies that are no person's, from frames to a result folder."""

import pytest

from examples.bodies.example_motions import BODY, film_example
from tests.other_bodies import assert_found
from voxelpose.cli import run


@pytest.mark.slow
def test_a_quadruped_is_fitted_by_the_command(desk):
    """The examples fit the robot's arm."""
    film_example(desk / "quadruped", "quadruped", 4)
    words = ["fit", "quadruped", "--out", "out", "--body", f"quadruped/{BODY}"]
    assert run(words) == 0
    assert run(["report", "out"]) == 0 and run(["export", "out", "--out", "exported"]) == 0
    assert_found(desk / "quadruped", desk / "out", 4, 6.0, 20.0)
