import sys

import numpy as np
import pytest

from calib.errors import InputError
from voxelpose.multiview.carving.grid import VoxelGrid
from voxelpose.view.images.hull_picture import Skeleton, hull_picture, show_hull
from voxelpose.view.open3d_import import import_open3d

GRID = VoxelGrid.from_bounds((-0.5, -0.2, 0), (0.5, 0.2, 1.8), 0.04)


def body() -> np.ndarray:
    """A slab that is wider along x than along y."""
    occupancy = np.zeros(GRID.shape, bool)
    occupancy[2:-2, 3:-3, 2:-2] = True
    return occupancy


def test_a_picture_shows_the_body_from_every_side():
    picture = hull_picture(GRID, body(), azimuths_deg=(-90, 0))
    assert picture.shape == (720, 960, 3)
    dark = (picture != picture[0, 0]).any(axis=2)
    front, side = dark[:, :480], dark[:, 480:]
    assert front.any(axis=0).sum() > 2.5 * side.any(axis=0).sum() > 0
    assert not dark[[0, -1]].any() and not front[:, [0, -1]].any()
    assert front.any(axis=1).sum() == pytest.approx(648, abs=72)


def test_a_skeleton_is_drawn_where_it_is_known():
    skeleton = Skeleton(
        np.array([[0, 0, 0.3], [0, 0, 1.5], [np.nan] * 3]), np.array([[0, 1], [1, 2]])
    )
    plain, drawn = (hull_picture(GRID, body(), bones, (-90,)) for bones in (None, skeleton))
    changed = (plain != drawn).any(axis=2)
    assert changed[:, 235:245].sum() > 240
    assert not changed[:, :232].any() and not changed[:, 248:].any()


def test_open3d_can_be_imported_on_a_bare_machine():
    pytest.importorskip("libusb_package")
    assert hasattr(import_open3d(), "geometry")


@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="only Linux has machines without a screen"
)
def test_a_window_without_a_screen_is_refused(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(InputError, match=r"no screen .*--png FILE"):
        show_hull(GRID, body(), None, "title")


def test_a_missing_open3d_is_said_with_the_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(InputError, match=r"open3d is not installed .*pip install"):
        import_open3d()
