"""Part-number images against the NumPy reference, ray casting, and at their edges."""

import cv2
import numpy as np
import pytest
import trimesh

from silhouette_core import jit
from silhouette_core.image.raster import NEAR_M, render_many, render_parts

MATRIX = np.array([[120.0, 0, 79.3], [0, 118.0, 60.1], [0, 0, 1]])
SIZE = (160, 120)


def blobs(seed=0):
    """Three overlapping closed bodies in front of the camera."""
    rng = np.random.default_rng(seed)
    meshes, parts = [], []
    for part in range(3):
        mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
        mesh.apply_scale(rng.uniform(0.5, 1.3, 3))
        mesh.apply_translation([*rng.uniform(-0.7, 0.7, 2), rng.uniform(2.0, 3.0)])
        meshes.append(mesh)
        parts += [part] * len(mesh.faces)
    whole = trimesh.util.concatenate(meshes)
    return (
        np.asarray(whole.vertices, np.float64),
        np.asarray(whole.faces, np.int32),
        np.array(parts, np.int32),
    )


def ray_distances(rays, a, b, c):
    """Distances along rays from the origin to one triangle, infinite where missed (Moeller and
    Trumbore).
    """
    across = np.cross(rays, c - a)
    determinant = across @ (b - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = across @ -a / determinant
        v = rays @ np.cross(-a, b - a) / determinant
        hit = (u >= 0) & (v >= 0) & (u + v <= 1)
        return np.where(hit, (c - a) @ np.cross(-a, b - a) / determinant, np.inf)


def test_agrees_with_ray_casting_away_from_the_outlines():
    vertices, faces, part = blobs(5)
    parts, depth = render_parts(vertices, faces, part, MATRIX, SIZE)
    x, y = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    rays = np.stack([x, y, np.ones(x.shape)], -1).reshape(-1, 3) @ np.linalg.inv(MATRIX).T
    distance = np.stack([ray_distances(rays, *vertices[face]) for face in faces])
    cast_depth = distance.min(0).reshape(parts.shape)
    nearest = part[distance.argmin(0)].reshape(parts.shape)
    expected = np.where(np.isfinite(cast_depth), nearest + 1, 0).astype(np.uint8)
    # A pixel beside another label may fall to either side by the 1/256 pixel rounding.
    kernel = np.ones((3, 3), np.uint8)
    band = cv2.dilate(expected, kernel) != cv2.erode(expected, kernel)
    np.testing.assert_array_equal(parts[~band], expected[~band])
    assert (parts != expected).mean() < 2e-3
    inner = ~band & (parts > 0)
    np.testing.assert_allclose(depth[inner], cast_depth[inner], atol=0.02)


def times_drawn(vertices, faces, size):
    """How often every pixel is drawn where each face is drawn alone."""
    part = np.zeros(1, np.int32)
    return sum(
        render_parts(vertices, face[None], part, np.eye(3), size)[0].astype(int) for face in faces
    )


def test_shared_edges_are_drawn_once():
    """A fan around a pixel centre, with corners on pixel centres: the pieces tile the square
    exactly.
    """
    ring = np.array(
        [[10, 10], [20, 10], [30, 10], [30, 20], [30, 30], [20, 30], [10, 30], [10, 20]], float
    )
    pixels = np.vstack([[20.0, 20.0], ring])
    vertices = np.column_stack([pixels, np.ones(9)])
    faces = np.array([[0, i, i % 8 + 1] for i in range(1, 9)], np.int32)
    expected = np.zeros((40, 40), int)
    # Left and top edges belong to the square, right and bottom ones do not.
    expected[10:30, 10:30] = 1
    np.testing.assert_array_equal(times_drawn(vertices, faces, (40, 40)), expected)


def test_random_fans_tile_without_gaps_or_doubles():
    rng = np.random.default_rng(3)
    angles = np.sort(rng.uniform(0, 2 * np.pi, 12))
    ring = 50 + 45 * np.column_stack([np.cos(angles), np.sin(angles)])
    pixels = np.vstack([[50.3, 48.9], ring])
    vertices = np.column_stack([pixels, np.ones(13)]) * rng.uniform(1, 4, (13, 1))
    faces = np.array([[0, i, i % 12 + 1] for i in range(1, 13)], np.int32)
    whole = render_parts(vertices, faces, np.zeros(12, np.int32), np.eye(3), (100, 100))[0]
    np.testing.assert_array_equal(times_drawn(vertices, faces, (100, 100)), whole)


def test_triangle_through_the_near_plane_is_clipped():
    """A floor under the camera that reaches behind it fills the lower half of the image and nothing
    above the horizon.
    """
    vertices = np.array([[-50.0, 1, -20], [50, 1, -20], [50, 1, 400], [-50, 1, 400]])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    matrix = np.array([[50.0, 0, 49.5], [0, 50, 49.5], [0, 0, 1]])
    parts, depth = render_parts(vertices, faces, np.array([0, 1], np.int32), matrix, (100, 100))
    assert (parts[50:, 30:70] > 0).all()
    assert not parts[:50].any()
    np.testing.assert_allclose(depth[99, 30:70], 50 / 49.5, rtol=1e-4)
    behind = vertices - [0, 0, 400 - NEAR_M / 2]
    assert not render_parts(behind, faces, np.zeros(2, np.int32), matrix, (100, 100))[0].any()


def test_faces_with_corners_that_are_not_finite_are_omitted():
    vertices, faces, part = blobs()
    vertices[faces[0, 0]] = np.nan
    parts, _ = render_parts(vertices, faces, part, MATRIX, SIZE)
    kept = ~(faces == faces[0, 0]).any(1)
    vertices[faces[0, 0]] = 1.0
    expected = render_parts(vertices, faces[kept], part[kept], MATRIX, SIZE)[0]
    np.testing.assert_array_equal(parts, expected)


SKEWED = np.array([[50.0, 9, 49.5], [0, 48, 49.5], [0, 0, 1]])


def fan(count: int, near_m: float) -> tuple[np.ndarray, np.ndarray]:
    """A floor of triangles about the point below the camera, from behind it to far in front."""
    angles = 2 * np.pi * (np.arange(count) + 0.3) / count
    ring = np.column_stack([30 * np.sin(angles), np.full(count, 1.0), 30 * np.cos(angles)])
    corners = np.vstack([[0.0, 1.0, near_m], ring])
    return corners, np.array([[0, i, i % count + 1] for i in range(1, count + 1)], np.int32)


@pytest.mark.parametrize("near_m", [-0.5, 0.5])
def test_skew_counts_in_whole_and_in_clipped_triangles(near_m):
    vertices, faces = fan(7, near_m)
    parts, depth = render_parts(vertices, faces, np.arange(7, dtype=np.int32), SKEWED, (100, 100))
    rows, columns = np.nonzero(parts)
    assert len(rows) > 2000
    ray = np.column_stack([columns, rows, np.ones(len(rows))]) @ np.linalg.inv(SKEWED).T
    point = ray / ray[:, 1:2]  # the floor is 1 m below
    np.testing.assert_allclose(depth[rows, columns], point[:, 2], rtol=0.02)
    angle = np.arctan2(point[:, 0], point[:, 2] - near_m)
    expected = np.floor(((angle / (2 * np.pi)) * 7 - 0.3) % 7).astype(int)
    assert (parts[rows, columns] == expected + 1).mean() > 0.97


def triangles(faces, part, **options):
    """Part numbers of faces of three corners."""
    corners = np.array([[0.0, 0, 2], [8, 0, 2], [0, 8, 2]])
    arrays = corners, np.array(faces, np.int32), np.array(part, np.int32)
    return render_parts(*arrays, np.diag([5.0, 5, 1]), (30, 30), **options)[0]


def test_of_equally_near_faces_the_first_is_kept():
    for order in ([4, 7, 2], [7, 2, 4]):
        assert set(np.unique(triangles([[0, 1, 2]] * 3, order))) == {0, order[0] + 1}


def test_culling_leaves_the_sides_that_face_the_camera():
    """Normals point outward by the right-hand rule."""
    assert triangles([[0, 2, 1]], [0], cull_back=True).any()
    assert not triangles([[0, 1, 2]], [0], cull_back=True).any()


def test_many_poses_are_each_as_alone_for_any_thread_count():
    vertices, faces, part = blobs()
    poses = (vertices + np.linspace(-0.3, 0.3, 5)[:, None, None] * [1, 0.5, 1]).astype(np.float32)
    alone = np.stack(
        [render_parts(pose, faces, part, MATRIX, SIZE, cull_back=True)[0] for pose in poses]
    )
    for threads in (1, 2):
        jit.set_threads(threads)
        np.testing.assert_array_equal(render_many(poses, faces, part, MATRIX, SIZE), alone)
    jit.set_threads()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"vertices_cam": np.zeros((4, 2))}, "vertices_cam must be"),
        ({"faces": np.zeros((4, 4), int)}, "faces must be"),
        ({"faces": np.full((1, 3), 99)}, "faces must index 4"),
        ({"face_part": np.zeros(2, int)}, "face_part must be"),
        ({"face_part": np.full(1, 255)}, "face_part must be 0 to 254"),
        ({"matrix": np.eye(4)}, "matrix must be"),
        ({"size": (0, 5)}, "size must be"),
    ],
)
def test_wrong_arguments_are_refused(change, words):
    good = {"vertices_cam": np.zeros((4, 3)), "faces": np.zeros((1, 3), int)}
    good |= {"face_part": np.zeros(1, int), "matrix": np.eye(3), "size": (8, 8)}
    with pytest.raises(ValueError, match=words):
        render_parts(**{**good, **change})
