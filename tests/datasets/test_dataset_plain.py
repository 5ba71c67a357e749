"""Plain folders with masks, and what convert.py does for every data set."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.datasets import miniatures as mini
from tests.sources import write_film
from voxelpose import Recording

K = np.array([[70.0, 0, 31.5], [0, 70.0, 23.5], [0, 0, 1]])
Y_UP_FROM_Z_UP = np.array([[1, 0, 0], [0, 0, 1.0], [0, -1, 0]])
HOW = ("--unit", "mm", "--up", "y", "--fps", 20)


def pixels() -> dict[str, np.ndarray]:
    return {f"cam_view{n}": mini.pinhole(mini.POINTS, *mini.looking(n), K) for n in range(2)}


@pytest.fixture
def source(tmp_path):
    folder, toml = tmp_path / "clips", []
    for number in range(2):
        mini.write_images(folder / f"view{number}")
        mini.write_masks(folder / "masks" / f"view{number}")
        mini.write_images(folder / "background" / f"view{number}", 1)
        rotation, translation = mini.looking(number)
        toml.append(
            f'[view{number}]\nname = "view{number}"\nsize = {list(mini.SIZE)}\n'
            f"matrix = {K.tolist()}\ndistortions = []\n"
            f"rotation = {(rotation @ Y_UP_FROM_Z_UP.T).tolist()}\n"
            f"translation = {(1000 * translation).tolist()}\n"
        )
    (folder / "calibration.toml").write_text("\n".join(toml))
    return folder


def test_pictures_masks_backgrounds_and_subject(source, tmp_path, convert):
    out = tmp_path / "out"
    output = convert("plain", source, out, *HOW, "--stature", 1.75, "--sex", "female")
    assert output == f"{out}: 2 cameras, 6 frames of images\n"
    recording = mini.opened(out, pixels())
    assert recording.fps == pytest.approx(20)
    assert recording.subject.stature_m == 1.75 and recording.subject.sex == "female"
    assert set(recording.backgrounds()) == {"cam_view0", "cam_view1"}
    assert (out / "cam_view0" / "000000.png").samefile(source / "view0" / "000000.png")  # linked
    assert not (out / "truth.json").exists()


def test_silhouettes_only(source, tmp_path, convert):
    convert("plain", source, tmp_path / "out", *HOW, "--silhouettes", "--copy")
    recording = mini.opened(tmp_path / "out", pixels())
    assert recording.silhouettes_given
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"calibration.toml", "masks", "timestamps.csv"}


def test_frames_and_other_places(source, tmp_path, convert):
    for number in range(2):
        (source / f"view{number}").rename(source / f"image_view{number}")
        mini.write_video(source / "films" / f"view{number}_rgb.avi", fps=20)
    words = ("--pictures", "films/{camera}_rgb", "--frames", "2:5")
    convert("plain", source, tmp_path / "out", *HOW[:4], *words)
    recording = mini.opened(tmp_path / "out", pixels())
    assert recording.frame_count == 3
    means = [pictures["cam_view0"].mean() for _, _, pictures in recording]
    np.testing.assert_allclose(means, [60, 70, 80], atol=3)


def test_masks_may_end_before_the_images(source, tmp_path, convert):
    (source / "masks" / "view0" / "000005.png").unlink()
    convert("plain", source, tmp_path / "out", *HOW, "--frames", "3:6")
    assert mini.opened(tmp_path / "out", pixels()).frame_count == 3
    masks = [len(list((tmp_path / "out" / "masks" / f"cam_view{n}").iterdir())) for n in range(2)]
    assert masks == [2, 3]


def write_matte(file: Path) -> None:
    """A video of a square that moves."""
    images = np.zeros((mini.FRAMES, *mini.SIZE[::-1], 3), np.uint8)
    for number, image in enumerate(images):
        image[10:26, 5 + number : 21 + number] = 255
    write_film(file, images, 20)


def test_a_label_is_chosen_for_all_cameras(source, tmp_path, convert, refuse):
    for number in range(2):
        for file in sorted((source / "masks" / f"view{number}").iterdir()):
            image = cv2.imread(str(file), cv2.IMREAD_UNCHANGED) // 255
            image[30:34, :20] = 2 * (np.arange(20) < 4 + 2 * int(file.stem))
            cv2.imwrite(str(file), image)
    said = refuse("plain", source, tmp_path / "out", *HOW, "--silhouettes")
    assert "labels 1, 2" in said and "--label 1" in said
    convert("plain", source, tmp_path / "out", *HOW, "--silhouettes", "--label", 1)
    for _, _, frames in Recording.open(tmp_path / "out"):
        assert frames["cam_view0"].sum() == 100 * 3 * 255


def test_videos_of_masks_are_kept_unless_cut(source, tmp_path, convert):
    for number in range(2):
        write_matte(source / "mattes" / f"view{number}.avi")
    words = (*HOW[:4], "--masks", "mattes/{camera}", "--silhouettes")
    convert("plain", source, tmp_path / "whole", *words)
    assert (tmp_path / "whole" / "masks" / "cam_view0.avi").is_file()
    convert("plain", source, tmp_path / "cut", *words, "--frames", "1:5")
    areas = [frames["cam_view0"].mean() for _, _, frames in Recording.open(tmp_path / "cut")]
    np.testing.assert_allclose(areas, areas[0], rtol=0.1)
    assert len(areas) == 4 and areas[0] > 0


def test_videos_of_different_length(source, tmp_path, convert):
    for number in range(2):
        mini.write_video(source / "films" / f"view{number}.mp4", mini.FRAMES + number, fps=20)
    convert("plain", source, tmp_path / "out", *HOW[:4], "--pictures", "films/{camera}")
    assert mini.opened(tmp_path / "out", pixels()).frame_count == mini.FRAMES


def test_overwriting(source, tmp_path, convert, refuse):
    out = tmp_path / "out"
    convert("plain", source, out, *HOW)
    assert "add --overwrite to replace it" in refuse("plain", source, out, *HOW)
    convert("plain", source, out, *HOW, "--overwrite", "--cameras", "view1")
    assert Recording.open(out).rig.names == ("cam_view1",)
    other = tmp_path / "mine"
    other.mkdir()
    (other / "thesis.txt").write_text("years")
    assert "was not made by this command" in refuse("plain", source, other, *HOW, "--overwrite")
    assert "holds the data set itself" in refuse("plain", source, source, *HOW, "--overwrite")
    assert "holds the data set itself" in refuse("plain", source, tmp_path, *HOW, "--overwrite")
    # What fails leaves the old recording as it was.
    (source / "view1" / "000003.png").write_bytes(b"broken")
    (source / "masks" / "view1" / "000003.png").write_bytes(b"broken")
    assert "000003.png cannot be read" in refuse("plain", source, out, *HOW, "--overwrite")
    assert Recording.open(out).rig.names == ("cam_view1",)


def test_mistakes(source, tmp_path, refuse):
    out = tmp_path / "out"
    assert "in which unit" in refuse("plain", source, out, "--fps", 20)
    assert "give --fps" in refuse("plain", source, out, *HOW[:4])
    assert "choose from 0:6" in refuse("plain", source, out, *HOW, "--frames", "4:9")
    assert "is not A:B" in refuse("plain", source, out, *HOW, "--frames", "4")
    assert "there is no camera 'x'" in refuse("plain", source, out, *HOW, "--cameras", "x")
    assert "is impossible" in refuse("plain", source, out, *HOW, "--stature", "175")
    assert "is no folder" in refuse("plain", tmp_path / "nowhere", out)
    assert "must hold {camera}" in refuse("plain", source, out, *HOW, "--masks", "masks")
    for file in (source / "masks" / "view0").iterdir():
        file.unlink()
    assert "no masks of camera cam_view0" in refuse("plain", source, out, *HOW, "--silhouettes")
    mini.write_images(source / "view0", 1, size=(32, 24))
    output = refuse("plain", source, out, *HOW)
    assert "32 x 24" in output and f" {out}/cam_view0 is" in output
    assert "is no folder: make it" in refuse("plain", source, out / "deep" / "er", *HOW)
    (source / "calibration.toml").unlink()
    assert "--calibration" in refuse("plain", source, out, *HOW)


def test_a_bug_keeps_its_traceback(source, tmp_path, convert, monkeypatch):
    convert("--list")  # puts write.py in reach
    import write

    def broken(*_):
        raise RuntimeError("a bug")

    monkeypatch.setattr(write, "_write_subject", broken)
    with pytest.raises(RuntimeError, match="a bug"):
        convert("plain", source, tmp_path / "out", *HOW)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clips"]


def test_the_command_itself(source, tmp_path):
    done = mini.run_alone("plain", source, tmp_path / "out", *HOW)
    assert done.returncode == 0 and "2 cameras" in done.stdout, done.stderr
    done = mini.run_alone("plain", source, tmp_path / "out", *HOW)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)


def test_help_and_list(convert, refuse):
    names = sorted(path.parent.name for path in mini.CONVERT.parent.glob("*/recipe.py"))
    assert len(names) == 9
    assert [line.split()[0] for line in convert("--list").splitlines()] == names
    assert "examples:" in convert("--help")
    for name in names:
        output = convert(name, "--help")
        assert "--cameras" in output and f"{name}/card.md" in output
        assert (mini.CONVERT.parent / name / "card.md").is_file()
    assert "name a data set" in refuse()
    assert "invalid choice: 'humanova'" in refuse("humanova", "a", "b")


def test_nothing_here_is_a_package_or_opens_pickles():
    files = list(mini.CONVERT.parent.rglob("*.py"))
    assert files and not any(file.name == "__init__.py" for file in files)
    for file in files:
        text = file.read_text()
        assert "import pickle" not in text and "allow_pickle=True" not in text
