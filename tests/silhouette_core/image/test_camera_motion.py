"""Cameras that move are told from those that stand still."""

import numpy as np
import pytest

from silhouette_core.image.camera_motion import moves, rim_motion


def room(rng: np.random.Generator) -> np.ndarray:
    """A textured scene, wider than a picture of 320 x 240."""
    coarse = rng.uniform(40, 215, (20, 26, 3))
    return np.kron(coarse, np.ones((16, 16, 1)))


def picture(scene: np.ndarray, left: int, rng: np.random.Generator, person: int) -> np.ndarray:
    """What a camera sees that looks `left` px to the right: the scene, noise, and a person."""
    seen = scene[10:250, left : left + 320].copy()
    seen[60:240, person : person + 80] = scene[70:250, 5:85]
    return np.clip(seen + rng.normal(0, 2, seen.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("step_px", "moving"), [(0, False), (3, True)])
def test_a_camera_that_turns_is_told_from_a_person_who_walks(step_px, moving):
    rng = np.random.default_rng(0)
    scene = room(rng)
    rims = [
        rim_motion(picture(scene, at, rng, 40 + at), picture(scene, at + step_px, rng, 52 + at))
        for at in (0, 15, 30)
    ]
    assert moves(rims) == moving
    if moving:
        assert rims == pytest.approx([step_px] * 3, abs=0.5)


def test_somebody_who_fills_the_middle_does_not_move_the_camera():
    rng = np.random.default_rng(2)
    one = room(rng)[:240, :320]
    other = one.copy()
    other[48:192, 64:256] = one[48:192, 60:252]
    rims = [rim_motion(np.uint8(one), np.uint8(other))] * 3
    assert rims[0] == pytest.approx(0, abs=0.1) and not moves(rims)


def test_a_bare_room_does_not_tell():
    rng = np.random.default_rng(1)
    wall = np.full((240, 320, 3), 128.0)
    one, other = (np.uint8(wall + rng.normal(0, 4, wall.shape)) for _ in range(2))
    assert rim_motion(one, other) is None
    assert not moves([None, None, 9.0]) and not moves([])
