import numpy as np
import pytest
import trimesh
from carving_scenes import figure_points

from calib.errors import InputError
from tests.voxelpose.multiview.carving.carving_scenes import voxels_at
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.multiview.carving.hull_mesh import surface, write_ply


@pytest.fixture
def figure() -> tuple[VoxelGrid, np.ndarray]:
    grid = VoxelGrid.from_bounds((-0.3, -0.3, 0), (0.9, 0.3, 1.9), 0.02)
    occupancy = np.zeros(grid.shape, bool)
    occupancy[tuple(voxels_at(grid, figure_points()).T)] = True
    return grid, occupancy


def test_the_surface_is_closed_and_faces_outward(figure):
    grid, occupancy = figure
    vertices, faces = surface(grid, occupancy)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there = np.sort(edges @ [len(vertices), 1])
    back = np.sort(edges[:, ::-1] @ [len(vertices), 1])
    np.testing.assert_array_equal(there, back)
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(
        occupancy.sum() * 0.02**3, rel=0.06
    )


def test_a_single_voxel_is_not_lost():
    grid = VoxelGrid(np.array([1.0, 2.0, 3.0]), 0.1, (3, 1, 2))
    occupancy = np.zeros(grid.shape, bool)
    occupancy[1, 0, 1] = True
    vertices, faces = surface(grid, occupancy)
    assert (len(vertices), len(faces)) == (8, 12)
    np.testing.assert_allclose(vertices.mean(axis=0), [1.15, 2.05, 3.15])
    assert trimesh.Trimesh(vertices, faces).is_watertight


def faces_at_edges(faces: np.ndarray) -> set[int]:
    """Numbers of faces that edges have."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return set(np.unique(edges, axis=0, return_counts=True)[1].tolist())


# Of the four middle voxels of 2 x 2 x 3 two, diagonally: alone, on a floor, and between two.
@pytest.mark.parametrize("layers", [(1,), (0, 1), (0, 1, 2)])
@pytest.mark.parametrize("exchanged", [False, True])
def test_voxels_that_touch_at_an_edge_leave_two_faces_at_each(layers, exchanged, tmp_path):
    grid = VoxelGrid(np.zeros(3), 0.1, (4, 4, 5))
    occupancy = np.zeros(grid.shape, bool)
    for layer in layers:
        occupancy[1:3, 1:3, 1 + layer] = np.eye(2) if layer == 1 else 1
    occupancy ^= exchanged  # the same about a hollow
    assert faces_at_edges(surface(grid, occupancy)[1]) == {2}
    write_ply(tmp_path / "hull.ply", grid, occupancy)
    mesh = trimesh.load(tmp_path / "hull.ply")  # puts vertices at one place together
    assert mesh.is_watertight and mesh.is_winding_consistent
    pieces = len(mesh.split(only_watertight=False))
    assert pieces == 1 + exchanged + (layers == (1,)), "two voxels that touch are two pieces"


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5, 0.7])
def test_the_surface_of_any_voxels_is_a_manifold(share, tmp_path):
    grid = VoxelGrid(np.zeros(3), 0.1, (14, 15, 16))
    occupancy = np.random.default_rng(0).random(grid.shape) < share
    vertices, faces = surface(grid, occupancy)
    assert faces_at_edges(faces) == {2}
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_winding_consistent
    # Around each vertex there is one ring of triangles.
    rings = trimesh.graph.connected_components(
        np.sort(_neighbouring_corners(faces), axis=1), nodes=np.arange(faces.size)
    )
    assert len(rings) == len(vertices) == len(np.unique(faces))


def _neighbouring_corners(faces: np.ndarray) -> np.ndarray:
    """Pairs of corners (3 f + i) of one vertex whose triangles share an edge."""
    corner = np.arange(faces.size).reshape(-1, 3)
    ends = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    at = corner[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    order = np.lexsort(np.sort(ends, axis=1).T)
    one, other = order[::2], order[1::2]
    return np.concatenate([np.stack([at[one, i], at[other, 1 - i]], axis=1) for i in (0, 1)])


def test_a_sphere_is_round():
    grid = VoxelGrid.from_bounds((-1, -1, -1), (1, 1, 1), 0.05)
    x, y, z = grid.axes()
    vertices, _ = surface(
        grid, x[:, None, None] ** 2 + y[None, :, None] ** 2 + z[None, None, :] ** 2 < 0.8**2
    )
    radii = np.linalg.norm(vertices, axis=1)
    assert np.abs(radii - 0.8).max() < 0.05
    assert radii.std() < 0.012


def test_the_written_mesh_reads_back(figure, tmp_path):
    path = tmp_path / "hull.ply"
    write_ply(path, *figure)
    mesh = trimesh.load(path)
    assert isinstance(mesh, trimesh.Trimesh)
    assert mesh.volume == pytest.approx(figure[1].sum() * 0.02**3, rel=0.06)
    assert [file.name for file in tmp_path.iterdir()] == ["hull.ply"]


def test_what_cannot_be_written_is_said(figure, tmp_path):
    with pytest.raises(InputError, match=r"hull\.ply cannot be written"):
        write_ply(tmp_path / "missing" / "hull.ply", *figure)
    grid, occupancy = figure
    with pytest.raises(ValueError, match="no voxel is occupied"):
        write_ply(tmp_path / "hull.ply", grid, np.zeros_like(occupancy))
    with pytest.raises(ValueError, match="occupancy must be"):
        surface(grid, occupancy[1:])
