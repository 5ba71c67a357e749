"""The refined method on synthetic scenes with shadows, noise and changes of exposure."""

import cv2
import numpy as np
import pytest

from silhouette_core.image.background import BackgroundModel
from silhouette_core.image.cast_shadow import darkest_shadow
from silhouette_core.jit import cores, set_threads
from tests.silhouette_core.image.drawn_figures import noisy

SIZE = (240, 320)
NOISE = 1.5


@pytest.fixture(scope="module")
def room() -> np.ndarray:
    """An empty room of two tinted, softly textured planes, (H, W, 3) float."""
    rng = np.random.default_rng(0)
    texture = cv2.GaussianBlur(rng.normal(0, 60, SIZE).astype(np.float32), (0, 0), 6)
    wall = (150 + texture)[..., None] * np.array([1.08, 1.0, 0.92])
    floor = (120 + texture)[..., None] * np.array([0.95, 1.0, 0.9])
    return np.where(np.arange(SIZE[0])[:, None, None] < 130, wall, floor).astype(np.float64)


@pytest.fixture(scope="module")
def model(room: np.ndarray) -> BackgroundModel:
    rng = np.random.default_rng(1)
    return BackgroundModel.from_frames([noisy(room, rng) for _ in range(20)])


@pytest.fixture(scope="module")
def person() -> np.ndarray:
    """A head, a trunk, an arm held away from it, and two legs, four times finer than the picture,
    (4 H, 4 W) uint8.
    """
    fine = np.zeros((4 * SIZE[0], 4 * SIZE[1]), np.uint8)
    for first, second, width in (
        ((600, 200), (600, 240), 90),
        ((600, 340), (600, 480), 130),
        ((560, 300), (430, 480), 36),
        ((575, 480), (550, 800), 48),
        ((625, 480), (660, 800), 48),
    ):
        cv2.line(fine, first, second, 1, width)
    return fine


def composed(
    room: np.ndarray,
    person: np.ndarray,
    colour: tuple[float, float, float],
    shadow_ratio: float = 0.65,
    length: float = 0.25,
) -> tuple[np.ndarray, np.ndarray]:
    """Puts the person into the room with a cast shadow; returns the picture and the true
    silhouette.
    """
    coverage = cv2.resize(person.astype(np.float32), SIZE[::-1], interpolation=cv2.INTER_AREA)
    matrix = np.array([[1, -0.9, 130], [0, length, 202 - 200 * length]], np.float32)
    shadow = cv2.warpAffine(coverage, matrix, SIZE[::-1])
    lit = room * (1 - (1 - shadow_ratio) * cv2.GaussianBlur(shadow, (0, 0), 1.5))[..., None]
    shading = np.linspace(0.9, 1.1, SIZE[1])[None, :, None]
    picture = coverage[..., None] * np.array(colour) * shading + (1 - coverage[..., None]) * lit
    return picture, coverage > 0.5


def subsampled(picture: np.ndarray) -> np.ndarray:
    """Halves the resolution of the colours, as video does."""
    parts = cv2.cvtColor(picture, cv2.COLOR_BGR2YCrCb)
    half = SIZE[1] // 2, SIZE[0] // 2
    for channel in (1, 2):
        small = cv2.resize(parts[..., channel], half, interpolation=cv2.INTER_AREA)
        parts[..., channel] = cv2.resize(small, SIZE[::-1], interpolation=cv2.INTER_LINEAR)
    return cv2.cvtColor(parts, cv2.COLOR_YCrCb2BGR)


def overlap(result: np.ndarray, truth: np.ndarray) -> float:
    return (result & truth).sum() / (result | truth).sum()


CLOTHES = {
    "red": (40, 40, 150),
    "grey": (105, 105, 105),
    "dark": (30, 25, 25),
    "light": (215, 225, 225),
    "blue": (150, 90, 60),
}


@pytest.mark.parametrize("clothes", CLOTHES)
def test_clothes_are_detected_without_their_shadow(room, model, person, clothes):
    picture, truth = composed(room, person, CLOTHES[clothes])
    assert overlap(model.silhouette(noisy(picture, np.random.default_rng(2))), truth) > 0.96


@pytest.mark.parametrize(
    ("clothes", "least"), [("red", (0.94, 0.97)), ("blue", (0.967, 0.975)), ("light", (0.98, 0.98))]
)
def test_edges_are_right_where_video_has_blurred_the_colours(room, model, person, clothes, least):
    """After one look as frames come, and where the person was learned beforehand."""
    picture, truth = composed(room, person, CLOTHES[clothes])
    frame = subsampled(noisy(picture, np.random.default_rng(2)))
    coming = model.with_shadow(0.5)
    coming.look(frame)
    for known, wanted in zip((coming, model.with_colours([frame])), least, strict=True):
        assert overlap(known.silhouette(frame), truth) > wanted


@pytest.mark.parametrize("colour", [(112, 117, 111), (153, 146, 138), (93, 98, 90)])
def test_colours_find_more_of_clothes_like_the_wall(room, model, person, colour):
    """What the background alone leaves open, once somebody is seen."""
    picture, truth = composed(room, person, colour)
    frame = subsampled(noisy(picture, np.random.default_rng(2)))
    seen, unseen = model.with_shadow(0.5), model.silhouette(frame)
    for _ in range(3):
        seen.look(frame)
    assert overlap(seen.silhouette(frame), truth) > 0.95 > 0.7 > overlap(unseen, truth)


@pytest.mark.parametrize("ratio", [0.36, 0.65, 0.8])
def test_the_darkest_shadow_is_measured(room, model, person, ratio):
    picture, truth = composed(room, person, CLOTHES["red"], ratio, length=0.6)
    frame = noisy(picture, np.random.default_rng(8))
    darkest = darkest_shadow(model.shadow_counts(frame))
    assert darkest == pytest.approx(min(ratio - 0.1, 0.65), abs=0.04)
    assert overlap(model.with_shadow(darkest).silhouette(frame), truth) > 0.96
    if ratio < 0.5:  # otherwise that shadow is the person's
        assert overlap(model.silhouette(frame), truth) < 0.9


def test_a_soft_shadow_does_not_hide_its_core():
    counts = np.zeros(35, int)
    counts[15:30] = [5, 10, 20, 30, 40, 50, 60, 70, 80, 90, 100, 120, 150, 120, 80]
    assert darkest_shadow(counts) == pytest.approx(0.59, abs=0.02)
    assert darkest_shadow(np.eye(35, dtype=int)[30] * 500) == 0.65
    assert darkest_shadow(np.eye(35, dtype=int)[4] * 500) == 0.25


def test_without_shadows_none_is_measured(room, model):
    frame = noisy(room, np.random.default_rng(10))
    assert darkest_shadow(model.shadow_counts(frame)) is None


@pytest.mark.parametrize("noise", [NOISE, 3 * NOISE])
def test_clothes_show_in_the_soft_silhouette_and_shadows_do_not(room, model, person, noise):
    picture, truth = composed(room, person, (0, 0, 0))
    shadow = cv2.erode(((picture.sum(2) < 0.8 * room.sum(2)) & ~truth).astype(np.uint8), None) > 0
    # Clothes of the background's own colour, but for a little of their tint.
    clothes = np.where(truth[..., None], room * (0.98, 1.0, 1.02), picture)
    soft = model.soft_silhouette(noisy(clothes, np.random.default_rng(11), noise))
    inside = cv2.erode(truth.astype(np.uint8), None, iterations=3) > 0
    far = cv2.dilate((truth | shadow).astype(np.uint8), None, iterations=12) == 0
    assert soft.tint[shadow].mean() < 0.1 and soft.tint[far].mean() < 0.01
    if noise == NOISE:
        assert soft.tint[inside].mean() > 0.7 > 0.4 > soft.silhouette[inside].mean()


def test_a_difference_that_is_everywhere_is_no_clothes(room, model):
    """A video's blocks tint the whole picture by a little."""
    rng = np.random.default_rng(12)
    tint = cv2.GaussianBlur(rng.normal(0, 40, (*SIZE, 3)), (0, 0), 4)
    assert model.soft_silhouette(noisy(room + tint, rng)).tint.mean() < 0.02


@pytest.mark.parametrize("gain", [(0.85, 0.85, 0.85), (1.1, 1.0, 0.95)])
def test_exposure_and_white_balance_may_change(room, model, person, gain):
    picture, truth = composed(room, person, CLOTHES["red"])
    frame = noisy(picture * np.array(gain), np.random.default_rng(4))
    assert overlap(model.silhouette(frame), truth) > 0.95


def test_a_single_frame_suffices_even_under_more_noise(room, person):
    rng = np.random.default_rng(5)
    still = BackgroundModel.from_frames([noisy(room, rng)])
    picture, truth = composed(room, person, CLOTHES["blue"])
    assert overlap(still.silhouette(noisy(picture, rng)), truth) > 0.94
    assert overlap(still.silhouette(noisy(picture, rng, noise=5)), truth) > 0.88


def test_an_empty_room_is_empty(room, model):
    rng = np.random.default_rng(6)
    assert not model.silhouette(noisy(room, rng)).any()
    assert not model.silhouette(noisy(0.9 * room, rng)).any()


def test_the_gap_between_arm_and_trunk_stays_open(room, model, person):
    picture, truth = composed(room, person, CLOTHES["red"])
    result = model.silhouette(noisy(picture, np.random.default_rng(7)))
    empty = cv2.erode((~truth).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    gap = np.zeros(SIZE, bool)
    gap[90:118, 115:138] = empty[90:118, 115:138]
    assert gap.sum() > 100 and not (result & gap).any()


def test_the_result_does_not_depend_on_the_number_of_threads(room, model, person):
    picture, _ = composed(room, person, CLOTHES["grey"])
    frame = noisy(picture, np.random.default_rng(9))
    try:
        set_threads(1)
        one = model.silhouette(frame)
        set_threads(cores())
        np.testing.assert_array_equal(model.silhouette(frame), one)
    finally:
        set_threads(None)


def test_a_view_into_a_larger_picture_works(room, model, person):
    picture, _ = composed(room, person, CLOTHES["red"])
    frame = noisy(picture, np.random.default_rng(10))
    wide = np.zeros((SIZE[0], SIZE[1] + 10, 3), np.uint8)
    wide[:, 5:-5] = frame
    np.testing.assert_array_equal(model.silhouette(wide[:, 5:-5]), model.silhouette(frame))


def test_a_window_around_the_person_gives_the_same_silhouette(room, model, person):
    """With the exposure of the whole frame; what lies outside of the window is not found."""
    picture, _ = composed(room, person, CLOTHES["blue"])
    frame = noisy(picture * np.array((0.9, 0.95, 1.0)), np.random.default_rng(11))
    model = model.with_shadow(0.5)  # a copy, which learns
    _, exposure = model.look(frame)
    whole = model.silhouette(frame)
    rows, columns = np.flatnonzero(whole.any(axis=1)), np.flatnonzero(whole.any(axis=0))
    window = tuple(slice(max(some[0] - 20, 0), some[-1] + 20) for some in (rows, columns))
    near = model.silhouette_near(frame, frame[window], window, exposure)
    assert overlap(near, whole) > 0.995
    darker = noisy(picture * np.array((0.8, 0.85, 0.9)), np.random.default_rng(11))
    near = model.silhouette_near(darker, darker[window], window, exposure)  # somewhat later
    assert overlap(near, whole) > 0.98
    upper = slice(window[0].start, int(rows.mean())), window[1]
    half = model.silhouette_near(frame, frame[upper], upper, exposure)
    assert half.any() and not half[upper[0].stop :].any()
    with pytest.raises(ValueError, match="part"):
        model.silhouette_near(frame, frame, window, exposure)
    larger = cv2.resize(frame, None, fx=1.5, fy=1.5, interpolation=cv2.INTER_CUBIC)
    near = model.silhouette_near(larger, frame[window], window, exposure)  # as filmed
    assert overlap(near, whole) > 0.995


@pytest.mark.parametrize(("name", "camera"), [("walk4", "cam_2"), ("traffic4", "cam_1")])
def test_overlap_on_rendered_recordings(shared, name, camera):
    from voxelpose.recording.folder import Recording

    recording = Recording.open(shared / "data" / name, frames=(20, 60), cameras=[camera])
    with np.load(shared / "data" / name / "masks/masks.npz") as packed:
        truth = np.unpackbits(packed[camera], axis=2)[:, :, : int(packed["width"])].astype(bool)
    model = BackgroundModel.from_frames(recording.backgrounds()[camera])
    scores = [
        overlap(model.silhouette(frames[camera]), truth[index])
        for index, _, frames in recording
        if index % 8 == 0
    ]
    assert np.mean(scores) > 0.97
