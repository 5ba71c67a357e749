import shutil

import cv2
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from calib.errors import InputError
from calib.files import write_rig
from tests.voxelpose.multiview.carving.carving_scenes import ring, silhouettes
from voxelpose.hull import CarveSettings, carve_recording
from voxelpose.multiview.carving.carver import CarveRule
from voxelpose.multiview.carving.hull_mesh import surface


@pytest.fixture
def recording(tmp_path):
    """A recording of two frames of given silhouettes; nobody is in the second."""
    rig = ring(4)
    folder = tmp_path / "recording"
    for name, mask in silhouettes(rig).items():
        (folder / "masks" / name).mkdir(parents=True)
        cv2.imwrite(str(folder / "masks" / name / "0.png"), mask * np.uint8(255))
        cv2.imwrite(str(folder / "masks" / name / "1.png"), mask * np.uint8(0))
    (folder / "timestamps.csv").write_text(
        "cam_id,frame_time\n" + "".join(f"{name},{t}\n" for name in rig.names for t in (0.0, 0.1))
    )
    write_rig(rig, folder / "calibration.toml")
    return folder


def test_a_frame_becomes_a_mesh(recording, tmp_path):
    out = tmp_path / "hull.ply"
    hull = carve_recording(recording, out, CarveSettings(voxel_size_m=0.03))
    mesh = trimesh.load(out)
    assert mesh.volume * 1000 == pytest.approx(hull.volume_l, rel=0.1)
    np.testing.assert_allclose(mesh.bounds[:, 2], [0.04, 1.77], atol=0.06)


def test_mistakes_leave_nothing_behind(recording, tmp_path):
    out = tmp_path / "hull.ply"
    for settings, message in [
        (CarveSettings(frame=1), r"no foreground in any camera"),
        (CarveSettings(frame=7), r"frames 7:8 are not in the recording"),
        (CarveSettings(cameras=("cam_9",)), r"cam_9|no video"),
    ]:
        with pytest.raises(InputError, match=message):
            carve_recording(recording, out, settings)
    assert not out.exists()
    out.write_text("mine")
    with pytest.raises(InputError, match=r"exists: .*--overwrite"):
        carve_recording(recording, out)
    assert out.read_text() == "mine"
    carve_recording(recording, out, overwrite=True)
    assert trimesh.load(out).faces.shape[0] > 1000
    for fields in ({"frame": -1}, {"voxel_size_m": 0.0}):
        with pytest.raises(InputError, match="impossible"):
            CarveSettings(**fields)


def test_dancer8_is_the_body_that_was_published_with_it(shared, tmp_path):
    source = shared / "data" / "dancer8"
    folder = tmp_path / "dancer8"
    for i, file in enumerate(sorted(source.glob("silh_cam0*.pbm"))):
        (folder / "masks" / f"cam_{i}").mkdir(parents=True)
        shutil.copy(file, folder / "masks" / f"cam_{i}")
    shutil.copy(source / "projections.json", folder / "calibration.json")
    hull = carve_recording(folder, settings=CarveSettings(voxel_size_m=0.009))
    assert hull.volume_l == pytest.approx(96.9, rel=0.06)  # 129,257 of 10^8 voxels in 5 x 6 x 2.5 m
    published = trimesh.load(source / "surfacePtCloud.ply").vertices
    vertices, _ = surface(hull.grid, hull.occupancy)
    assert np.quantile(cKDTree(vertices).query(published)[0], 0.99) < 0.016
    # Only part of the skin was published (3,149 points), but every side of it except the top of the
    # head.
    np.testing.assert_allclose(published.min(axis=0)[:2], vertices.min(axis=0)[:2], atol=0.02)
    np.testing.assert_allclose(published.max(axis=0)[:2], vertices.max(axis=0)[:2], atol=0.02)


def test_the_hull_of_walk4_can_be_printed(shared, tmp_path):
    carve_recording(shared / "data" / "walk4", tmp_path / "hull.ply")
    mesh = trimesh.load(tmp_path / "hull.ply")
    assert mesh.is_watertight and mesh.is_volume


def test_standing4_is_a_man_and_a_board(standing4):
    settings = CarveSettings(voxel_size_m=0.02, rule=CarveRule(tolerance=0))
    hull = carve_recording(standing4, settings=settings)
    assert hull.without_background == ()
    points = hull.grid.occupied_points(hull.occupancy)
    # The board lies in the plane z = 0 of this world, whose z points down.
    aside = points[:, 1] > 0.1
    man = points[aside] if aside.mean() < 0.5 else points[points[:, 1] < 0.1]
    assert 1.6 < -points[:, 2].min() < 1.9
    assert len(man) * 0.02**3 * 1000 > 50
