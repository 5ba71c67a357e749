"""MPI-INF-3DHP: camera.calibration, imageSequence, annot.mat."""

import numpy as np
import pytest
from scipy.io import savemat

from tests.datasets import miniatures as mini

ROWS = (4, 18, 19, 20, 23, 24, 25, 5, 7, 9, 10, 11, 14, 15, 16)
PLACES = dict(zip(mini.FIGURE, ROWS, strict=True))
Z_UP_FROM_Y_UP = np.array([[1, 0, 0], [0, 0, -1.0], [0, 1, 0]])
K = np.array([[60.0, 0, 30.5], [0, 61.0, 25.0], [0, 0, 1]])
CLIP = ("--subject", "S1", "--sequence", "Seq1")


def native(number: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotation and translation, mm, from a world whose y points up."""
    rotation, translation = mini.looking(number)
    return rotation @ Z_UP_FROM_Y_UP, 1000 * translation


def formula(number: int) -> np.ndarray:
    points_mm = 1000 * mini.POINTS @ Z_UP_FROM_Y_UP  # (x, z, -y)
    np.testing.assert_allclose(points_mm[7], [0, 1480, -30])
    rotation, translation = native(number)
    seen = points_mm @ rotation.T + translation
    return seen[:, :2] / seen[:, 2:] * (60.0, 61.0) + (30.5, 25.0)


def block(number: int) -> str:
    (width, height), (rotation, translation) = mini.SIZE, native(number)
    intrinsic, extrinsic = np.eye(4), np.eye(4)
    intrinsic[:3, :3], extrinsic[:3] = K, np.column_stack([rotation, translation])
    flat = [" ".join(f"{v:.9g}" for v in one.ravel()) for one in (intrinsic, extrinsic)]
    return (
        f"name          {number}\n  sensor      10 10\n  size        {width} {height}\n"
        f"  animated    0\n  intrinsic   {flat[0]} \n  extrinsic   {flat[1]} \n  radial      0\n"
    )


@pytest.fixture
def source(tmp_path):
    folder = tmp_path / "mpi" / "S1" / "Seq1"
    cells = np.empty((3, 1), object)
    for number in range(3):
        rotation, translation = native(number)
        table = np.zeros((mini.FRAMES, 28, 3))
        for frame in range(mini.FRAMES):
            for name, place in PLACES.items():
                world = 1000 * mini.moving(frame)[name] @ Z_UP_FROM_Y_UP
                table[frame, place] = rotation @ world + translation
        cells[number, 0] = table.reshape(mini.FRAMES, 84)
    for number in (0, 2):
        mini.write_video(folder / "imageSequence" / f"video_{number}.avi", fps=25)
    (folder / "camera.calibration").write_text(
        "Skeletool Camera Calibration File V1.0\n" + "".join(map(block, range(3)))
    )
    savemat(folder / "annot.mat", {"annot3": cells, "frames": np.arange(mini.FRAMES)[:, None]})
    return tmp_path / "mpi"


def test_pixels_and_truth(source, tmp_path, convert):
    out = tmp_path / "out"
    convert("mpi_inf_3dhp", source, out, *CLIP)
    recording = mini.opened(out, {"cam_0": formula(0), "cam_2": formula(2)})
    assert recording.fps == pytest.approx(25)
    assert (out / "cam_0.avi").is_file()
    mini.checked_truth(out, mini.truth_of())


def test_extracted_frames(source, tmp_path, convert, refuse):
    folder = source / "S1" / "Seq1" / "imageSequence"
    for number in (0, 2):
        (folder / f"video_{number}.avi").unlink()
        mini.write_images(folder / f"video_{number}", name="frame_{:06d}.jpg", first=1)
    assert "--fps" in refuse("mpi_inf_3dhp", source, tmp_path / "out", *CLIP)
    convert("mpi_inf_3dhp", source, tmp_path / "out", *CLIP, "--fps", 50)
    recording = mini.opened(tmp_path / "out", {"cam_0": formula(0), "cam_2": formula(2)})
    assert recording.fps == pytest.approx(50, rel=1e-4)


def test_mistakes(source, tmp_path, refuse):
    out, folder = tmp_path / "out", source / "S1" / "Seq1"
    assert "it has S1" in refuse("mpi_inf_3dhp", source, out, *CLIP, "--subject", "S2")
    text = (folder / "camera.calibration").read_text()
    (folder / "camera.calibration").write_text(text[: text.rindex("extrinsic") + 60])
    assert "extrinsic of camera 2" in refuse("mpi_inf_3dhp", source, out, *CLIP)
    other = text.replace("name          2", "name          7")
    (folder / "camera.calibration").write_text(other)
    assert "there is no camera '2'" in refuse("mpi_inf_3dhp", source, out, *CLIP)
    (folder / "camera.calibration").write_text(text)
    (folder / "annot.mat").write_bytes((folder / "annot.mat").read_bytes()[:300])
    assert "annot3 cannot be read" in refuse("mpi_inf_3dhp", source, out, *CLIP)
    (folder / "annot.mat").unlink()
    assert "annot.mat is missing" in refuse("mpi_inf_3dhp", source, out, *CLIP)


def test_truth_of_another_sequence(source, tmp_path, refuse):
    folder = source / "S1" / "Seq1"
    text = (folder / "camera.calibration").read_text()
    other = block(1).replace("name          1", "name          2")
    (folder / "camera.calibration").write_text(text.split("name          2")[0] + other)
    assert "different sequences?" in refuse("mpi_inf_3dhp", source, tmp_path / "out", *CLIP)
