"""Views without lens distortion: silhouettes, and parts of the pictures that they come from."""

from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.image.silhouettes import Silhouettes, UndistortedView
from tests.sources import GreySource, ring

BODY = slice(60, 180), slice(130, 190)
SHADE = slice(180, 200), slice(200, 300)


class Room(GreySource):
    """A red box in a grey room, which casts a shadow; it walks where the empty view is missing."""

    def __init__(self, filmed: bool, region: np.ndarray | None = None):
        super().__init__(ring(1, (320, 240)), 12)
        self.filmed, self.region = filmed, region

    def room(self) -> np.ndarray:
        noise = np.random.default_rng(0).normal(0, 1.5, (240, 320, 3))
        return np.rint(np.array((110, 120, 130)) + noise).astype(np.uint8)

    def backgrounds(self) -> dict:
        return {"cam_1": [self.room()]} if self.filmed else {}

    def regions(self) -> dict:
        return {} if self.region is None else {"cam_1": self.region}

    def at(self, steps):
        for step in steps:
            frame = self.room()
            frame[SHADE] = (frame[SHADE] * 0.7).astype(np.uint8)
            walked = 0 if self.filmed else 20 * int(step) - 110
            frame[BODY[0], 130 + walked : 190 + walked] = (40, 40, 180)
            yield {"cam_1": frame}


@pytest.mark.parametrize("filmed", [True, False])
def test_stages_end_in_the_silhouette_and_tell_person_from_background(filmed):
    region = np.ones((240, 320), bool)
    region[:90] = False
    source = Room(filmed, region)
    silhouettes, frame = Silhouettes(source), next(source.at([6]))
    stages = silhouettes.stages("cam_1", frame["cam_1"])
    np.testing.assert_array_equal(stages.silhouette, silhouettes.of(frame)["cam_1"])
    assert stages.first[80, 160] and not stages.silhouette[80, 160]  # outside of the region
    assert stages.silhouette[120, 160] and stages.odds[120, 160] > 1
    assert not stages.silhouette[120, 40] and stages.odds[120, 40] < -1
    np.testing.assert_allclose(stages.background[120, 160], (110, 120, 130), atol=5)


def test_a_shadow_is_called_one():
    source = Room(True)
    stages = Silhouettes(source).stages("cam_1", next(source.at([0]))["cam_1"])
    assert stages.shadow[190, 250] and not stages.silhouette[190, 250]
    assert stages.brightness[190, 250] == pytest.approx(0.7, abs=0.03)
    assert not stages.shadow[120, 160] and not stages.shadow[120, 40]


def test_what_is_not_computed_is_not_shown():
    source = Room(True)
    silhouettes, frame = Silhouettes(source, "paper"), next(source.at([0]))
    stages = silhouettes.stages("cam_1", frame["cam_1"])
    np.testing.assert_array_equal(stages.silhouette, silhouettes.of(frame)["cam_1"])
    assert stages.odds is stages.shadow is None
    source.silhouettes_given = True
    with pytest.raises(InputError, match="used as they are"):
        Silhouettes(source).stages("cam_1", frame["cam_1"])


@pytest.mark.parametrize("distortion", [(), (-0.2, 0.05, 0.0, 0.0)])
@pytest.mark.parametrize("scale", [1, 2])
def test_a_part_of_a_picture_is_undistorted_as_its_silhouette_is(distortion, scale):
    camera = ring(1, (320, 240), distortion).cameras[0]
    lens = UndistortedView.from_camera(camera, 320 // scale)
    mask = np.zeros((240, 320), bool)
    mask[40:200, 90:200] = True
    picture = np.repeat(mask[..., None].astype(np.uint8) * 255, 3, axis=2)
    whole = lens.undistort(mask[scale // 2 :: scale, scale // 2 :: scale])
    corner, size = (50 // scale, 30 // scale), (120 // scale, 140 // scale)
    part = lens.undistort_part(picture, corner, size)
    assert part.shape == (size[1], size[0], 3)
    seen = whole[corner[1] : corner[1] + size[1], corner[0] : corner[0] + size[0]]
    assert ((part[..., 1] > 127) != seen).mean() < 0.02 and seen.any() and not seen.all()


class TwoRooms(Room):
    """The same room filmed by two cameras, of which the second one has no empty view."""

    def __init__(self) -> None:
        super().__init__(True)
        self.rig = ring(2, (320, 240))

    def at(self, steps):
        walking = Room(False).at(steps)
        for own, other in zip(super().at(steps), walking, strict=True):
            yield own | {"cam_2": other["cam_1"]}


def notes_of(silhouettes: Silhouettes) -> list[str]:
    texts = []
    silhouettes.note(SimpleNamespace(note=texts.append))
    return texts


@pytest.mark.parametrize(
    ("kind", "words", "unsure"),
    [
        ("auto", "a uniform backdrop", ()),
        ("paper", "a uniform backdrop", ()),
        ("moving", "estimated from the recording's own frames", ("cam_2",)),
    ],
)
def test_one_note_names_each_camera_s_kind_of_background(kind, words, unsure):
    silhouettes = Silhouettes(TwoRooms(), kind)
    assert notes_of(silhouettes) == [f"backgrounds: cam_1: an empty view; cam_2: {words}"]
    assert silhouettes.without_background == unsure


def test_masks_have_no_background_to_be_named():
    source = Room(True)
    source.silhouettes_given = True
    assert notes_of(Silhouettes(source)) == []


def test_an_unknown_kind_of_background_is_refused():
    with pytest.raises(InputError, match=r"'plain' must be one of auto, uniform, moving, paper"):
        Silhouettes(Room(True), "plain")


class ShakenRoom(Room):
    """A room with pictures on its walls, before a camera that shakes, or was touched."""

    def __init__(self, filmed: bool, shaken_px: float, touched_px: float = 0.0):
        super().__init__(filmed)
        self.shaken_px, self.touched_px = shaken_px, touched_px

    def room(self) -> np.ndarray:
        coarse = np.random.default_rng(1).uniform(60, 190, (12, 16, 3)).astype(np.float32)
        smooth = cv2.GaussianBlur(np.kron(coarse, np.ones((20, 20, 1), np.float32)), (0, 0), 1.5)
        noise = np.random.default_rng(0).normal(0, 1.5, smooth.shape)
        return (smooth + noise).clip(0, 255).astype(np.uint8)

    def backgrounds(self) -> dict:
        empty = {"cam_1": [moved(self.room(), self.touched_px)]}
        return empty if self.filmed else {}

    def at(self, steps):
        for step in steps:
            (frame,) = (one["cam_1"] for one in super().at([step]))
            yield {"cam_1": moved(frame, self.shaken_px * (int(step) % 3))}


class CurvedRoom(ShakenRoom):
    """The same room, whose empty view was filmed with another curve of tones."""

    def backgrounds(self) -> dict:
        empty = super().backgrounds()["cam_1"]
        return {"cam_1": [(255 * (one / 255) ** 0.3).astype(np.uint8) for one in empty]}


def test_an_empty_view_of_other_settings_is_named_and_set_aside():
    silhouettes = Silhouettes(CurvedRoom(True, 0))
    notes = notes_of(silhouettes)
    assert silhouettes.without_background == ("cam_1",)
    (line,) = (words for words in notes if "other settings" in words)
    assert line.startswith("the empty view of cam_1 was filmed with other settings")
    assert not any("shakes" in words for words in notes)


def moved(picture: np.ndarray, right_px: float) -> np.ndarray:
    """A picture moved to the right, its border continued."""
    matrix = np.array([[1, 0, right_px], [0, 1, 0]], np.float64)
    size = picture.shape[1::-1]
    return cv2.warpAffine(picture, matrix, size, borderMode=cv2.BORDER_REPLICATE)


@pytest.mark.parametrize(
    ("filmed", "shaken_px", "touched_px"), [(True, 2.5, 0), (True, 0, 3.5), (False, 2.5, 0)]
)
def test_what_a_camera_that_shakes_sees_is_registered(filmed, shaken_px, touched_px):
    source = ShakenRoom(filmed, shaken_px, touched_px)
    silhouettes = Silhouettes(source)
    assert any("cam_1: shakes, or was touched" in words for words in notes_of(silhouettes))
    assert not silhouettes.moving
    for step in (4, 5):
        mask = silhouettes.of(next(source.at([step])))["cam_1"]
        true = np.zeros_like(mask)
        left = 130 + (0 if filmed else 20 * step - 110)
        true[BODY[0], left : left + 60] = True
        assert (mask & true).sum() / (mask | true).sum() > 0.9
