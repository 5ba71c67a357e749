import sys

import cv2
import numpy as np
import pytest

from silhouette_core.image.person_windows import PeopleWindows
from silhouette_core.image.pose_network import POINTS, Crop, PersonSeen, PoseNetwork, cropped


@pytest.mark.parametrize(
    "crop", [Crop(60, 50, 64), Crop(80.3, 40.7, 100, 0.7), Crop(5, 5, 300, -1.2)]
)
def test_a_square_shows_what_lies_at_the_places_of_its_pixels(crop):
    y, x = np.mgrid[:120, :160]
    image = np.stack([x, y, 0 * x], axis=-1).astype(np.uint8)  # every pixel tells where it is
    square = cropped(image, crop)
    y, x = np.mgrid[20:240:20, 20:240:20]
    back = crop.from_network
    places = np.stack([x, y], -1) @ back[:, :2].T + back[:, 2]
    inside = ((places > 3) & (places < (156, 116))).all(axis=-1)
    assert inside.any()
    np.testing.assert_allclose(square[y, x][inside][:, :2], places[inside], atol=1.6)


def test_squares_beyond_the_picture_are_black():
    assert not cropped(np.full((50, 50, 3), 200, np.uint8), Crop(500, 500, 60)).any()


@pytest.mark.parametrize("turn", [0.0, 0.6, -1.4])
def test_the_mask_lies_where_it_was_seen_at_any_scale(turn):
    crop = Crop(150, 100, 128, turn)
    logits = np.full((256, 256), -127, np.int8)
    logits[60:200, 100:150] = 90
    seen = PersonSeen(crop, 1.0, logits, *3 * [np.zeros(0)])
    back = crop.from_network
    middle = back[:, :2] @ (124.5, 129.5) + back[:, 2]
    for scale in (1.0, 0.5, 2.0):
        size = round(300 * scale), round(200 * scale)
        odds = seen.odds(size, scale)
        rows, columns = np.nonzero(odds > 0)
        found = (np.array([columns.mean(), rows.mean()]) + 0.5) / scale - 0.5
        np.testing.assert_allclose(found, middle, atol=0.7)
        area = 140 * 50 * (crop.side_px * scale / 256) ** 2
        assert np.count_nonzero(odds > 0) == pytest.approx(area, rel=0.1)
        assert odds[0, 0] == odds[-1, -1] == -127 / 8  # elsewhere nobody is
    np.testing.assert_allclose(seen.outline_px.mean(axis=0), middle, atol=1)


def test_the_network_sees_nobody_in_an_even_picture(pose_network):
    seen = PoseNetwork(pose_network).look(np.full((200, 200, 3), 90, np.uint8), Crop(100, 100, 200))
    assert seen.presence < 0.5
    assert seen.points_px.shape == (POINTS, 2)
    assert seen.logits.shape == (256, 256) and np.isfinite(seen.points_px).all()


def test_both_libraries_see_the_same(pose_network, monkeypatch, capfd):
    pytest.importorskip("ai_edge_litert", reason="LiteRT is not installed (make install)")
    picture = np.random.default_rng(1).integers(0, 256, (90, 80, 3)).astype(np.uint8)
    seen = [PoseNetwork(pose_network).look(picture, Crop(40, 45, 90))]
    monkeypatch.setitem(sys.modules, "ai_edge_litert.interpreter", None)
    seen += [PoseNetwork(pose_network).look(picture, Crop(40, 45, 90))]
    for name in ("presence", "points_px", "visibility"):
        first, second = (getattr(person, name) for person in seen)
        np.testing.assert_allclose(first, second, atol=0.01)
    assert np.abs(seen[0].logits.astype(int) - seen[1].logits).max() <= 1
    assert capfd.readouterr() == ("", "")  # XNNPACK says that it is there


def test_a_woman_who_walks_is_followed_and_cut_out(pose_network, shared, beside):
    """Real footage, whose outlines were checked by hand."""
    masks = beside("checked_masks")
    checked = masks.read_checked(masks.FOOTAGE / "woman_white.json")["cam_1"]
    video = cv2.VideoCapture(str(shared / "data" / "woman_white" / "cam_1.mp4"))
    windows, overlaps = PeopleWindows(PoseNetwork(pose_network)), []
    for number in range(sorted(checked)[2] + 1):
        frame = video.read()[1]
        (person,) = windows.see(frame).values()
        if number in checked:
            size = frame.shape[1::-1]
            seen = person.odds(size, 1.0) > 0
            people = checked[number].masks_of_people(size, size)[0]
            overlaps.append((seen & people).sum() / (seen | people).sum())
    assert person.is_sure and len(overlaps) == 3 and min(overlaps) > 0.93
