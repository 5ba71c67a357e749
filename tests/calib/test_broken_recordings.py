"""The rendered recordings, broken in every way, by their true silhouettes."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from calib.agreement import agreement
from calib.camera import Rig
from calib.extrinsics import pose_difference
from calib.files import read_rig
from calib.repair import Repair, explain
from calib.rotation import matrix_from_rodrigues
from calib.synchronise import synchronise
from calib.tangency import OutlineTrack

FPS = 30.0
Masks = dict[str, np.ndarray]


def true_masks(folder: Path, names: tuple[str, ...]) -> Masks:
    packed = np.load(folder / "masks" / "masks.npz")
    width = int(packed["width"])
    return {name: np.unpackbits(packed[name], axis=-1)[..., :width].astype(bool) for name in names}


def tracks(rig: Rig, masks: Masks) -> dict[str, OutlineTrack]:
    return {
        camera.name: OutlineTrack.from_masks(
            camera, np.arange(len(masks[camera.name])) / FPS, list(masks[camera.name])
        )
        for camera in rig
    }


@pytest.fixture(scope="module")
def walk4(shared: Path) -> tuple[Rig, Masks]:
    rig = read_rig(shared / "data" / "walk4" / "calibration.toml")
    return rig, true_masks(shared / "data" / "walk4", rig.names)


@pytest.fixture(scope="module")
def walk4_tracks(walk4) -> dict[str, OutlineTrack]:
    return tracks(*walk4)


def explained(seen: dict[str, OutlineTrack]) -> Repair:
    moments = np.linspace(4, 70, 12).round() / FPS
    (repair,) = explain(seen, agreement(list(seen.values()), moments), moments, 8 / FPS)
    return repair


@pytest.mark.slow
@pytest.mark.parametrize(("name", "shift_m"), [("cam_1", 0.0), ("cam_3", 0.2)])
def test_a_camera_of_walk4_is_repaired(walk4, walk4_tracks, name, shift_m):
    camera = walk4[0][name]
    turn = matrix_from_rodrigues(np.radians(3) * np.array([0.6, 0.8, 0]))
    wrong = replace(
        camera,
        rotation=turn @ camera.rotation,
        translation=turn @ camera.translation + [shift_m, 0, 0],
    )
    repair = explained(walk4_tracks | {name: walk4_tracks[name].with_camera(wrong)})
    assert (repair.camera, repair.kind) == (name, "moved" if shift_m else "turned")
    millimetres, degrees = pose_difference(repair.after, camera)
    assert millimetres < 60
    assert degrees < 0.5
    assert repair.after_px < 0.6


@pytest.mark.slow
def test_a_late_camera_of_walk4_is_reported(walk4_tracks):
    track = walk4_tracks["cam_0"]
    repair = explained(walk4_tracks | {"cam_0": replace(track, time_s=track.time_s + 3 / FPS)})
    assert repair.kind == "out of step"
    assert repair.offset_s * FPS == pytest.approx(3, abs=0.15)


@pytest.mark.slow
def test_a_letterboxed_camera_and_swapped_ones_of_walk4_are_reported(walk4, walk4_tracks):
    rig, masks = walk4
    small = [
        cv2.resize(mask.astype(np.uint8), (640, 360), interpolation=cv2.INTER_NEAREST) > 0
        for mask in masks["cam_2"]
    ]
    boxed = [np.pad(mask, ((60, 60), (0, 0))) for mask in small]
    repair = explained(
        walk4_tracks
        | {"cam_2": OutlineTrack.from_masks(rig["cam_2"], walk4_tracks["cam_2"].time_s, boxed)}
    )
    assert repair.kind == "scaled"
    assert repair.after.matrix[1, 1] / rig["cam_2"].matrix[1, 1] == pytest.approx(0.75, abs=0.02)
    first, second = walk4_tracks["cam_0"], walk4_tracks["cam_3"]
    repair = explained(
        walk4_tracks
        | {"cam_0": second.with_camera(rig["cam_0"]), "cam_3": first.with_camera(rig["cam_3"])}
    )
    assert (repair.camera, repair.with_camera) == ("cam_0", "cam_3")


@pytest.mark.slow
def test_dance8s_cameras_are_synchronised(shared: Path):
    folder = shared / "data" / "dance8"
    rig = read_rig(folder / "calibration.toml").select(["cam_0", "cam_2", "cam_3", "cam_5"])
    masks = true_masks(folder, rig.names)
    cut = np.array([4, 0, 9, 6])
    shifted = [
        tracks(rig.select([name]), {name: masks[name][ahead:90]})[name]
        for name, ahead in zip(rig.names, cut, strict=True)
    ]
    result = synchronise(shifted, 0.5)
    np.testing.assert_allclose([line.frames for line in result.offsets], cut[0] - cut, atol=0.1)
    slow = replace(shifted[2], time_s=shifted[2].time_s[::2], outlines=shifted[2].outlines[::2])
    result = synchronise([*shifted[:2], slow, shifted[3]], 0.5)
    np.testing.assert_allclose(
        [line.offset_s * FPS for line in result.offsets], cut[0] - cut, atol=0.15
    )
