"""The empty scene from frames with a person in them, on drawn rooms."""

import cv2
import numpy as np

from silhouette_core.image.background import BackgroundModel
from silhouette_core.image.empty_scene import EmptyScene

SIZE = (360, 480)
SHIRT, TROUSERS = (40, 40, 180), (150, 70, 30)


def room() -> np.ndarray:
    """A coloured wall with soft folds above a floor, (H, W, 3) float."""
    rows, columns = np.mgrid[: SIZE[0], : SIZE[1]]
    light = 120 + 30 * columns / SIZE[1] + 8 * np.sin(columns / 12)
    picture = light[..., None] * np.array([1.0, 0.9, 0.8])
    picture[rows > 270] *= (0.6, 0.8, 0.7)
    return picture


def film(
    boxes: list[tuple[slice, slice]],
    gain: float = 0.0,
    empty: np.ndarray | None = None,
    limbs: tuple[list[tuple[slice, slice]], ...] = (),
) -> tuple[np.ndarray, np.ndarray]:
    """Frames (T, H, W, 3) of a person in a box, shirt above trousers, with limbs in boxes of the
    shirt's colour, and its silhouettes.
    """
    empty = room() if empty is None else empty
    rng = np.random.default_rng(5)
    frames, masks = [], []
    for number, (rows, columns) in enumerate(boxes):
        picture, mask = empty.copy(), np.zeros(SIZE, bool)
        middle = (rows.start + rows.stop) // 2
        picture[rows.start : middle, columns] = SHIRT
        picture[middle : rows.stop, columns] = TROUSERS
        mask[rows, columns] = True
        for limb in limbs:
            picture[limb[number]] = SHIRT
            mask[limb[number]] = True
        picture = cv2.GaussianBlur(picture, (0, 0), 0.7) * (1 + gain * rng.uniform(-1, 1))
        frames.append(np.rint(picture + rng.normal(0, 2, picture.shape)).clip(0, 255))
        masks.append(mask)
    return np.stack(frames).astype(np.uint8), np.stack(masks)


def agreement(frames: np.ndarray, masks: np.ndarray) -> float:
    """Mean intersection over union of the silhouettes with the true ones."""
    model = BackgroundModel.from_occupied(frames)
    frames, masks = frames[::4], masks[::4]
    found = np.stack([model.silhouette(frame) for frame in frames])
    return float(((found & masks).sum(axis=(1, 2)) / (found | masks).sum(axis=(1, 2))).mean())


def box(left: int, top: int = 40, width: int = 24) -> tuple[slice, slice]:
    return slice(3 * top, 300), slice(3 * left, 3 * (left + width))


def test_a_walking_person_is_left_out():
    frames, masks = film([box(4 * k) for k in range(30)], gain=0.02)
    scene = EmptyScene.from_frames(frames)
    assert np.abs(scene.mean - room())[3:-3, 3:-3].mean() < 3
    assert not scene.unseen.any()
    assert agreement(frames, masks) > 0.95


def test_a_person_who_stands_still_first_is_left_out():
    frames, masks = film([box(60)] * 12 + [box(60 + 3 * k) for k in range(18)])
    median = np.median(frames, axis=0)
    assert np.abs(median - room())[150:270, 198:240].mean() > 40  # the median shows the person
    scene = EmptyScene.from_frames(frames)
    assert np.abs(scene.mean - room())[135:285, 192:240].mean() < 6
    assert agreement(frames, masks) > 0.93


def test_a_trunk_between_limbs_that_move_is_left_out():
    swing = [round(45 * np.sin(2 * k)) for k in range(30)]
    frames, masks = film(
        [box(60)] * 30,
        limbs=(
            [(slice(150 + k, 168 + k), slice(105, 165)) for k in swing],
            [(slice(150 - k, 168 - k), slice(267, 327)) for k in swing],
            [(slice(308, 326), slice(180 + k, 240 + k)) for k in swing],
        ),
    )
    scene = EmptyScene.from_frames(frames)
    assert scene.unseen[150:270, 190:240].mean() > 0.9
    assert agreement(frames, masks) > 0.8


def test_furniture_behind_a_person_remains():
    furnished = room()
    furnished[180:300, 270:390] = (30, 50, 60)
    furnished[60:150, 210:270] = (200, 210, 60)
    frames, masks = film([box(60)] * 10 + [box(60 + 3 * k) for k in range(20)], empty=furnished)
    scene = EmptyScene.from_frames(frames)
    assert np.abs(scene.mean - furnished)[5:-5, 5:-5].mean() < 4
    assert not scene.unseen.any()
    assert agreement(frames, masks) > 0.93


def test_an_empty_scene_is_its_mean():
    frames, _ = film([(slice(0, 0), slice(0, 0))] * 9)
    scene = EmptyScene.from_frames(frames)
    np.testing.assert_allclose(scene.mean, np.mean(frames, axis=0), atol=0.5)
    assert not scene.unseen.any()


def test_a_person_in_a_single_frame_is_no_part_of_the_scene():
    empty, _ = film([(slice(0, 0), slice(0, 0))] * 8)
    frame, mask = film([box(60)])
    scene = EmptyScene.from_frames(np.concatenate([empty, frame]))
    assert np.abs(scene.mean - room())[mask[0]].mean() < 3
