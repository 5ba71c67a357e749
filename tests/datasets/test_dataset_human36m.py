"""Human3.6M: metadata.xml, Videos, D3_Positions."""

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from tests.datasets import miniatures as mini

NAMES = ("54138969", "55011271", "58860488", "60457274")
PLACES = dict(zip(mini.FIGURE, (0, 6, 7, 8, 1, 2, 3, 13, 15, 17, 18, 19, 25, 26, 27), strict=True))
# f, c, k and p, as metadata.xml has them; p is larger than the data set's, to be seen.
LENS = (70.0, 71.0, 31.0, 24.5, -0.2, 0.25, -0.01, -0.02, 0.015)
CLIP = ("--subject", "S9", "--sequence", "Walking 1")


def formula(number: int) -> np.ndarray:
    """ProjectPointRadial of the data set's code: mm, R (X - T)."""
    rotation, translation = mini.looking(number)
    centre_mm = 1000 * (-rotation.T @ translation)
    f, c, k, p = np.array(LENS[:2]), np.array(LENS[2:4]), LENS[4:7], LENS[7:]
    x = (1000 * mini.POINTS - centre_mm) @ rotation.T
    xx = x[:, :2] / x[:, 2:]
    r2 = (xx**2).sum(1)
    radial = 1 + k[0] * r2 + k[1] * r2**2 + k[2] * r2**3
    tangential = p[0] * xx[:, 1] + p[1] * xx[:, 0]
    bent = xx * (radial + tangential)[:, None] + np.outer(r2, [p[1], p[0]])
    return f * bent + c


@pytest.fixture
def source(tmp_path):
    folder = tmp_path / "h36m"
    w0 = np.zeros(4 * 66 + 36)
    for number in range(4):
        rotation, translation = mini.looking(number)
        # R = Rx Ry Rz is an intrinsic rotation about x, y, z.
        angles = Rotation.from_matrix(rotation).as_euler("XYZ")
        start = 6 * (11 * number + 8)
        w0[start : start + 6] = [*angles, *(1000 * (-rotation.T @ translation))]
        w0[264 + 9 * number : 273 + 9 * number] = LENS
        mini.write_video(folder / "S9" / "Videos" / f"Walking 1.{NAMES[number]}.mp4", fps=50)
    text = " ".join(repr(float(value)) for value in w0)
    (folder / "metadata.xml").write_text(f"<?xml version='1.0'?><a><w0>[{text}]</w0></a>")
    poses = np.zeros((mini.FRAMES, 32, 3))
    poses[:, list(PLACES.values())] = 1000 * mini.truth_of()
    truth = folder / "S9" / "MyPoseFeatures" / "D3_Positions"
    truth.mkdir(parents=True)
    cell = np.empty((1, 1), object)
    cell[0, 0] = poses.reshape(mini.FRAMES, 96)
    savemat(truth / "Walking 1.cdf.mat", {"data": cell})
    return folder


def test_pixels_and_truth(source, tmp_path, convert):
    out = tmp_path / "walk"
    assert "4 cameras, 6 frames" in convert("human36m", source, out, *CLIP)
    recording = mini.opened(out, {f"cam_{name}": formula(n) for n, name in enumerate(NAMES)})
    assert recording.fps == pytest.approx(50)
    mini.checked_truth(out, mini.truth_of())


def test_the_cdf_itself(source, tmp_path, convert):
    cdfwrite = pytest.importorskip("cdflib.cdfwrite", reason="needs cdflib")
    folder = source / "S9" / "MyPoseFeatures" / "D3_Positions"
    flat = np.zeros((mini.FRAMES, 96))
    flat.reshape(mini.FRAMES, 32, 3)[:, list(PLACES.values())] = 1000 * mini.truth_of()
    (folder / "Walking 1.cdf.mat").unlink()
    with cdfwrite.CDF(str(folder / "Walking 1.cdf")) as cdf:
        about = {"Variable": "Pose", "Data_Type": 45, "Num_Elements": 1, "Rec_Vary": True}
        cdf.write_var({**about, "Dim_Sizes": [mini.FRAMES, 96]}, var_data=flat[None])
    convert("human36m", source, tmp_path / "walk", *CLIP)
    mini.checked_truth(tmp_path / "walk", mini.truth_of())


def test_silhouettes(source, tmp_path, convert, refuse):
    assert "54138969.mat is missing" in refuse("human36m", source, tmp_path / "a", *CLIP, "--masks")
    h5py = pytest.importorskip("h5py", reason="needs h5py")
    folder = source / "S9" / "MySegmentsMat" / "ground_truth_bs"
    folder.mkdir(parents=True)
    for name in NAMES:
        with h5py.File(folder / f"Walking 1.{name}.mat", "w") as file:
            masks = file.create_dataset("Masks", (mini.FRAMES, 1), h5py.ref_dtype)
            for number in range(mini.FRAMES):
                mask = np.zeros((48, 64), np.uint8)
                mask[10:20, 5 + number : 9 + number] = 1
                masks[number, 0] = file.create_dataset(f"#refs#/{number}", data=mask.T).ref
    convert("human36m", source, tmp_path / "out", *CLIP, "--silhouettes", "--frames", "1:4")
    seen = {f"cam_{name}": formula(n) for n, name in enumerate(NAMES)}
    recording = mini.opened(tmp_path / "out", seen)
    assert recording.silhouettes_given and recording.frame_count == 3
    first = next(iter(recording))[2]["cam_54138969"]
    assert first[10:20, 6:10].all() and first.sum() == 40 * 3 * 255
    broken = folder / "Walking 1.54138969.mat"
    broken.write_bytes(broken.read_bytes()[:200])
    assert "cannot be read" in refuse("human36m", source, tmp_path / "a", *CLIP, "--masks")


def test_mistakes(source, tmp_path, refuse):
    out = tmp_path / "walk"
    assert "it has Walking 1" in refuse("human36m", source, out, *CLIP, "--sequence", "Jog")
    assert "it has S9" in refuse("human36m", source, out, *CLIP, "--subject", "S1")
    assert "it has 54138969" in refuse("human36m", source, out, *CLIP, "--cameras", "1")
    metadata = source / "metadata.xml"
    metadata.write_text(metadata.read_text()[:-200] + "]</w0></a>")
    assert "300 numbers" in refuse("human36m", source, out, *CLIP)
    metadata.unlink()
    assert "metadata.xml is missing" in refuse("human36m", source, out, *CLIP)


def test_truth_that_is_broken_or_missing(source, tmp_path, refuse, convert):
    truth = source / "S9" / "MyPoseFeatures" / "D3_Positions" / "Walking 1.cdf.mat"
    truth.write_bytes(truth.read_bytes()[:150])
    assert "Walking 1.cdf.mat cannot be read" in refuse("human36m", source, tmp_path / "a", *CLIP)
    truth.unlink()
    assert "Walking 1.cdf is missing" in refuse("human36m", source, tmp_path / "a", *CLIP)
    convert("human36m", source, tmp_path / "a", *CLIP, "--no-truth")
    assert not (tmp_path / "a" / "truth.json").exists()
