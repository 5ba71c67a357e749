import cv2
import numpy as np
import pytest
from carving_scenes import any_camera, carve_by_reference, look_at, ring, rule_numbers, silhouettes

from calib.camera import Rig
from silhouette_core.jit import set_threads
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.grid import VoxelGrid

PERSON = VoxelGrid.from_bounds((-0.9, -0.7, -0.1), (0.95, 0.7, 1.95), 0.045)
RULES = (CarveRule(), CarveRule(1), CarveRule(2, 0), CarveRule(1, 2))


def verdict_by_cameras(rig, masks, grid, rule):
    """Occupancy by the cameras' own projection, and where no two pixels are as near."""
    points = grid.centres(np.argwhere(np.ones(grid.shape)))
    agreeing, objecting, ties = np.zeros((3, len(points)), int)
    for camera, mask in zip(rig, masks, strict=True):
        pixels = camera.project(points)[0] + 0.5
        ties += (np.abs(pixels - np.rint(pixels)) < 1e-7).any(axis=1)
        with np.errstate(invalid="ignore"):
            seen = ((pixels >= 0) & (pixels < camera.size)).all(axis=1)
        column, row = np.where(seen[:, None], pixels, 0).astype(int).T
        agreeing += seen & mask[row, column]
        objecting += seen & ~mask[row, column]
    tolerance, least = rule_numbers(rule, len(rig))
    occupied = (objecting <= tolerance) & (agreeing >= least)
    return occupied.reshape(grid.shape), (ties == 0).reshape(grid.shape)


@pytest.mark.parametrize("seed", range(30))
def test_a_voxel_is_occupied_as_the_masks_say_where_it_projects(seed):
    """Under any lens: bit for bit by the reference, and by the cameras' own projection, so that
    nothing is carved away that lies in the masks.
    """
    rng = np.random.default_rng(seed)
    rig = Rig(
        tuple(
            any_camera(rng, f"c{i}", rng.normal(size=3) * 2, rng.normal(size=3))
            for i in range(rng.integers(1, 6))
        )
    )
    masks = []
    for camera in rig:
        noise = rng.normal(size=camera.size[::-1])
        noise = cv2.GaussianBlur(noise, None, sigmaX=float(rng.choice([0.5, 4.0, 15.0])))
        masks.append(noise > np.quantile(noise, rng.choice([0.02, 0.5, 0.9])))
    size_m = float(rng.choice([0.03, 0.08]))
    grid = VoxelGrid(rng.normal(size=3) - 24 * size_m, size_m, tuple(rng.integers(1, 50, 3)))
    for rule in RULES:
        carved = carve(rig, masks, grid, rule)
        np.testing.assert_array_equal(carved, carve_by_reference(rig, masks, grid, rule))
        expected, certain = verdict_by_cameras(rig, masks, grid, rule)
        np.testing.assert_array_equal(carved[certain], expected[certain])


def test_blocks_larger_than_the_sums_can_count_agree_with_the_reference():
    rig = Rig((look_at("near", (0, -0.6, 0.9), (0, 0, 0.9), size=(900, 800), focal=900.0),))
    grid = VoxelGrid.from_bounds((-0.3, -0.2, 0.6), (0.3, 0.2, 1.2), 0.01)
    for holes in (0, 1, 40):
        mask = np.ones((800, 900), bool)
        mask[tuple(np.random.default_rng(holes).integers(0, 800, (2, holes)))] = False
        np.testing.assert_array_equal(
            carve(rig, [mask], grid), carve_by_reference(rig, [mask], grid)
        )


@pytest.mark.parametrize("left", range(0, 650, 50))
def test_a_count_that_wraps_to_nothing_is_not_taken_for_it(left):
    """A square of 2^16 pixels, in the image of a block that is larger."""
    rig = Rig((look_at("near", (0, -0.6, 0.9), (0, 0, 0.9), size=(900, 800), focal=900.0),))
    grid = VoxelGrid.from_bounds((-0.32, -0.2, 0.58), (0.32, 0.44, 1.22), 0.02)
    mask = np.zeros((800, 900), bool)
    mask[120:376, left : left + 256] = True
    np.testing.assert_array_equal(carve(rig, [mask], grid), carve_by_reference(rig, [mask], grid))


def test_the_number_of_threads_does_not_matter():
    rig = ring(5)
    masks = silhouettes(rig)
    results = []
    for threads in (1, 2):
        set_threads(threads)
        results.append(carve(rig, masks, PERSON))
    set_threads()
    np.testing.assert_array_equal(*results)


def test_masks_that_do_not_fit_are_refused():
    rig = ring(2)
    masks = silhouettes(rig)
    with pytest.raises(
        ValueError, match=r"mask of cam_1 must be \(120, 160\) bool, got \(60, 80\)"
    ):
        carve(rig, {**masks, "cam_1": np.zeros((60, 80), bool)}, PERSON)
    with pytest.raises(
        TypeError, match=r"mask of cam_0 must be \(120, 160\) bool, got \(120, 160\) float64"
    ):
        carve(rig, {**masks, "cam_0": np.zeros((120, 160))}, PERSON)
    with pytest.raises(ValueError, match="no mask for cam_1"):
        carve(rig, {"cam_0": masks["cam_0"]}, PERSON)
    with pytest.raises(ValueError, match="2 cameras but 1 masks"):
        carve(rig, [masks["cam_0"]], PERSON)


@pytest.mark.parametrize("fields", [{"tolerance": -1}, {"least_agreeing": -1}])
def test_impossible_rules_are_refused(fields):
    with pytest.raises(ValueError, match="must be"):
        CarveRule(**fields)
