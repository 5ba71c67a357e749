"""Overlay videos and the contact sheet, from frames to files."""

import cv2
import numpy as np

from silhouette_core.progress import SilentReporter
from tests.clips import waving
from tests.sources import GreySource, ring
from voxelpose.view.images import overlay
from voxelpose.view.images.overlay import draw_pictures


def frames_of(path):
    capture = cv2.VideoCapture(str(path))
    frames = []
    while True:
        good, frame = capture.read()
        if not good:
            return np.array(frames), capture.get(cv2.CAP_PROP_FPS)
        frames.append(frame)


def test_a_video_per_camera_and_a_sheet(tmp_path):
    motion = waving(8)
    source, motions = GreySource(ring(3), 8), [motion.select(np.r_[0:5, 6:8])]
    draw_pictures(source, motions, tmp_path, "a title", SilentReporter())
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"contact_sheet.png", *(f"overlay_cam_{n}.webm" for n in (1, 2, 3))}
    frames, fps = frames_of(tmp_path / "overlay_cam_2.webm")
    assert frames.shape == (8, 480, 640, 3)
    assert fps == 25
    middle = frames[:, 53:373, 160:480].astype(int)
    drawn = (np.abs(middle - 90).sum(axis=3) > 60).mean(axis=(1, 2))
    assert (drawn[[0, 4, 6, 7]] > 0.05).all()
    assert drawn[5] < 0.03  # the frame without a pose
    sheet = cv2.imread(str(tmp_path / "contact_sheet.png"))
    assert sheet is not None and sheet.shape[0] > 500 and sheet.shape[1] > 1000


def test_every_tile_of_the_sheet_shows_the_figure(tmp_path):
    motion = waving(3)
    source = GreySource(ring(2), 3)
    sheet = overlay.ContactSheet([motion], list(source.rig), {})
    for frame, _, images in source:
        sheet.add(frame, images)
    assert len(sheet.tiles) == 2 * 3
    for tile in sheet.tiles.values():
        assert tile.shape[:2] == sheet.tile[::-1]
        assert (np.abs(tile.astype(int) - 90).sum(axis=2) > 60).mean() > 0.1


def test_what_is_unknown_is_hatched(tmp_path):
    class Marked(GreySource):
        def unknown(self) -> dict:
            mask = np.zeros((120, 160), bool)
            mask[90:, :40] = True
            return {"cam_1": mask}

    draw_pictures(Marked(ring(2), 2), [waving(2)], tmp_path, "a title", SilentReporter())
    corners = {
        name: frames_of(tmp_path / f"overlay_{name}.webm")[0][0, 368:453, 11:139].astype(float)
        for name in ("cam_1", "cam_2")
    }
    assert corners["cam_1"].std() > 15 and corners["cam_1"].mean() > 95
    assert corners["cam_1"].mean() > corners["cam_2"].mean() + 10
