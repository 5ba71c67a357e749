"""Breaking a rig in every way that users do, and being told."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from silhouettes import filmed, stage

from calib.agreement import Agreement, body_middle, body_pieces, check_agreement, outline_pixels
from calib.camera import Rig
from calib.errors import InputError
from calib.extrinsics import apart
from calib.files import read_rig
from calib.repair import explain
from calib.rotation import matrix_from_rodrigues

MOMENTS = [4, 8, 12, 16]
Film = dict[str, list[np.ndarray]]


@pytest.fixture(scope="module")
def rig() -> Rig:
    return stage(4)


@pytest.fixture(scope="module")
def film(rig) -> Film:
    return filmed(rig, 21)


def at(film: Film, moments=MOMENTS) -> list[dict[str, np.ndarray]]:
    return [{name: masks[moment] for name, masks in film.items()} for moment in moments]


def bumped(rig: Rig, name: str, degrees: float) -> Rig:
    turn = matrix_from_rodrigues(np.radians(degrees) * np.array([0.6, 0.8, 0]))
    moved = [replace(one, rotation=turn @ one.rotation, translation=turn @ one.translation) if one.name == name else one for one in rig]
    return Rig(tuple(moved))


def test_a_right_rig_agrees(rig, film):
    found = check_agreement(rig, at(film))
    assert found.agrees
    assert found.culprit is None
    assert found.error_px < 0.02
    assert "all 4 cameras agree" in found.words


@pytest.mark.parametrize("name", ["cam_0", "cam_1", "cam_2", "cam_3"])
def test_a_bumped_camera_is_named(rig, film, name):
    found = check_agreement(bumped(rig, name, 2), at(film))
    assert not found.agrees
    assert found.culprit == name
    assert f"{name} does not agree with the others" in found.words
    line = next(line for line in found.table if line.camera == name)
    assert line.others_px < 0.02 < found.error_px


def test_bad_silhouettes_are_told_from_bad_cameras(rig, film):
    shadowed = []
    for moment in at(film):
        mask = moment["cam_2"].copy()
        row, column = np.nonzero(mask)
        mask[row.max() - 20 : row.max() + 1, column.min() : column.max() + 60] = True
        shadowed.append(moment | {"cam_2": mask})
    found = check_agreement(rig, shadowed)
    assert found.culprit == "cam_2"
    assert "it shows what no other sees" in found.words
    headless = []
    for moment in at(film):
        mask = moment["cam_1"].copy()
        mask[: np.nonzero(mask)[0].min() + 40] = False
        headless.append(moment | {"cam_1": mask})
    found = check_agreement(rig, headless)
    assert found.culprit == "cam_1"
    assert "it misses what all others see" in found.words


def test_flicker_far_from_the_body_does_not_matter(rig, film):
    rng = np.random.default_rng(0)
    noisy = [{name: mask | (rng.random(mask.shape) < 0.002) for name, mask in moment.items()} for moment in at(film)]
    assert check_agreement(rig, noisy).agrees


def test_swapped_videos_are_told(rig, film):
    swapped = film | {"cam_0": film["cam_1"], "cam_1": film["cam_0"]}
    found = check_agreement(rig, at(swapped))
    assert not found.agrees
    told = explain(rig, swapped, found, MOMENTS)
    assert told.words == "the videos of cam_0 and cam_1 are swapped"
    assert told.after_px < 0.02


def test_a_video_out_of_step_is_told(rig, film):
    late = film | {"cam_2": [film["cam_2"][max(0, step - 3)] for step in range(21)]}
    found = check_agreement(rig, at(late))
    assert found.culprit == "cam_2"
    told = explain(rig, late, found, MOMENTS, most_offset=4)
    assert told.words == "cam_2 is out of step: 3 frames late"
    assert told.offset_frames == 3


@pytest.mark.slow
def test_a_bumped_camera_is_put_back(rig, film):
    wrong = bumped(rig, "cam_1", 2)
    found = check_agreement(wrong, at(film))
    told = explain(wrong, film, found, MOMENTS, most_offset=2)
    assert "cam_1 was moved: turned by" in told.words
    assert told.after_px < 0.05 < found.error_px
    millimetres, degrees = apart(told.rig["cam_1"], rig["cam_1"])
    assert degrees < 0.6
    assert millimetres < 60
    assert check_agreement(told.rig, at(film, [2, 6, 10, 14])).agrees


@pytest.mark.slow
def test_a_letterboxed_video_is_told(rig, film):
    boxed = []
    for mask in film["cam_3"]:
        picture = np.zeros_like(mask)
        picture[30:210] = cv2.resize(mask.astype(np.uint8), (320, 180), interpolation=cv2.INTER_AREA) > 0
        boxed.append(picture)
    broken = film | {"cam_3": boxed}
    found = check_agreement(rig, at(broken))
    assert found.culprit == "cam_3"
    told = explain(rig, broken, found, MOMENTS, most_offset=2)
    assert "cam_3's picture was scaled" in told.words
    shape = np.diag(told.rig["cam_3"].matrix)[:2] / np.diag(rig["cam_3"].matrix)[:2]
    np.testing.assert_allclose(shape, [1, 0.75], atol=0.03)


def test_what_cannot_be_checked_is_refused(rig, film):
    with pytest.raises(InputError, match="needs three cameras"):
        check_agreement(rig.select(["cam_0", "cam_1"]), at(film))
    empty = [{name: np.zeros_like(mask) for name, mask in moment.items()} for moment in at(film)]
    with pytest.raises(InputError, match="nobody is seen by three cameras"):
        check_agreement(rig, empty)
    with pytest.raises(ValueError, match=r"camera cam_0: silhouette must be \(240, 320\) bool, got \(3, 3\) float64"):
        check_agreement(rig, [at(film)[0] | {"cam_0": np.zeros((3, 3))}])
    unblamed = Agreement(1e-9, (), None, False)  # so little that nothing can halve it
    with pytest.raises(InputError, match="no single change brings the cameras to agree"):
        explain(rig, film | {"cam_0": film["cam_1"]}, unblamed, MOMENTS)


def test_the_parts_do_what_they_say(rig, film):
    masks = [film[camera.name][4] for camera in rig]
    middle = body_middle(list(rig), masks)
    assert 0.7 < middle[2] < 1.3
    outline = outline_pixels(masks[0]).astype(int)
    assert masks[0][outline[:, 1], outline[:, 0]].all()
    assert len(outline) > 100
    speckled = masks[0].copy()
    speckled[0, 0] = True
    np.testing.assert_array_equal(body_pieces(speckled), masks[0])
    whole = np.ones((10, 10), dtype=bool)
    assert len(outline_pixels(whole)) == 0


@pytest.mark.slow
def test_walk4_agrees_and_its_bumped_camera_is_named(shared):
    folder = shared / "data" / "walk4"
    rig = read_rig(folder / "calibration.toml")
    packed = np.load(folder / "masks" / "masks.npz")
    width = int(packed["width"])
    moments = [{name: np.unpackbits(packed[name][t], axis=-1)[:, :width].astype(bool) for name in rig.names} for t in (10, 25, 40, 55, 70)]
    assert check_agreement(rig, moments).agrees
    for name in rig.names:
        assert check_agreement(bumped(rig, name, 1.5), moments).culprit == name
