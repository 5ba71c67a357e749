"""Cameras that move are told from those that stand still, and those that shake are steadied."""

import subprocess
import sys

import cv2
import numpy as np
import pytest

from silhouette_core.image.camera_motion import CameraMovement


def room(rng: np.random.Generator) -> np.ndarray:
    """A textured scene, wider than a picture of 320 x 240."""
    return np.kron(rng.uniform(40, 215, (20, 26, 3)), np.ones((16, 16, 1)))


def picture(scene: np.ndarray, left: int, rng: np.random.Generator, person: int) -> np.ndarray:
    """What a camera sees that looks `left` px to the right: the scene, noise, and a person."""
    seen = scene[10:250, left : left + 320].copy()
    seen[60:240, person : person + 80] = scene[70:250, 5:85]
    return np.clip(seen + rng.normal(0, 2, seen.shape), 0, 255).astype(np.uint8)


def walk(scene: np.ndarray, rng: np.random.Generator) -> list[np.ndarray]:
    """Pictures of a person who walks before a camera that stands still."""
    return [picture(scene, 20, rng, 40 + 10 * step) for step in range(12)]


@pytest.mark.parametrize("near", [None, 0, 11])
def test_who_walks_or_hides_the_rim_at_first_or_last_does_not_move_the_camera(near):
    rng = np.random.default_rng(7)
    scene = room(rng)
    frames = [picture(scene, 30, rng, 40 + 12 * step) for step in range(12)]
    if near is not None:
        frames[near][:, 30:] = np.uint8(room(rng)[:240, :290])  # before the lens
    motion = CameraMovement(frames)
    assert not motion.moves and not motion.shakes


def test_a_camera_that_turns_away_moves():
    rng = np.random.default_rng(0)
    scene = np.tile(room(rng), (1, 2, 1))
    motion = CameraMovement([picture(scene, 40 * at, rng, 100) for at in range(12)])
    assert motion.moves and not motion.shakes


@pytest.mark.parametrize(("to_px", "shakes"), [(0.1, False), (1.0, True)])
def test_a_camera_that_shakes_is_told_from_one_that_stands_still(to_px, shakes):
    rng = np.random.default_rng(5)
    scene = cv2.GaussianBlur(room(rng), (0, 0), 2)
    frames = []
    for at in range(12):
        matrix = np.array([[1, 0, to_px * np.sin(2 * at)], [0, 1, to_px * np.cos(3 * at)]])
        moved = cv2.warpAffine(scene, matrix, scene.shape[1::-1], borderMode=cv2.BORDER_REPLICATE)
        frames.append(picture(moved, 20, rng, 40 + 10 * at))
    motion = CameraMovement(frames)
    assert motion.shakes == shakes and not motion.moves


@pytest.mark.parametrize(
    ("settings", "tones"),
    [
        (lambda grey: 0.5 * grey, False),
        (lambda grey: 1.15 * grey, False),
        (lambda grey: 255 * (grey / 255) ** 0.3, True),
        (lambda grey: 255 - 0.9 * grey, None),
    ],
    ids=["dark", "bright", "curve", "negative"],
)
def test_an_empty_view_of_other_settings_does_not_shake_the_camera(settings, tones):
    rng = np.random.default_rng(6)
    scene = cv2.GaussianBlur(room(rng), (0, 0), 2)
    motion = CameraMovement(walk(scene, rng), [np.uint8(settings(scene[10:250, 20:340]))])
    if tones is None:  # nothing is recognised
        assert motion.shakes and not motion.other_settings
    else:
        assert (motion.shakes, motion.other_tones) == (False, tones) and motion.other_settings


def test_an_empty_view_in_hlg_is_named_wherever_it_is_found():
    rng = np.random.default_rng(6)
    scene = cv2.GaussianBlur(room(rng), (0, 0), 2)
    frames = walk(scene, rng)
    light = 0.3 * (scene[10:250, 20:340] / 255) ** 2.2  # to BT.2100's curve
    curve = 0.17883277 * np.log(np.maximum(12 * light - 0.28466892, 1e-6)) + 0.55991073
    empty = np.uint8(255 * np.where(light <= 1 / 12, np.sqrt(3 * light), curve))
    assert CameraMovement(frames, [empty]).other_settings
    same = CameraMovement(frames, [np.uint8(scene[10:250, 20:340])])
    assert not same.other_settings and not same.shakes


def test_a_camera_that_was_touched_after_its_empty_view_is_told():
    rng = np.random.default_rng(6)
    scene = room(rng)
    frames = walk(scene, rng)
    for left, shakes in ((20, False), (23, True)):
        empty = np.uint8(scene[10:250, left : left + 320])
        assert CameraMovement(frames, [empty]).shakes == shakes


def test_somebody_who_fills_the_middle_does_not_move_the_camera():
    rng = np.random.default_rng(2)
    clothes = room(rng)
    frames = []
    for at in range(5):
        frame = 128 + rng.normal(0, 1, (240, 320, 3))  # a bare wall
        frame[48:192, 64:256] = clothes[48:192, 64 + 2 * at : 256 + 2 * at]
        frames.append(np.uint8(frame))
    motion = CameraMovement(frames)
    assert not motion.moves and not motion.shakes


@pytest.mark.parametrize("step", [4, 60])  # faint as of two shades of a floor, and sharp
def test_what_a_single_line_does_not_tell_is_no_motion(step):
    rng = np.random.default_rng(8)
    y, x = np.indices((240, 320))
    floor = 128 + step * (y > 40 + x / 2)[..., None] * np.ones(3)  # from rim to rim
    frames = []
    for at in range(12):
        frame = floor + rng.normal(0, 2, floor.shape)
        frame[60 + 5 * at : 130 + 5 * at, 20 * at : 20 * at + 50] -= 40  # somebody, also in the rim
        frames.append(np.uint8(np.clip(frame, 0, 255)))
    motion = CameraMovement(frames)
    assert not motion.moves and not motion.shakes
    np.testing.assert_array_equal(motion.registered(frames[0]).shape, frames[0].shape)


@pytest.mark.accuracy
def test_a_shared_camera_above_a_plain_floor_stands_still(shared, tmp_path):
    script = shared / "cases" / "scripts" / "overhead_camera_plain_floor" / "scenes.py"
    if not script.is_file():
        pytest.skip(f"no script that draws the recording at {script}")
    subprocess.run([sys.executable, script, tmp_path / "ceiling", "ceiling", "5"], check=True)
    film = cv2.VideoCapture(str(tmp_path / "ceiling" / "cam_3.mp4"))
    motion = CameraMovement([film.read()[1] for _ in range(24)])
    assert not motion.moves and not motion.shakes


def test_a_shake_across_a_single_line_is_told():
    rng = np.random.default_rng(9)
    y, x = np.indices((240, 320))
    frames = []
    for at in range(12):
        floor = 128 + 60 * (y > 40 + x / 2 + (-1) ** at * 0.7)[..., None] * np.ones(3)
        frames.append(np.uint8(floor + rng.normal(0, 1, floor.shape)))
    motion = CameraMovement(frames)
    assert motion.shakes and not motion.moves
    steady = [motion.registered(frame).astype(float) for frame in frames[:2]]
    line = np.abs(frames[1] - 1.0 * frames[0]) > 30
    assert np.abs(steady[1] - steady[0])[line].mean() < 30


def test_noise_before_a_bare_wall_moves_nothing():
    rng = np.random.default_rng(1)
    wall = np.full((240, 320, 3), 128.0)
    motion = CameraMovement([np.uint8(wall + rng.normal(0, 4, wall.shape)) for _ in range(12)])
    assert not motion.moves and not motion.shakes


@pytest.mark.parametrize("size", [1, 3])  # the larger one is measured in a smaller picture
@pytest.mark.parametrize("places", [(1, -1, 0), (1, 1, 0)])  # the latter is not where the median is
def test_frames_of_a_camera_that_shakes_are_registered_to_their_mean(size, places):
    rng = np.random.default_rng(3)
    width, height = 320 * size, 240 * size
    scene = cv2.resize(room(rng)[10:250, 20:340], (width, height), interpolation=cv2.INTER_NEAREST)
    scene = cv2.GaussianBlur(scene, (0, 0), 1.5)

    def shaken(by: float) -> np.ndarray:
        matrix = cv2.getRotationMatrix2D((width / 2, height / 2), 0.7 * by, 1 + 0.004 * by)
        matrix[:, 2] += by * np.array([3.4 * size, -2.3 * size])
        return cv2.warpAffine(scene, matrix, (width, height), borderMode=cv2.BORDER_REPLICATE)

    frames = [np.uint8(shaken(place)) for place in places]
    frames[0][60 * size :, 100 * size : 180 * size] = 40  # somebody
    motion = CameraMovement(frames)
    assert motion.shakes
    part = slice(12 * size, -12 * size), slice(12 * size, 90 * size)
    mean = shaken(sum(places) / len(places))
    for frame in frames:
        off = np.abs(motion.registered(frame).astype(float) - mean)[part].mean()
        assert off < 1.5 < 0.2 * np.abs(shaken(1) - shaken(0))[part].mean()


def test_a_picture_of_another_place_stays_as_it_is():
    rng = np.random.default_rng(4)
    one, other = (np.uint8(room(rng)[:240, :320]) for _ in range(2))
    motion = CameraMovement([one, other, one])
    np.testing.assert_array_equal(motion.registered(other), other)
