import numpy as np
import pytest
from carving_scenes import any_camera, figure_points, look_at, ring, silhouettes
from scipy.spatial.transform import Rotation

from calib.camera import Camera, Rig
from calib.errors import InputError
from voxelpose.multiview.carving.bounds import (
    _dilated,
    _outline,
    _pyramid,
    _shrink,
    grid_within,
    place_grid,
)
from voxelpose.multiview.carving.carver import CarveRule, carve
from voxelpose.multiview.carving.grid import VoxelGrid

BARREL = (-0.3, 0.12, -0.002, 0.003, -0.01)


@pytest.mark.parametrize("lens", [{}, {"distortion": BARREL}], ids=["pinhole", "barrel"])
def test_the_box_holds_the_whole_hull_and_little_more(lens):
    rig = ring(4, **lens)
    masks = silhouettes(rig)
    size = 0.03
    grid = place_grid(rig, masks, voxel_size_m=size)
    everywhere = VoxelGrid.from_bounds((-2, -2, -1), (2, 2, 3), size)
    hull = everywhere.occupied_points(carve(rig, masks, everywhere, CarveRule(least_agreeing=4)))
    low, high = grid.origin_m, grid.origin_m + grid.size_m
    assert (hull.min(axis=0) > low).all() and (hull.max(axis=0) < high).all()
    assert (hull.min(axis=0) - low < 0.15).all() and (high - hull.max(axis=0) < 0.15).all()


@pytest.mark.parametrize("seed", range(12))
def test_a_pyramid_holds_every_pixel_of_its_silhouette_under_any_lens(seed):
    rng = np.random.default_rng(seed)
    camera = any_camera(rng, "any", rng.normal(size=3), rng.normal(size=3))
    mask = np.zeros(camera.size[::-1], bool)
    row, column = rng.integers(0, 24, 2)
    mask[row : row + 12, column : column + 9] = rng.random(mask.shape)[:12, :9] < 0.2
    outline = _outline(mask.view(np.uint8))
    corners = np.argwhere(mask)[:, None, ::-1] + 0.5 * np.array(
        [[-1, -1], [-1, 1], [1, -1], [1, 1]]
    )
    origin, rays = camera.rays(corners.reshape(-1, 2))
    planes = _pyramid(camera, outline)
    seen = np.isfinite(rays).all(axis=1)
    assert planes is not None and seen.any()
    places = origin + rng.uniform(0.1, 9, (seen.sum(), 1)) * rays[seen]
    assert (places @ planes[:, :3].T + planes[:, 3] < 1e-3).all()
    # And all pixels of its border touch the pyramid.
    assert (np.abs(places @ planes[:, :3].T + planes[:, 3]).min(axis=0) < 1e-3).all()


@pytest.mark.parametrize("seed", range(12))
def test_a_widened_silhouette_holds_the_middle_of_every_voxel_that_it_shows_a_point_of(seed):
    rng = np.random.default_rng(seed)
    turn = Rotation.random(random_state=seed).as_matrix()
    matrix = np.array([[2000.0, 0, 399.5], [0, 2000, 319.5], [0, 0, 1]])
    grid = VoxelGrid(rng.normal(size=3), 0.03, (6, 7, 5))
    middle = grid.origin_m + 0.5 * grid.size_m
    camera = Camera("c", (800, 640), matrix, np.zeros(0), turn, [0, 0, 3.0] - turn @ middle)
    centres = grid.centres(np.argwhere(np.ones(grid.shape)))
    corners = 0.499 * grid.voxel_size_m * (2 * np.array(list(np.ndindex(2, 2, 2))) - 1)
    shown = np.rint(camera.project((centres[:, None] + corners).reshape(-1, 3))[0]).astype(int)
    middles = np.repeat(np.rint(camera.project(centres)[0]).astype(int), 8, axis=0)
    for k in np.abs(shown - middles).max(axis=1).argsort()[-5:]:
        mask = np.zeros((640, 800), np.uint8)
        mask[shown[k, 1], shown[k, 0]] = 1
        assert _dilated(camera, mask, grid)[middles[k, 1], middles[k, 0]]


@pytest.mark.parametrize("reach_m", [2.5, 12.0, 60.0])
def test_a_box_is_shrunk_until_it_hardly_shrinks(reach_m):
    """Where it began makes no difference."""
    rig, rule = ring(4), CarveRule()
    masks = [mask.view(np.uint8) for mask in silhouettes(rig).values()]
    begun = np.array([-1.0, -0.8, -0.7]) * reach_m, np.array([0.9, 1.0, 1.1]) * reach_m
    low, high = _shrink(rig, masks, rule, begun, None)
    points = figure_points()
    assert (low < points.min(axis=0)).all() and (high > points.max(axis=0)).all()
    once_more = np.subtract(*_shrink(rig, masks, rule, (low, high), None)[::-1])
    assert once_more.prod() > 0.8 * (high - low).prod()


def test_the_resolution_divides_the_longest_edge():
    rig = ring(4)
    grid = place_grid(rig, silhouettes(rig), resolution=100)
    assert 100 <= max(grid.shape) <= 104


def test_the_margin_is_one_voxel():
    """Within it, the corners of grids of both sizes are the same corner, rounded down."""
    rig = ring(4)
    fine, coarse = (place_grid(rig, silhouettes(rig), voxel_size_m=size) for size in (0.02, 0.2))
    corner = (fine.origin_m + 0.02) / 0.2
    np.testing.assert_allclose(coarse.origin_m + 0.2, 0.2 * np.floor(corner + 1e-9))


def test_a_pole_thinner_than_the_voxels_of_the_search_is_held():
    rig = ring(4, size=(640, 480), focal=600.0)
    axis = np.arange(-0.2, 0.2, 0.01)
    ball = np.stack(np.meshgrid(axis, axis, axis), axis=-1).reshape(-1, 3)
    ball = ball[np.linalg.norm(ball, axis=1) < 0.2] + [0, 0, 1.3]
    along = np.arange(0.0, 1.1, 0.004)
    pole = np.column_stack([along, 0 * along, 1.3 + 0.1 * along])
    grid = place_grid(rig, silhouettes(rig, np.concatenate([ball, pole])), voxel_size_m=0.01)
    assert grid.origin_m[0] + grid.size_m[0] > 1.1


def test_a_cut_off_silhouette_does_not_cut_off_the_body():
    near = look_at("near", (1.3, 0.4, 1.5), (0, 0, 1.5))  # sees head and chest only
    rig = Rig((*ring(3), near))
    masks = silhouettes(rig)
    assert masks["near"][-1].any()
    grid = place_grid(rig, masks, voxel_size_m=0.03)
    points = figure_points()
    assert (grid.origin_m < points.min(axis=0)).all()
    assert (grid.origin_m + grid.size_m > points.max(axis=0)).all()


def test_one_bad_camera_neither_shrinks_nor_empties_a_tolerant_box():
    rig = ring(5)
    masks = silhouettes(rig)
    good = place_grid(rig, masks, voxel_size_m=0.03)
    corner = np.zeros((120, 160), bool)
    corner[:9, :9] = True
    for bad in (np.zeros((120, 160), bool), np.eye(120, 160, dtype=bool), corner):
        grid = place_grid(
            rig, {**masks, "cam_1": bad}, voxel_size_m=0.03, rule=CarveRule(tolerance=1)
        )
        assert (grid.origin_m <= good.origin_m + 0.031).all()
        assert (grid.origin_m + grid.size_m >= good.origin_m + good.size_m - 0.031).all()


@pytest.mark.parametrize(
    ("aside_m", "voxel_m", "refusal"), [(1.2, 0.05, "do not bound"), (0.45, 0.02, "too many")]
)
def test_somebody_who_walks_before_cameras_side_by_side_is_bounded_moment_by_moment(
    aside_m, voxel_m, refusal
):
    rig = Rig(tuple(look_at(f"cam_{k}", (x, -4, 1), (0, 0, 1)) for k, x in enumerate((-1, 1))))
    walk = [figure_points() + np.array([x, 0, 0]) for x in np.linspace(-aside_m, aside_m, 7)]
    moments = [silhouettes(rig, points) for points in walk]
    union = {name: np.logical_or.reduce([one[name] for one in moments]) for name in rig.names}
    with pytest.raises(InputError, match=refusal):
        place_grid(rig, union, voxel_size_m=voxel_m)
    grid = place_grid(rig, union, voxel_size_m=voxel_m, moments=moments)
    points = np.concatenate(walk)
    assert (grid.origin_m < points.min(axis=0)).all()
    assert (grid.origin_m + grid.size_m > points.max(axis=0)).all()
    assert (grid.size_m < 8).all()


def test_errors_name_cameras_and_remedy():
    rig = ring(4)
    masks = silhouettes(rig)
    nothing = np.zeros((120, 160), bool)
    with pytest.raises(InputError, match=r"no foreground in cam_2: .*--tolerance 1"):
        place_grid(rig, {**masks, "cam_2": nothing})
    with pytest.raises(InputError, match="no foreground in any camera"):
        place_grid(rig, dict.fromkeys(rig.names, nothing))
    away = Rig((*rig, look_at("away", (5, 0, 1), (10, 0, 1))))
    with pytest.raises(InputError, match=r"no common volume \(cam_0 and away"):
        place_grid(away, {**masks, "away": np.ones((120, 160), bool)})
    corner = nothing.copy()
    corner[:9, :9] = True
    with pytest.raises(InputError, match="meet nowhere"):
        place_grid(rig, {**masks, "cam_0": corner})
    one = ring(1)
    with pytest.raises(InputError, match="do not bound a volume"):
        place_grid(one, {"cam_0": masks["cam_0"]})


def test_a_volume_that_cannot_be_is_refused():
    with pytest.raises(InputError, match=r"too many for memory: choose at least 0\.00"):
        grid_within(np.zeros(3), np.full(3, 4.0), 0.001)
    with pytest.raises(InputError, match="is empty"):
        grid_within(np.zeros(3), np.array([1, 1, -1.0]), 0.1)
