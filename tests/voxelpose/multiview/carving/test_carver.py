import cv2
import numpy as np
import pytest
from carving_scenes import carve_by_reference, look_at, ring, silhouettes

from calib.camera import Rig
from silhouette_core.jit import set_threads
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.grid import VoxelGrid

BARREL = (-0.3, 0.12, -0.002, 0.003, -0.01)
RATIONAL = (0.5, -0.2, 0.001, -0.002, 0.05, 0.8, -0.1, 0.02)
PRISM = (-0.2, 0.05, 0.002, 0.001, 0.0, 0.0, 0.0, 0.0, 0.004, -0.001, -0.003, 0.002)
TILT = (*PRISM, 0.03, -0.02)
FISHEYE = (0.05, -0.01, 0.003, -0.001)
PERSON = VoxelGrid.from_bounds((-0.9, -0.7, -0.1), (0.95, 0.7, 1.95), 0.045)
WIDE = VoxelGrid.from_bounds(
    (-3.5, -3.4, -1.0), (3.6, 3.5, 3.3), 0.13
)  # holds the cameras: much is behind them


@pytest.mark.parametrize("grid", [PERSON, WIDE], ids=["person", "wide"])
@pytest.mark.parametrize(
    "lens",
    [
        {},
        {"distortion": BARREL},
        {"distortion": RATIONAL},
        {"distortion": TILT},
        {"distortion": FISHEYE, "fisheye": True, "focal": 90.0},
    ],
    ids=["pinhole", "barrel", "rational", "tilt", "fisheye"],
)
@pytest.mark.parametrize(
    "rule",
    [
        CarveRule(),
        CarveRule(tolerance=1),
        CarveRule(outside="carve"),
        CarveRule(1, "carve", 2),
        CarveRule(0, "keep", 0),
    ],
)
def test_carving_is_the_references_bit_for_bit(lens, grid, rule):
    rig = ring(4, **lens)
    masks = silhouettes(rig)
    carved = carve(rig, masks, grid, rule)
    assert carved.any()
    np.testing.assert_array_equal(carved, carve_by_reference(rig, masks, grid, rule))


@pytest.mark.parametrize("seed", range(12))
def test_any_masks_cameras_and_grids_agree_with_the_reference(seed):
    rng = np.random.default_rng(seed)
    lenses = [
        {},
        {"distortion": BARREL},
        {"distortion": RATIONAL},
        {"distortion": FISHEYE, "fisheye": True},
    ]
    rig = Rig(
        tuple(
            look_at(
                f"c{i}",
                rng.normal(size=3) * 2,
                rng.normal(size=3),
                tuple(rng.integers(30, 90, 2)),
                rng.uniform(20, 120),
                **lens,
            )
            for i, lens in enumerate(rng.choice(lenses, 5))
        )
    )
    masks = []
    for camera in rig:
        noise = cv2.GaussianBlur(
            rng.normal(size=(camera.size[1], camera.size[0])),
            None,
            sigmaX=float(rng.choice([0.5, 4.0, 15.0])),
        )
        masks.append(noise > np.quantile(noise, rng.choice([0.02, 0.5, 0.9])))
    grid = VoxelGrid(rng.normal(size=3) - 1.5, 0.05, tuple(rng.integers(1, 70, 3)))
    for rule in (CarveRule(), CarveRule(2, "keep", 0), CarveRule(1, "carve", 3)):
        np.testing.assert_array_equal(
            carve(rig, masks, grid, rule), carve_by_reference(rig, masks, grid, rule)
        )


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


def test_the_reference_projects_as_the_camera_does():
    for lens in (
        {},
        {"distortion": BARREL},
        {"distortion": TILT},
        {"distortion": FISHEYE, "fisheye": True},
    ):
        rig = ring(1, **lens)
        (camera,) = rig
        points = WIDE.centres(np.argwhere(np.ones(WIDE.shape)))
        pixels, _ = camera.project(points)
        with np.errstate(invalid="ignore"):
            inside = ((pixels > -0.5) & (pixels < np.array(camera.size) - 0.5)).all(axis=1)
        pixels = np.rint(pixels[inside]).astype(int)
        mask = np.random.default_rng(0).random((camera.size[1], camera.size[0])) > 0.5
        carved = carve_by_reference(rig, [mask], WIDE)
        expected = np.zeros(len(points), bool)
        expected[inside] = mask[pixels[:, 1], pixels[:, 0]]
        np.testing.assert_array_equal(carved.ravel(), expected)


def test_the_number_of_threads_does_not_matter():
    rig = ring(5)
    masks = silhouettes(rig)
    results = []
    for threads in (1, 2):
        set_threads(threads)
        results.append(carve(rig, masks, PERSON))
    set_threads()
    np.testing.assert_array_equal(*results)


def test_a_bad_camera_is_tolerated():
    rig = ring(6)
    masks = silhouettes(rig)
    good = carve(rig, masks, PERSON)
    masks["cam_2"] = np.zeros_like(masks["cam_2"])
    assert not carve(rig, masks, PERSON).any()
    tolerant = carve(rig, masks, PERSON, CarveRule(tolerance=1))
    assert tolerant[good].all()
    assert tolerant.sum() < 2 * good.sum()


def test_what_no_camera_sees_is_kept_only_if_asked():
    rig = ring(2)
    masks = {name: np.ones((120, 160), bool) for name in rig.names}
    above = VoxelGrid(np.array([0, 0, 50.0]), 0.1, (4, 4, 4))
    assert not carve(rig, masks, above).any()
    assert carve(rig, masks, above, CarveRule(least_agreeing=0)).all()
    assert not carve(rig, masks, above, CarveRule(outside="carve", least_agreeing=0)).any()


def test_what_stands_in_front_of_one_camera_only_is_no_body():
    rig = ring(4)
    masks = {name: np.ones((120, 160), bool) for name in rig.names}
    centre, forward = rig["cam_0"].center_m, rig["cam_0"].rotation[2]
    behind = VoxelGrid(centre + 7.0 * forward - 0.3, 0.1, (6, 6, 6))  # behind the others' backs
    assert not carve(rig, masks, behind).any()
    assert carve(rig, masks, behind, CarveRule(least_agreeing=1)).any()
    middle = VoxelGrid(np.array([-0.3, -0.3, 0.6]), 0.1, (6, 6, 6))
    away = Rig((*ring(4), look_at("away", (0, -9, 1), (0, -20, 1))))
    assert carve(away, [*masks.values(), masks["cam_0"]], middle).all()
    assert not carve(
        away, [*masks.values(), masks["cam_0"]], middle, CarveRule(outside="carve")
    ).any()


@pytest.mark.parametrize(
    ("seeing", "others", "tolerance", "kept"),
    [
        (3, 1, 0, True),
        (2, 2, 0, False),
        (2, 2, 1, True),
        (1, 3, 1, False),
        (3, 3, 0, False),
        (3, 3, 1, True),
        (1, 1, 0, True),
        (0, 1, 3, False),
    ],
)
def test_three_quarters_of_the_cameras_agree_less_the_tolerance(seeing, others, tolerance, kept):
    """The others look away, and see nothing of the volume."""
    away = [look_at(f"away_{k}", (0, -9, 1 + k), (0, -20, 1)) for k in range(others)]
    rig = Rig((*(ring(seeing) if seeing else ()), *away))
    masks = {name: np.ones((120, 160), bool) for name in rig.names}
    middle = VoxelGrid(np.array([-0.2, -0.2, 0.7]), 0.1, (4, 4, 4))
    assert carve(rig, masks, middle, CarveRule(tolerance)).all() == kept


def test_masks_that_do_not_fit_are_refused():
    rig = ring(2)
    masks = silhouettes(rig)
    with pytest.raises(
        ValueError,
        match=r"mask of cam_1 must be \(120, 160\) bool, got \(60, 80\)",
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


@pytest.mark.parametrize("fields", [{"tolerance": -1}, {"outside": "drop"}, {"least_agreeing": -1}])
def test_impossible_rules_are_refused(fields):
    with pytest.raises(ValueError, match="must be"):
        CarveRule(**fields)
