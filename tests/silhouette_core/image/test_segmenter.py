"""Segmentation networks of the user's own, and silhouettes with them."""

from pathlib import Path

import numpy as np
import pytest

from calib.errors import InputError
from silhouette_core.image.background import BackgroundModel
from silhouette_core.image.cut import cut_size
from silhouette_core.image.segmenter import GROUP, NetworkSegmenter, load_segmenter, person_odds
from tests.networks import red_network

RED, WALL = (20, 20, 230), (150, 140, 120)


@pytest.fixture
def network(tmp_path: Path) -> Path:
    path = tmp_path / "red.onnx"
    path.write_bytes(red_network())
    return path


def picture(size: tuple[int, int] = (96, 128)) -> tuple[np.ndarray, np.ndarray]:
    """A red rectangle before a wall, (H, W, 3) BGR, and where it is."""
    rows, columns = slice(size[0] // 4, size[0]), slice(size[1] // 4, size[1] // 2)
    frame, mask = np.full((*size, 3), WALL, np.uint8), np.zeros(size, bool)
    frame[rows, columns], mask[rows, columns] = RED, True
    return frame, mask


@pytest.mark.parametrize(("channels", "person"), [(1, 0), (2, 1), (21, 15)])
@pytest.mark.parametrize("size", [(64, 48), ("w", "h")])
def test_a_network_finds_what_it_was_made_for(tmp_path, channels, person, size):
    path = tmp_path / "red.onnx"
    path.write_bytes(red_network(channels, person, size))
    frame, mask = picture()
    found = load_segmenter(str(path)).probabilities(frame)
    assert found.shape == mask.shape
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found > 0.5, mask)
    assert found[~mask].max() < 0.3  # beside the edge


def test_outputs_that_are_not_understood_are_refused(tmp_path):
    path = tmp_path / "five.onnx"
    path.write_bytes(red_network(5, 3))
    with pytest.raises(InputError, match=r"\(1, 5, 48, 64\).*person = CHANNEL in five\.toml"):
        load_segmenter(str(path))
    (tmp_path / "five.toml").write_text("person = 3\n")
    frame, mask = picture()
    np.testing.assert_array_equal(load_segmenter(str(path)).probabilities(frame) > 0.5, mask)


def test_a_file_beside_it_states_how_colours_are_normalised(network):
    frame, mask = picture()
    network.with_suffix(".toml").write_text("mean = [1, 0, 0]\nstd = [1, 1, 1]\nsize = [64, 48]\n")
    assert load_segmenter(str(network)).probabilities(frame)[mask].max() < 0.1  # red is 0 now


@pytest.mark.parametrize("stated", ["std = [0, 1, 1]", "size = 3", "persons = 1"])
def test_a_wrong_file_beside_it_is_refused(network, stated):
    network.with_suffix(".toml").write_text(stated)
    with pytest.raises(InputError, match=r"red\.toml: .*; correct it"):
        load_segmenter(str(network))


@pytest.mark.parametrize("name", ["a.onnx", "a.tflite"])
def test_what_is_no_network_is_refused(tmp_path, name):
    with pytest.raises(InputError, match="cannot be read"):
        load_segmenter(str(tmp_path / name))
    (tmp_path / name).write_bytes(b"no network")
    with pytest.raises(InputError, match=r"is no network that OpenCV .* can read"):
        load_segmenter(str(tmp_path / name))


def test_others_can_register_theirs(tmp_path, monkeypatch):
    (tmp_path / "somebodys_segmenter.py").write_text(
        "import numpy as np\n"
        "class Red:\n"
        "    def probabilities(self, frame):\n"
        "        return (frame[..., 2] > 200).astype(np.float32)\n"
    )
    metadata = tmp_path / "somebodys_segmenter-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: somebodys-segmenter\nVersion: 1.0\n"
    )
    (metadata / "entry_points.txt").write_text(f"[{GROUP}]\nred = somebodys_segmenter:Red\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    frame, mask = picture()
    np.testing.assert_array_equal(load_segmenter("red").probabilities(frame) > 0.5, mask)
    with pytest.raises(InputError, match=r"no segmenter is called 'green': .*red; or give"):
        load_segmenter("green")


def test_who_never_moves_is_found_by_a_network_alone(network):
    frame, mask = picture((240, 320))
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 2, (20, *frame.shape))
    frames = np.rint(frame + noise).clip(0, 255).astype(np.uint8)
    without = BackgroundModel.from_occupied(frames)
    assert not without.silhouette(frames[3]).any()
    segmenter, size = NetworkSegmenter(network), cut_size((320, 240))
    odds = [person_odds(segmenter, one, size) for one in frames]
    model = BackgroundModel.from_occupied(frames, evidence=odds)
    found = model.silhouette(frames[3], evidence=odds[3])
    assert (found & mask).sum() > 0.95 * (found | mask).sum()
