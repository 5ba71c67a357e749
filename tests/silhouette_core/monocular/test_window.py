"""The virtual camera against the library's own pictures."""

import numpy as np
import pytest

from silhouette_core.monocular.tree.rendering import STATURE_PX, pose_surfaces, render_views
from silhouette_core.monocular.window import SIZE, look_at
from silhouette_core.motion.kinematics import rotation_matrices
from silhouette_core.motion.pose import Pose
from tests.silhouette_core.monocular.filming import STATURE_M, camera_at, silhouette, window_pixels

METRE_PX = STATURE_PX / STATURE_M
PLACES = [
    ((0, -4.0, 1.3), (0, 0)),
    ((0, -4.0, 1.3), (0.9, 0.1)),
    ((2.5, -3.5, 2.2), (-0.5, 0.3)),
    ((-3.6, 1.5, 0.7), (0.2, -0.4)),
]


def seen(place, ground, base, library, heading=0.5):
    """A library pose, turned, somewhere in a camera's picture; with the distance of the pelvis
    along the viewing ray.
    """
    camera = camera_at(place, size=(640, 480))
    half = heading / 2
    turn = rotation_matrices(np.array([[np.cos(half), 0, 0, np.sin(half)]]))[0]
    rotation = turn @ rotation_matrices(library.bases.quaternion[[base]].astype(float))[0]
    surface = pose_surfaces(
        library.model, library.bases.quaternion[[base]], library.bases.angles[[base]]
    )
    height_m = -float(surface[..., 2].min())
    pose = Pose(np.array([*ground, height_m]), rotation, library.bases.angles[base].astype(float))
    return camera, pose, silhouette(library.model, pose, camera)


@pytest.mark.parametrize(("place", "ground"), PLACES)
def test_a_pose_anywhere_looks_as_in_the_library(library, place, ground):
    base, heading = 17, 0.5
    camera, pose, mask = seen(place, ground, base, library, heading)
    distance = float(np.linalg.norm(pose.root_m - camera.center_m))
    window = look_at(camera, mask, distance, METRE_PX)
    rows, columns = np.nonzero(window.mask)
    assert (
        abs(columns.mean() - (SIZE[0] - 1) / 2) < 0.7 and abs(rows.mean() - (SIZE[1] - 1) / 2) < 0.7
    )
    yaw, pitch = heading - window.heading_rad, window.pitch_rad
    result = from_library(library, base, yaw, pitch)
    assert np.count_nonzero(window.mask) == pytest.approx(
        np.count_nonzero(result.windows), rel=0.03
    )
    # The centroid leaves a pixel open; the library sees from 4 m, where perspective is a little
    # different.
    assert overlap(result.windows[0] > 0, window.mask) > 0.93
    np.testing.assert_allclose(
        window_pixels(window, pose.root_m[None])[0], result.pelvis_px[0], atol=2.5
    )
    for wrong in (-0.3, 0.3):
        assert (
            overlap(from_library(library, base, yaw + wrong, pitch).windows[0] > 0, window.mask)
            < 0.9
        )


def from_library(library, base, yaw, pitch):
    surfaces = pose_surfaces(
        library.model, library.bases.quaternion[[base]], library.bases.angles[[base]]
    )
    return render_views(library.model, surfaces, np.zeros(1, int), np.array([[yaw, pitch]]))


def overlap(one, other):
    """Intersection over union, the best of shifts by a pixel."""
    moved = [np.roll(one, (down, right), (0, 1)) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    return max(np.count_nonzero(mask & other) / np.count_nonzero(mask | other) for mask in moved)


def test_place_and_pixels_invert_each_other(library):
    camera, _, mask = seen(*PLACES[2], 3, library)
    window = look_at(camera, mask, 4.1, METRE_PX)
    pixels = np.random.default_rng(0).uniform((0, 0), SIZE, (20, 2))
    points = window.unproject(pixels, 3.3)
    np.testing.assert_allclose(window_pixels(window, points), pixels, atol=1e-9)
    np.testing.assert_allclose((points - camera.center_m) @ window.world_from_virtual[:, 2], 3.3)


def test_a_place_of_the_world_is_the_same_pixel_of_the_camera(library):
    camera, _, mask = seen(*PLACES[1], 3, library)
    window = look_at(camera, mask, 4.0, METRE_PX)
    rays = window.unproject(np.array([[100.0, 80.0], [200.0, 150.0]]), 2.0)
    pixels, _ = camera.project(rays)
    inside = (pixels >= 1).all(1) & (pixels < np.array(camera.size) - 2).all(1)
    column, row = np.rint(pixels[inside]).astype(int).T
    back = window_pixels(window, rays[inside])
    near = window.mask[np.rint(back[:, 1]).astype(int), np.rint(back[:, 0]).astype(int)]
    assert inside.any() and (near == mask[row, column]).all()


def test_what_the_camera_does_not_show_is_not_seen(library):
    camera, _, mask = seen((0, -4.0, 1.3), (2.55, 0), 3, library)
    assert mask[:, -2:].any()  # the border cuts the person
    window = look_at(camera, mask, 4.4, METRE_PX)
    assert not window.seen.all() and window.seen.any()
    assert not (window.mask & ~window.seen).any()
    assert not window.seen[:, -30:].any()


def test_twice_as_far_looks_half_as_large(library):
    camera, _, mask = seen(*PLACES[0], 3, library)
    near, far = (look_at(camera, mask, distance, METRE_PX).mask for distance in (2.5, 5.0))
    assert np.count_nonzero(far) / np.count_nonzero(near) == pytest.approx(4.0, rel=0.03)


def test_an_empty_or_misshapen_mask_is_refused():
    camera = camera_at((0, -4, 1))
    with pytest.raises(ValueError, match="must not be empty"):
        look_at(camera, np.zeros(camera.size[::-1], bool), 4.0, METRE_PX)
    with pytest.raises(ValueError, match="mask must be"):
        look_at(camera, np.ones((10, 10), bool), 4.0, METRE_PX)
